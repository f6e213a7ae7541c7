"""The lap to compare with: that of the champion of the circuit, or the best lap of another race."""

from __future__ import annotations

from pathlib import Path
from typing import Literal, NamedTuple

from nathlon.arena.entrance import enter_each
from nathlon.arena.job import Wanted
from nathlon.arena.pool import Pool
from nathlon.arena.qualifying import qualifying_match
from nathlon.arena.race_log import RaceLog
from nathlon.arena.recording import read_recording
from nathlon.lab.coach.lap import Lap, laps_of
from nathlon.policies.bundled import champions
from nathlon.policies.checkpoint import read_card
from nathlon.policies.sources import DRIVER
from nathlon.selection.publish.lap_limits import known_limit
from nathlon.sim.errors import InputError
from nathlon.sim.process import typed

CHAMPION, LIMIT = "champion", "limit"
SEED = 1
"""Of the start of the champion's lap."""


class Reference(NamedTuple):
    """A lap to compare with.

    Attributes:
        name: of its driver.
        kind: the bundled champion, the built-in driver where there is none, or a recorded race.
        lap: the lap.
        limit_s: the limit lap time of circuit and car, s; None where it is not known.
    """

    name: str
    kind: Literal["champion", "driver", "recording"]
    lap: Lap
    limit_s: float | None


def reference(pool: Pool, log: RaceLog, against: str) -> Reference:
    """The lap to compare a race's laps with.

    Args:
        pool: drives the champion's lap.
        log: the race.
        against: `champion`, `limit` (the same lap, and the limit has to be known) or a recording.

    Raises:
        InputError: if there is no such lap, or it was driven elsewhere.
    """
    limit_s = known_limit(log.circuit, log.car)
    if against == LIMIT and limit_s is None:
        raise InputError(
            f"--against limit: the limit of {log.circuit} with {log.car} is not known, expected it to be "
            f"computed: {typed('track', 'limit', log.circuit, '--car', log.car)}"
        )
    if against in (CHAMPION, LIMIT):
        return _champion(pool, log, limit_s)
    return _recorded(Path(against), log, limit_s)


def _champion(pool: Pool, log: RaceLog, limit_s: float | None) -> Reference:
    """A flying lap of the bundled champion, or of the built-in driver, driven now."""
    home = [path for path in champions() if _made_for(path) == (log.circuit, log.car)]
    source, kind = (str(home[0]), "champion") if home else (DRIVER, "driver")
    [entrant] = enter_each(pool, [source], log.circuit, log.car)
    if isinstance(entrant, InputError):
        raise entrant
    match = qualifying_match(entrant, SEED)
    [(_, answer)] = pool.record([Wanted(match, (0,), (entrant.name,), None)])
    if isinstance(answer, InputError):
        raise answer
    laps = laps_of(answer.logs[0], 0)
    if not laps:
        raise InputError(f"{entrant.name} completes no lap of {log.circuit}, expected --against RACE.mcap")
    return Reference(entrant.name, "champion" if kind == "champion" else "driver", laps[0], limit_s)


def _made_for(checkpoint: Path) -> tuple[str | None, str | None]:
    card = read_card(checkpoint)
    return card.circuit, card.car


def _recorded(path: Path, log: RaceLog, limit_s: float | None) -> Reference:
    """The best lap of a recorded race."""
    other = read_recording(path)
    for field in ("circuit", "car"):
        if getattr(other, field) != getattr(log, field):
            raise InputError(
                f"{path}: {field} is {getattr(other, field)!r}, "
                f"expected {getattr(log, field)!r} as in the race"
            )
    laps = [(lap, name) for car, name in enumerate(other.names) for lap in laps_of(other, car)]
    if not laps:
        raise InputError(f"{path}: nobody completes a lap, expected a race with one")
    best, name = min(laps, key=lambda each: each[0].lap_s)
    return Reference(name, "recording", best, limit_s)
