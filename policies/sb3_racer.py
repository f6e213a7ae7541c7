"""Policies that Stable-Baselines3 saved, of the environments of this simulator: actors run by numpy."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from nathlon.policies.checkpoint import ACTION_SIZE
from nathlon.policies.policy import Batch, Observations
from nathlon.policies.policy_file import opening
from nathlon.policies.sources.foreign import observation_spec
from nathlon.sim.camera_spec import CHANNELS, CameraSpec
from nathlon.sim.episode import observation_space
from nathlon.sim.errors import InputError
from nathlon.sim.observation import ObservationSpec, flattened

if TYPE_CHECKING:
    from nathlon.policies.general.sb3 import Sb3Model

_BOUNDS = ("[-1. -1.]", "[1. 1.]")


class Sb3Policy:
    """An actor from Stable-Baselines3 or sb3-contrib: drives without noise.

    Attributes:
        card: what is known of the policy.
        id: SHA-256 of the file, with what lies beside it.
        observation_spec: layout of the observations that it expects.
        network: from observations to actions, if it is a perceptron that sees them as they are; else None.
    """

    def __init__(self, model: Sb3Model, path: Path, seeing: ObservationSpec | None = None) -> None:
        """A policy of a model.

        Args:
            model: the model.
            path: for the error if it is none of this simulator's environments.
            seeing: what it observes, if it sees by a camera.
        """
        self.card, self.id = model.card, model.id
        self._model = model.network
        mlp, clipped = model.mlp, model.outputs.box == "clip"
        self.network = replace(mlp, output="clip") if mlp and clipped else mlp
        self.observation_spec = seeing or observation_spec(path, self.id, self.card, model.observed.size)

    @classmethod
    def load(cls, path: Path) -> Sb3Policy:
        """The policy stored in a file.

        Raises:
            InputError: if the file is no policy of a known architecture.
        """
        from nathlon.policies.general.sb3 import Sb3Model  # takes long to load

        with opening(path):
            model = Sb3Model.read(path)
            camera = _camera(model)
            if camera is not None:
                model = Sb3Model.read(path, observation_space(camera))
            _check(model, path, camera)
            return cls(model, path, camera)

    def initial_memory(self, n: int) -> Batch:
        """Memory of networks that have one, and of stacked frames: (n, m) float32; mostly m is 0."""
        return self._model.initial_memory(n)

    def act(self, observations: Observations, memory: Batch) -> tuple[Batch, Batch]:
        """Actions (n, 2) float32 for observations of the spec, and memory."""
        if self.network:
            return self.network(observations), memory
        numbers, memory = self._model.act(flattened(observations), memory)
        return np.clip(numbers, -1.0, 1.0), memory


def _camera(model: Sb3Model) -> ObservationSpec | None:
    """What a model observes that sees by a camera, for a card that does not tell by the default one."""
    told = model.card.observation
    if told is not None:
        return None if told.camera is None else told
    match [part.shape for part in model.observed.parts]:
        # As Stable-Baselines3 turns pictures; smaller ones, and those that it would not turn, have no camera.
        case [(int(channels), int(height), int(width)), (int(),)] if channels in CHANNELS:
            return ObservationSpec(camera=CameraSpec(width=width, height=height, channels=channels))
    return None


def _check(model: Sb3Model, path: Path, seeing: ObservationSpec | None) -> None:
    shape = model.observed.shape
    if seeing is None and (shape is None or len(shape) != 1):
        found = shape or "of several arrays"
        raise InputError(
            f"{path}: observation space of shape {found}, as of stacked frames, expected one row"
        )
    low, high = (model.outputs.trained.get(bound) for bound in ("low", "high"))
    if model.outputs.box is None or (low, high) != _BOUNDS:
        raise InputError(f"{path}: action space from {low} to {high}, expected {ACTION_SIZE} from -1 to 1")
    if model.wrappers:
        raise InputError(f"{path}: was trained in the wrapper {model.wrappers[0]}, expected none")
