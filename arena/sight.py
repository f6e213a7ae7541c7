"""What the driver of one car of a race saw, whenever it acted."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from nathlon.arena.match import Match
from nathlon.arena.runner import EARLY_S
from nathlon.arena.team import Absent
from nathlon.policies.policy import Policy
from nathlon.sim.observation import ObservationSpec
from nathlon.sim.reaction import Perception
from nathlon.sim.scenario import load_scenario
from nathlon.sim.world import World


class Seen(NamedTuple):
    """What one policy saw from one car.

    Attributes:
        spec: how it observes.
        time_s: (n,) float64, when it acted, s since the start.
        numbers: (n, spec.size) float32, in the fields' own units.
    """

    spec: ObservationSpec
    time_s: NDArray[np.float64]
    numbers: NDArray[np.float32]


class _Driver(NamedTuple):
    """How a driver observes, and what it has seen: times in s and standardised numbers."""

    spec: ObservationSpec
    perception: Perception
    kept: list[tuple[float, NDArray[np.float32]]]

    @property
    def seen(self) -> Seen:
        mean, deviation = self.spec.scaling
        times, numbers = zip(*self.kept, strict=True)
        return Seen(self.spec, np.array(times), np.stack(numbers) * deviation + mean)


class Sight:
    """Watches a match and keeps what one car's driver is told; a car that is swapped has two.

    Of a driver that sees by a camera nothing is kept.
    """

    def __init__(self, match: Match, policies: Sequence[Policy | Absent], race: int, car: int) -> None:
        """Nothing has been seen yet.

        Args:
            match: the match.
            policies: one for each of its entrants.
            race, car: whose driver.
        """
        self._race, self._car = race, car
        reaction = load_scenario(match.scenario).reaction
        where = np.array([race]), np.array([car])
        drivers = [match.races[race].seats[car].entrant]
        self._from_s = [0.0]
        if match.swap and (match.swap.race, match.swap.car) == (race, car):
            drivers.append(match.swap.entrant)
            self._from_s.append(match.swap.from_s)
        self._drivers = [
            _Driver(policy.observation_spec, Perception(policy.observation_spec, *where, reaction), [])
            if not isinstance(policy := policies[driver], Absent) and policy.observation_spec.camera is None
            else None
            for driver in drivers
        ]

    def __call__(self, world: World) -> None:
        """Look at the world before a tick."""
        now_s = float(world.time[self._race])
        at_wheel = sum(now_s > from_s - EARLY_S for from_s in self._from_s) - 1
        for number, driver in enumerate(self._drivers):
            if driver is None:
                continue
            # What is seen may be late: every driver looks from the start.
            [seen], [due] = driver.perception.see(world), driver.perception.due(world)
            if number == at_wheel and due and world.state["driving"][self._race, self._car]:
                driver.kept.append((now_s, seen))

    @property
    def seen(self) -> tuple[Seen, ...]:
        """What its drivers saw, in turn; nothing of one that never acted."""
        return tuple(driver.seen for driver in self._drivers if driver and driver.kept)
