"""Running a recorded race again, as it was and with another policy in a car's place."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from nathlon.arena.entrant import Entrant
from nathlon.arena.job import Wanted
from nathlon.arena.match import Swap
from nathlon.arena.pool import Pool
from nathlon.arena.race_log import RaceLog
from nathlon.judge.twin.rebuild import Rebuilt, same_race
from nathlon.results.twin import Side
from nathlon.sim.errors import InputError

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


def see_again(
    pool: Pool,
    rebuilt: Sequence[Rebuilt],
    logs: Sequence[RaceLog],
    recordings: Sequence[Path],
    car: int,
    on_race: OnRace,
) -> list[Side]:
    """Races with what the drivers of a car saw, for which they are run again; else as `race_both`."""
    wanted = [
        Wanted(match, (log.race,), names, None, seen_by=car)
        for (match, names), log in zip(rebuilt, logs, strict=True)
    ]
    sides = _raced(pool, wanted, on_race)
    for side, log, recording in zip(sides, logs, recordings, strict=True):
        _check(side, log, recording)
    return sides


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
