"""Demonstrations: policies that drive the learner's cars in its place, so that it learns from what they do.

Off-policy learning takes experience from anyone. A table of a competent driver's transitions shows a new
policy what speed is worth long before it could get there by itself (Ball et al., "Efficient online
reinforcement learning with offline data", ICML 2023).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from nathlon.policies.driver.shown_plan import show_plans
from nathlon.policies.environments.opponents import SeatedOpponent
from nathlon.policies.policy import Batch, Policy
from nathlon.sim.episode import Episodes

NOISE = 0.05
"""Standard deviation of what is added to the actions of every second car: what surrounds a good line is
worth knowing too."""

Indices = NDArray[np.int64]


class Demonstrators:
    """Policies that take turns in driving some cars."""

    def __init__(self, policies: Sequence[Policy], episodes: Episodes, races: Indices, cars: Indices) -> None:
        """Demonstrators of the cars at (n,) indices; the first policy drives the first, and so on."""
        self._races = races
        turns = np.arange(len(races)) % max(len(policies), 1)
        self._seats = [np.flatnonzero(turns == turn) for turn in range(len(policies))]
        show_plans(episodes.world, *policies)
        self._drivers = [
            SeatedOpponent(policy, view, episodes.world, races[seats], cars[seats])
            for policy, seats in zip(policies, self._seats, strict=True)
            for view in [episodes.watch(policy.observation_spec, races[seats], cars[seats])]
        ]

    def __bool__(self) -> bool:
        """Whether there are any."""
        return bool(self._drivers)

    def forget(self, races: Sequence[int]) -> None:
        """Start the memory of the cars of some races afresh."""
        for driver, seats in zip(self._drivers, self._seats, strict=True):
            driver.forget(np.flatnonzero(np.isin(self._races[seats], races)))

    def act(self, rng: np.random.Generator) -> Batch:
        """Actions of all their cars, (n, 2), in [-1, 1]."""
        actions = np.zeros((len(self._races), 2), np.float32)
        for driver, seats in zip(self._drivers, self._seats, strict=True):
            actions[seats] = driver.act(np.arange(len(seats)))
        actions[1::2] += rng.normal(0.0, NOISE, actions[1::2].shape)
        return actions.clip(-1.0, 1.0)
