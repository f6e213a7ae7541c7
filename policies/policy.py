"""The contract of everything that drives."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from nathlon.sim.observation import ObservationSpec

Batch = NDArray[np.float32]
Observations = NDArray[Any]
"""As `World.observe` gives them: (n, size) float32, with a camera (n,) records."""


def has_reverse(policy: Any) -> bool:
    """Whether a policy's cars have a reverse gear: if its `reverse` says so, or else by what it sees."""
    seen: ObservationSpec | None = getattr(policy, "observation_spec", None)
    return bool(getattr(policy, "reverse", seen is not None and trained_with_reverse(seen)))


def trained_with_reverse(seen: ObservationSpec) -> bool:
    """Whether cars in training have a reverse gear: those with a plan or a camera; older ones have none."""
    return seen.planned or seen.camera is not None


def takes_pace(policy: Any) -> bool:
    """Whether a policy can be told how fast to drive: if its `paced` says so, or else if it sees a plan."""
    seen: ObservationSpec | None = getattr(policy, "observation_spec", None)
    return bool(getattr(policy, "paced", seen is not None and seen.planned))


class Policy(Protocol):
    """Maps a batch of observations to a batch of actions, one row a car.

    A policy keeps no state of its own between calls: what it must remember from one tick to the
    next is a row of `memory`, handed to it and handed back, so that one policy object can drive
    any number of cars in any number of races at once.
    """

    observation_spec: ObservationSpec

    def initial_memory(self, n: int) -> Batch:
        """Memory of n cars at the start of a run, (n, m) float32; m may be 0."""
        ...

    def act(self, observations: Observations, memory: Batch) -> tuple[Batch, Batch]:
        """Actions for n cars and their memory after this tick.

        Args:
            observations: (n, observation_spec.size) float32, standardised; with a camera (n,) records of
                these as `sensors`, and of `picture`, (height, width, channels) uint8.
            memory: (n, m) float32, as returned by the last call.

        Returns:
            actions (n, 2) float32 in [-1, 1]: throttle (+) or brake (-), steering (+ is left);
            memory (n, m) float32.
        """
        ...


@dataclass
class StatelessPolicy:
    """A policy that keeps nothing in mind.

    Attributes:
        observation_spec: layout of what it sees.
        network: actions (n, 2) float32 for observations (n, observation_spec.size) float32.
    """

    observation_spec: ObservationSpec
    network: Callable[[Batch], Batch]

    def initial_memory(self, n: int) -> Batch:
        """No memory: (n, 0) float32."""
        return np.zeros((n, 0), np.float32)

    def act(self, observations: Batch, memory: Batch) -> tuple[Batch, Batch]:
        """Actions of the network; memory as it was."""
        return self.network(observations), memory
