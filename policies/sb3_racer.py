"""Policies that Stable-Baselines3 saved, of the environments of this simulator: actors run by numpy."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from nathlon.policies.checkpoint import ACTION_SIZE
from nathlon.policies.policy import Batch
from nathlon.policies.policy_file import opening
from nathlon.policies.sources.foreign import observation_spec
from nathlon.sim.errors import InputError

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

    def __init__(self, model: Sb3Model, path: Path) -> None:
        """A policy of a model; `path` is for the error if it is none of this simulator's environments."""
        self.card, self.id = model.card, model.id
        self._model = model.network
        mlp, clipped = model.mlp, model.outputs.box == "clip"
        self.network = replace(mlp, output="clip") if mlp and clipped else mlp
        self.observation_spec = observation_spec(path, self.card, model.observed.size)

    @classmethod
    def load(cls, path: Path) -> Sb3Policy:
        """The policy stored in a file.

        Raises:
            InputError: if the file is no policy of a known architecture.
        """
        from nathlon.policies.general.sb3 import Sb3Model  # takes long to load

        with opening(path):
            model = Sb3Model.read(path)
            _check(model, path)
            return cls(model, path)

    def initial_memory(self, n: int) -> Batch:
        """Memory of networks that have one, and of stacked frames: (n, m) float32; mostly m is 0."""
        return self._model.initial_memory(n)

    def act(self, observations: Batch, memory: Batch) -> tuple[Batch, Batch]:
        """Actions (n, 2) float32 for observations (n, observation_spec.size) float32, and memory."""
        if self.network:
            return self.network(observations), memory
        numbers, memory = self._model.act(observations, memory)
        return np.clip(numbers, -1.0, 1.0), memory


def _check(model: Sb3Model, path: Path) -> None:
    if model.observed.shape is None or len(model.observed.shape) != 1:
        found = model.observed.shape or "of several arrays"
        raise InputError(
            f"{path}: observation space of shape {found}, as of stacked frames, expected one row"
        )
    low, high = (model.outputs.trained.get(bound) for bound in ("low", "high"))
    if model.outputs.box is None or (low, high) != _BOUNDS:
        raise InputError(f"{path}: action space from {low} to {high}, expected {ACTION_SIZE} from -1 to 1")
    if model.wrappers:
        raise InputError(f"{path}: was trained in the wrapper {model.wrappers[0]}, expected none")
