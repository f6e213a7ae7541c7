"""The parts of a lap that the coach speaks of: bends with the braking before them, and straights."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from nathlon.arena.race_log import NamedStretch
from nathlon.lab.coach.lap import STEP_M, Lap

SMOOTH_M = 10.0
"""Pedals are looked at over so much of the road: policies tap them."""
BRAKING = 0.12
"""Pedal below which a car brakes."""
FULL = 0.9
"""Throttle from which it is full, and below `LET_GO` within the next `HOLDS_M` it was not."""
LET_GO = 0.7
HOLDS_M = 25.0
DAB = 0.25
"""Share of the effort of the hardest braking below which another one is none."""
PARTING_M = 20.0
"""Two brakings this close are one."""
STRAIGHT = "straight"


@dataclass(frozen=True)
class CoursePart:
    """A part of the lap; metres from the line.

    Attributes:
        name: of the circuit's section.
        kind: corner, chicane, straight.
        start_m, end_m: a bend begins where either driver brakes for it.
        number: of the part, from 0.
    """

    name: str
    kind: str
    start_m: float
    end_m: float
    number: int

    @property
    def bend(self) -> bool:
        """Whether it is one."""
        return self.kind != STRAIGHT


@dataclass(frozen=True)
class PartMarks:
    """What a driver does in a bend, and where, m from the line.

    Attributes:
        brake_m: where the braking for it begins; None without any.
        apex_m: the slowest place.
        full_m: where the throttle is full again; None if not before the end of the search.
        least_m_s: speed at the slowest place.
    """

    brake_m: float | None
    apex_m: float
    full_m: float | None
    least_m_s: float


def parts_of(sections: tuple[NamedStretch, ...], laps: tuple[Lap, Lap]) -> list[CoursePart]:
    """The parts of a lap, which follow each other without a gap.

    A gap before a section is its approach, and the end of a straight from where either lap brakes for the
    next bend is part of that bend.

    Args:
        sections: of the circuit; without any the lap is one bend.
        laps: whose braking counts.
    """
    length = (len(laps[0].time_s) - 1) * STEP_M
    known = sorted(sections, key=lambda section: section.start_m)
    if not known:
        return [CoursePart("the lap", "corner", 0.0, length, 0)]
    starts = [0.0]
    for before, section in pairwise(known):
        begin = before.end_m
        if section.kind != STRAIGHT:
            braking = [
                marks(lap, begin if before.kind != STRAIGHT else before.start_m, section) for lap in laps
            ]
            points = [mark.brake_m for mark in braking if mark.brake_m is not None]
            least = before.start_m + 0.25 * (before.end_m - before.start_m)
            begin = max(min([begin, *points]), least if before.kind == STRAIGHT else begin)
        starts.append(begin)
    ends = [*starts[1:], length]
    return [
        CoursePart(section.name, section.kind, round(start, 1), round(end, 1), number)
        for number, (section, start, end) in enumerate(zip(known, starts, ends, strict=True))
    ]


def marks(
    lap: Lap, from_m: float, section: NamedStretch | CoursePart, until_m: float | None = None
) -> PartMarks:
    """What a driver does for a bend.

    Args:
        lap: of the driver.
        from_m: where the braking is looked for first.
        section: the bend.
        until_m: where the throttle is looked for last; the end of the bend by default.
    """
    pedal = smooth(lap.pedal)
    first, inside, last = lap.at(from_m), lap.at(section.start_m), lap.at(section.end_m)
    apex = inside + int(np.argmin(lap.speed[inside : last + 1]))
    brake = _braking(pedal, first, apex)
    end = last if until_m is None else lap.at(until_m)
    full = _full(pedal, apex, end)
    return PartMarks(
        None if brake is None else brake * STEP_M,
        apex * STEP_M,
        None if full is None else full * STEP_M,
        float(lap.speed[apex]),
    )


def smooth(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """The mean over `SMOOTH_M` about each place."""
    window = round(SMOOTH_M / STEP_M)
    padded = np.pad(values, (window // 2, window - 1 - window // 2), mode="edge")
    return np.convolve(padded, np.full(window, 1.0 / window), "valid")


def _braking(pedal: NDArray[np.float64], first: int, apex: int) -> int | None:
    """Where the first braking between two places begins that is no mere dab beside the hardest."""
    there = np.flatnonzero(pedal[first : apex + 1] < -BRAKING) + first
    if not len(there):
        return None
    runs = np.split(there, np.flatnonzero(np.diff(there) > PARTING_M / STEP_M) + 1)
    effort = [-float(pedal[run].sum()) for run in runs]
    return int(next(run[0] for run, spent in zip(runs, effort, strict=True) if spent >= DAB * max(effort)))


def _full(pedal: NDArray[np.float64], apex: int, end: int) -> int | None:
    """Where the throttle becomes full after the apex, and stays so."""
    hold = round(HOLDS_M / STEP_M)
    for place in (np.flatnonzero(pedal[apex : end + 1] >= FULL) + apex).tolist():
        if pedal[place : place + hold].min() >= LET_GO:
            return int(place)
    return None
