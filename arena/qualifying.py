"""Qualifying: a flying lap alone decides who starts in front."""

from __future__ import annotations

from collections.abc import Sequence

from nathlon.arena.entrant import Entrant
from nathlon.arena.match import Match, Race, Seat
from nathlon.arena.pool import Pool

SCENARIO = "time_trial"


def qualifying_match(entrant: Entrant, seed: int) -> Match:
    """The flying lap of one entrant in its car."""
    races, ids, sources = (Race(seed, (Seat(0),)),), (entrant.id,), (entrant.source,)
    where = entrant.circuit, entrant.car
    return Match("qualifying", SCENARIO, SCENARIO, *where, ids, sources, races, entrant.world)


def qualify(pool: Pool, entrants: Sequence[Entrant], seed: int) -> list[tuple[Entrant, float | None]]:
    """Entrants by their flying lap, fastest first, with its time in s.

    Who completes none, or leaves the course on it, has no time and starts behind the others, in the
    order given.

    Raises:
        InputError: if one cannot be loaded, or is another one by now.
    """
    matches = {qualifying_match(entrant, seed): entrant for entrant in entrants}
    laps = {match: results.row(0, named=True) for match, results in pool.run(list(matches))}
    times = [
        (entrant, laps[match]["best_lap_s"] if laps[match]["off_course_s"] == 0.0 else None)
        for match, entrant in matches.items()
    ]
    return sorted(times, key=lambda timed: (timed[1] is None, timed[1] or 0.0))
