"""Failures: what goes wrong while a policy drives, and the moments from which it is worth trying again."""

from __future__ import annotations

import math
from collections import deque
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from nathlon.policies.training.mistakes import spinning
from nathlon.sim.episode import Episodes, Moment

KINDS = {"spin": 3.0, "contact": 2.0, "off_course": 1.0}
"""How often a failure of each kind is drawn: more often what costs more. A contact is one at fault."""
EXCURSION_S = 0.25
"""Off course for longer is a failure."""
EVERY_S = 1.0
EARLIEST_S = 8.0
"""A failure is tried again from any of the moments kept, one a second, up to so long before."""
STRAIGHT_RAD = 0.6
"""Angle to the road up to which a car may still be saved."""

Flags = NDArray[np.bool_]
Indices = NDArray[np.int64]


class Failure(NamedTuple):
    """A moment before some car of a race came to grief, and which race it was."""

    race: int
    moment: Moment


class Failures:
    """The first failure of each kind of some cars, in races that are watched from their start."""

    def __init__(self, episodes: Episodes, races: Indices, cars: Indices, rng: np.random.Generator) -> None:
        """Nothing has gone wrong yet.

        Args:
            episodes: the races.
            races, cars: (n,) indices of the cars that are watched.
            rng: draws from how long before a failure is tried again.
        """
        self._episodes, self._races, self._cars, self._rng = episodes, races, cars, rng
        self._period = round(EVERY_S / episodes.step_s)
        self._recent: deque[Moment] = deque([episodes.moment()], 1 + round(EARLIEST_S / EVERY_S))
        self._steps = 0
        self._before, self._faults = self._astray(), self._watched["contacts_at_fault"]
        self._found: dict[str, dict[int, Failure]] = {kind: {} for kind in KINDS}

    @property
    def _watched(self) -> NDArray[np.void]:
        """CAR_STATE of the cars, a copy."""
        return self._episodes.world.state[self._races, self._cars]

    def _astray(self) -> dict[str, Flags]:
        cars = self._watched
        out = cars["off_course"] & (cars["out_s"] > EXCURSION_S)
        return {"spin": cars["driving"] & spinning(cars), "off_course": cars["driving"] & out}

    def watch(self) -> None:
        """Note what the last step brought; to be called after each."""
        self._steps += 1
        astray, faults = self._astray(), self._watched["contacts_at_fault"]
        new = {kind: flags & ~self._before[kind] for kind, flags in astray.items()}
        new["contact"] = faults > self._faults
        for kind, found in self._found.items():
            for index in np.flatnonzero(new[kind]).tolist():
                if index not in found:
                    self._note(kind, index)
        self._before, self._faults = astray, faults
        if self._steps % self._period == 0:
            self._recent.append(self._episodes.moment())

    def _note(self, kind: str, index: int) -> None:
        latest_s = (self._steps % self._period or self._period) * self._episodes.step_s
        back = max(math.ceil((self._rng.uniform(0.0, EARLIEST_S) - latest_s) / EVERY_S), 0)
        moment = self._recent[-1 - min(back, len(self._recent) - 1)]
        race, car = int(self._races[index]), self._cars[index]
        own = moment.state[race, car]
        on_its_way = abs(own["heading_error"]) <= STRAIGHT_RAD and not own["off_course"]
        if on_its_way and moment.endings[race, car] == "":
            self._found[kind][index] = Failure(race, moment.of(race))

    def draw(self, count: int) -> list[Failure]:
        """So many failures, or none where there were none.

        A kind is drawn first, then one of that kind; none comes twice before all of its kind have.
        """
        kinds = [kind for kind, found in self._found.items() if found]
        if not kinds:
            return []
        chances = np.array([KINDS[kind] for kind in kinds])
        left = {kind: self._shuffled(kind) for kind in kinds}
        drawn = []
        for _ in range(count):
            kind = kinds[self._rng.choice(len(kinds), p=chances / chances.sum())]
            if not left[kind]:
                left[kind] = self._shuffled(kind)
            drawn.append(self._found[kind][left[kind].pop()])
        return drawn

    def _shuffled(self, kind: str) -> list[int]:
        return self._rng.permutation(list(self._found[kind])).tolist()
