"""What scripted people make of other cars: they go by on a free side, and brake for whom they cannot pass."""

from __future__ import annotations

import math
from collections import deque
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from nathlon.policies.driver.knowledge import along, clip
from nathlon.policies.driver.margins import room_aside
from nathlon.sim.clock import DYNAMICS_DT, DYNAMICS_HZ
from nathlon.sim.track import load_track

APART_M = 2.9
"""Between the middles of two cars that are beside each other."""
LONG_M = 7.0
"""Between the middles of two cars of which one follows the other."""
NOTICE_M, NOTICE_S = 14.0, 2.5
"""Others ahead matter that are nearer, or are reached sooner."""
BRAKING = 4.0
"""m/s^2 that they plan with."""
ASIDE_M_S = 1.6
"""How fast they move across the road."""


class Advice(NamedTuple):
    """What the others make a driver do.

    Attributes:
        aside: m left of the line to drive.
        limit: m/s, greatest speed.
    """

    aside: float
    limit: float


class ScriptedTraffic:
    """A scripted person's eye for others, through one race.

    Args:
        circuit: name.
        late_s: from what happens to when they see it.
        offset: of the line that they drive alone, m left of the centre line, by rows of the track table.
    """

    def __init__(self, circuit: str, late_s: float, offset: NDArray[np.float64]) -> None:
        track = load_track(circuit)
        self._offset, self._spacing, self._length = offset, track.spacing, track.length
        self._left, self._right = room_aside(track)
        self._late_s = late_s
        late = round(late_s * DYNAMICS_HZ)
        self._seen: deque[NDArray[np.void]] = deque(maxlen=late + 1)
        self._aside = 0.0

    def advise(self, others: NDArray[np.void], distance: float, speed: float) -> Advice:
        """What to do, once a dynamics step.

        Args:
            others: states of the other cars that drive.
            distance, speed: where the driver thinks they are, m along the lap, and how fast.
        """
        self._seen.append(others.copy())
        line = along(self._offset, distance, self._spacing)
        left = along(self._left, distance, self._spacing) - line
        right = -along(self._right, distance, self._spacing) - line
        aside, limit = 0.0, math.inf
        for other in sorted(self._seen[0], key=lambda other: -abs(self._gap(other, distance))):
            gap, there = self._gap(other, distance), self._aside_of(other)
            if abs(gap) < LONG_M:
                left_of_it = self._aside >= there
                aside = max(aside, there + APART_M) if left_of_it else min(aside, there - APART_M)
            elif 0.0 < gap < max(NOTICE_M, NOTICE_S * (speed - other["velocity_x"])):
                if abs(self._aside - there) < APART_M:
                    limit = min(limit, self._behind(other, gap))
                by_left, by_right = there + APART_M, there - APART_M
                free = [side for side in (by_left, by_right) if right <= side <= left]
                if free and abs(aside - there) < APART_M:
                    aside = min(free, key=lambda side: abs(side - self._aside))
        step = ASIDE_M_S * DYNAMICS_DT
        self._aside += clip(clip(aside, min(right, 0.0), max(left, 0.0)) - self._aside, -step, step)
        return Advice(self._aside, limit)

    def _gap(self, other: np.void, distance: float) -> float:
        ahead = other["progress"] + other["velocity_x"] * self._late_s - distance
        return float((ahead + 0.5 * self._length) % self._length - 0.5 * self._length)

    def _aside_of(self, other: np.void) -> float:
        return float(other["lateral"] - along(self._offset, float(other["progress"]), self._spacing))

    def _behind(self, other: np.void, gap: float) -> float:
        return float(other["velocity_x"]) + math.sqrt(2.0 * BRAKING * max(gap - LONG_M, 0.0))
