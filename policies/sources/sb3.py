"""Policies that Stable-Baselines3 saved, of the environments of this simulator: actors run by numpy."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from nathlon.policies.checkpoint import ACTION_SIZE
from nathlon.policies.mlp import Mlp
from nathlon.policies.policy import Batch
from nathlon.policies.policy_file import content_id, opening, read_policy_file
from nathlon.policies.sources.foreign import ForeignCard, observation_spec
from nathlon.policies.sources.sb3_file import ACTORS, Sb3File
from nathlon.sim.errors import InputError

_EXPECTED = "MlpPolicy of SAC, TQC, TD3, DDPG, PPO or A2C"


class Sb3Policy:
    """An actor from Stable-Baselines3 or sb3-contrib: drives without noise.

    Attributes:
        card: what is known of the policy.
        id: SHA-256 of the file.
        observation_spec: layout of the observations that it expects.
        network: from observations to actions.
    """

    def __init__(self, card: ForeignCard, identity: str, network: Mlp, path: Path) -> None:
        """A policy of a network; `path` is for the error if the card has other observations."""
        self.card = card
        self.id = identity
        self.network = network
        self.observation_spec = observation_spec(path, card, len(network.layers[0][0]))

    @classmethod
    def load(cls, path: Path) -> Sb3Policy:
        """The policy stored in a file.

        Raises:
            InputError: if the file is no policy of a known architecture.
        """
        with opening(path):
            content = read_policy_file(path)
            file = Sb3File.read(path, content)
            family = file.family(ACTORS, _EXPECTED)
            _check_observations(file)
            _check_actions(file)
            card = file.card(family)
            layers = file.layers(family, ACTION_SIZE)
            network = Mlp(layers, file.hidden(family), "tanh" if family.squashes else "clip")
            return cls(card, content_id(content), network, path)

    def initial_memory(self, n: int) -> Batch:
        """No memory: (n, 0) float32."""
        return np.zeros((n, 0), np.float32)

    def act(self, observations: Batch, memory: Batch) -> tuple[Batch, Batch]:
        """Actions (n, 2) float32 for observations (n, observation_spec.size) float32; memory as it was."""
        return self.network(observations), memory


def _check_observations(file: Sb3File) -> None:
    shape = file.section("observation_space").get("_shape")
    if isinstance(shape, list) and len(shape) != 1:
        raise InputError(
            f"{file.path}: observation space of shape {shape}, as of stacked frames, expected one row"
        )


def _check_actions(file: Sb3File) -> None:
    low, high = (file.section("action_space").get(bound) for bound in ("low", "high"))
    if (low, high) != ("[-1. -1.]", "[1. 1.]"):
        raise InputError(f"{file.path}: action space from {low} to {high}, expected two from -1 to 1")
