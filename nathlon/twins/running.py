"""Running a recorded race again, as it was and with another policy in a car's place."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from nathlon.arena.entrant import Entrant
from nathlon.arena.job import Wanted
from nathlon.arena.match import Swap
from nathlon.arena.pool import Pool
from nathlon.arena.race_log import RaceLog
from nathlon.reports.twin import Side
from nathlon.sim.errors import InputError
from nathlon.twins.rebuild import Rebuilt, same_race

OnRace = Callable[[int, int], None]
"""Told how many races have been run, and of how many."""


def race_both(
    pool: Pool,
    rebuilt: Rebuilt,
    log: RaceLog,
    recording: Path,
    swap: tuple[int, Entrant, float],
    on_race: OnRace,
) -> tuple[Side, Side]:
    """A race as it was, and with another policy in a car's place from a moment on; both with what it saw.

    Args:
        pool: runs them.
        rebuilt: the match of the race.
        log, recording: the race, and its file for errors.
        swap: the car, who drives it then, and from when, s.
        on_race: told about progress.

    Raises:
        InputError: if the race does not come out as it is recorded, or a policy cannot be loaded.
    """
    car, entrant, at_s = swap
    match = rebuilt.match
    swapped = replace(
        match,
        entrants=(*match.entrants, entrant.id),
        sources=(*match.sources, entrant.source),
        swap=Swap(log.race, car, len(match.entrants), at_s),
    )
    wanted = [
        Wanted(match, (log.race,), rebuilt.names, None, seen_by=car),
        Wanted(swapped, (log.race,), (*rebuilt.names, entrant.name), None, seen_by=car),
    ]
    original, twin = _raced(pool, wanted, on_race)
    _check(original, log, recording)
    return original, twin


def see_again(pool: Pool, rebuilt: Rebuilt, log: RaceLog, recording: Path, car: int) -> Side:
    """A race with what the driver of a car saw, for which it is run again; raises as `race_both`."""
    wanted = Wanted(rebuilt.match, (log.race,), rebuilt.names, None, seen_by=car)
    [side] = _raced(pool, [wanted], lambda done, total: None)
    _check(side, log, recording)
    return Side(log, side.seen)


def _raced(pool: Pool, wanted: Sequence[Wanted], on_race: OnRace) -> list[Side]:
    on_race(0, len(wanted))
    found: dict[str, Side] = {}
    for match, answer in pool.record(wanted):
        if isinstance(answer, InputError):
            raise answer
        found[match.key] = Side(answer.logs[0], answer.seen)
        on_race(len(found), len(wanted))
    return [found[one.match.key] for one in wanted]


def _check(side: Side, log: RaceLog, recording: Path) -> None:
    if not same_race(side.log, log):
        raise InputError(
            f"{recording}: came out otherwise when it was run again, expected a machine that computes the "
            "same as the one that recorded it"
        )


def check_moment(log: RaceLog, recording: Path, car: int, at_s: float) -> None:
    """Raise an InputError for a moment at which a car does not drive."""
    driving = np.flatnonzero(log.samples["driving"][:, car])
    end_s = float(log.time_s[driving[-1]]) if len(driving) else 0.0
    if not 0.0 <= at_s <= end_s or not len(driving):
        raise InputError(
            f"{recording}: at is {at_s:g} s, expected a moment at which car {car} drives, 0 to {end_s:.1f} s"
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
