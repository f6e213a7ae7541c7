"""Whether two races from one start can be had."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from nathlon.arena.race_log import RaceLog, start_number
from nathlon.sim.errors import InputError


def check_moment(log: RaceLog, recording: Path, car: int, at_s: float) -> None:
    """Raise an InputError for a moment at which a car does not drive."""
    driving = np.flatnonzero(log.samples["driving"][:, car])
    end_s = float(log.time_s[driving[-1]]) if len(driving) else 0.0
    if not 0.0 <= at_s <= end_s or not len(driving):
        raise InputError(
            f"{recording}: at is {at_s:g} s, expected a moment at which car {start_number(car)} drives, "
            f"0 to {end_s:.1f} s"
        )


def check_one_start(original: RaceLog, twin: RaceLog, recordings: tuple[Path, Path]) -> None:
    """Raise an InputError for two races that did not begin alike."""
    between = f"{recordings[0]} and {recordings[1]}"
    for field in ("circuit", "car"):
        one, other = getattr(original, field), getattr(twin, field)
        if one != other:
            raise InputError(f"{between}: {field} is {one!r} and {other!r}, expected the same")
    if len(original.names) != len(twin.names):
        cars = f"{len(original.names)} and {len(twin.names)}"
        raise InputError(f"{between}: {cars} cars start, expected as many")
    first = [log.samples[:1] for log in (original, twin)]
    start = ("x_m", "y_m", "yaw_rad", "velocity_x_m_s")
    if not all(np.array_equal(first[0][name], first[1][name]) for name in start):
        raise InputError(f"{between}: the cars start elsewhere or at another speed, expected one start")
