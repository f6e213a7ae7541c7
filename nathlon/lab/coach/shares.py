"""How much of the time lost in a part each thing explains that a driver does otherwise.

Of two drivers who push alike, the difference of the squares of their speeds stays as it is: v dv/dx is the
acceleration of both. So whoever is slower by d where the speed is v loses d / v² a metre there, and (v / v')³
times as much where it is v'. That much is carried from the slowest place of a bend, on the way out where both
push alike, and on the way in where both brake alike. What is lost beyond that is lost where it is.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from nathlon.lab.coach.lap import STEP_M, Lap, Trace
from nathlon.lab.coach.parts import smooth

ALIKE = 0.93
"""Share of the other's acceleration to the side with which its grip is used as well."""
TIGHTER = 1.08
"""How many times more a way turns than one that is only driven slower."""


class Shares(NamedTuple):
    """Of the time lost in a part, s; negative where it is gained.

    Attributes:
        way: for a longer way, at the same speeds.
        carried: for being slower at the place from which it is reckoned.
        before, after: beyond that, up to there and from there on.
    """

    way: float
    carried: float
    before: float
    after: float


def shares(own: Lap, other: Lap, start_m: float, from_m: float, end_m: float) -> Shares:
    """What makes up the time lost between two places.

    Args:
        own, other: the laps.
        start_m, end_m: the places, m from the line.
        from_m: the slowest place of a bend, or where a straight begins.
    """
    first, middle, last = own.at(start_m), own.at(from_m), own.at(end_m)
    inside = slice(first, last)
    (own_s, own_v), (other_s, other_v) = _steps(own, inside), _steps(other, inside)
    # Metres driven for each metre of the centre line.
    own_way, other_way = own_s * own_v, other_s * other_v
    way = float(np.sum((own_way - other_way) * 0.5 * (1.0 / own_v + 1.0 / other_v)))
    slower = 0.5 * (own_way + other_way) * (1.0 / own_v - 1.0 / other_v)
    at = min(middle, len(own.speed) - 1)
    there = max(0.0, STEP_M * (1.0 / float(own.speed[at]) - 1.0 / float(other.speed[at])))
    carried = there * (float(own.speed[at]) / own_v) ** 3
    carried = np.clip(slower, 0.0, carried)
    beyond = slower - carried
    split = max(middle - first, 0)
    return Shares(way, float(carried.sum()), float(beyond[:split].sum()), float(beyond[split:].sum()))


class Turn(NamedTuple):
    """How a driver turns in a bend, beside the other one.

    Attributes:
        pull: acceleration to the side, as a share of the other's.
        tightness: how many times the acceleration that its speed at the slowest place would give it on the
            way of the other; above 1 where its way is narrower, or where it is slower there than elsewhere.
    """

    pull: float
    tightness: float

    @property
    def tighter(self) -> bool:
        """Whether it turns more than its speed tells."""
        return self.tightness > TIGHTER

    @property
    def narrower(self) -> bool:
        """Whether it has as much grip to use, or turns more: it is not slower for want of courage."""
        return self.pull >= ALIKE or self.tighter


def turn(own: Lap, other: Lap, start_m: float, end_m: float) -> Turn:
    """How a driver turns in a bend from one place to another."""
    inside = slice(own.at(start_m), own.at(end_m) + 1)
    pulls = [float(np.abs(smooth(lap.side_acceleration)[inside]).max()) for lap in (own, other)]
    speeds = [max(float(lap.speed[inside].min()), 1.0) for lap in (own, other)]
    pull = pulls[0] / max(pulls[1], 1e-3)
    return Turn(pull, pull * (speeds[1] / speeds[0]) ** 2)


def _steps(lap: Lap, inside: slice) -> tuple[Trace, Trace]:
    """Time from each place to the next, s, and the speed between them, m/s."""
    ends = slice(inside.start + 1, inside.stop + 1)
    time: Trace = lap.time_s[ends] - lap.time_s[inside]
    speed: Trace = 0.5 * (lap.speed[ends] + lap.speed[inside])
    return time, np.maximum(speed, 1.0)
