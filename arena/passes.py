"""Overtaking, as a race's log shows it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from nathlon.arena.race_log import RaceLog, lap_length, origin, progress

START_S = 10.0
"""So long a grid sorts itself out: who gets away better passes nobody."""
HELD_S = 2.0
"""So long one car is ahead before, and so long the other one after; less where a run ends before."""
ASTRAY_S = 3.0
"""A car that was off course or served a penalty so shortly before was not passed: it gave its place away."""
CRAWLING = 0.5
"""So did one that is slower than this share of the other's speed."""


@dataclass(frozen=True)
class Pass:
    """One car goes by another.

    Attributes:
        time_s: from which the car is ahead.
        car: that passes.
        passed: the other one.
        place: of the car right after.
        x_m, y_m: where, world frame.
        section: index of the log's section; -1 between them.
        stands: whether the other one never came by again.
    """

    time_s: float
    car: int
    passed: int
    place: int
    x_m: float
    y_m: float
    section: int
    stands: bool


def passes(log: RaceLog) -> tuple[Pass, ...]:
    """All passes of a race, in the order of time."""
    along = progress(log)
    found = [one for pair in combinations(range(len(log.names)), 2) for one in _between(log, along, pair)]
    return tuple(sorted(found, key=lambda one: (one.time_s, one.place)))


def _between(log: RaceLog, along: NDArray[np.float64], pair: tuple[int, int]) -> Iterator[Pass]:
    samples = log.samples[:, pair]
    both = int(np.argmin(np.append(samples["driving"].all(axis=1), False)))
    ahead, times = along[:both, pair[0]] > along[:both, pair[1]], log.time_s[:both]
    for tick in (np.flatnonzero(ahead[1:] != ahead[:-1]) + 1).tolist():
        since, until = np.searchsorted(times, [times[tick] - HELD_S, times[tick] + HELD_S])
        held = (ahead[since:tick] != ahead[tick]).all() and (ahead[tick:until] == ahead[tick]).all()
        lead = 0 if ahead[tick] else 1
        lately = slice(int(np.searchsorted(times, times[tick] - ASTRAY_S)), tick + 1)
        if times[tick] < START_S or not held or _gave_way(samples[lately], 1 - lead):
            continue
        car = pair[lead]
        sample = log.samples[tick, car]
        yield Pass(
            float(times[tick]),
            car,
            pair[1 - lead],
            int(sample["place"]),
            float(sample["x_m"]),
            float(sample["y_m"]),
            _section(log, float(along[tick, car])),
            bool((ahead[tick:] == ahead[tick]).all()),
        )


def _gave_way(lately: NDArray[np.void], passed: int) -> bool:
    """Whether the second of two cars was off course, served a penalty or is far slower than the other."""
    car, speed = lately[:, passed], lately[-1]["velocity_x_m_s"]
    return bool(
        car["off_course"].any()
        or (np.diff(car["penalty_s"]) < 0.0).any()
        or speed[passed] < CRAWLING * speed[1 - passed]
    )


def _section(log: RaceLog, along_m: float) -> int:
    place_m = (along_m + origin(log)) % lap_length(log.outline)
    held = [i for i, section in enumerate(log.sections) if section.start_m <= place_m < section.end_m]
    return held[0] if held else -1
