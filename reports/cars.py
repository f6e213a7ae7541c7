"""What the cars of a race are called, and how they are coloured."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from nathlon.arena.foxglove_scene import TEAM_COLOURS
from nathlon.arena.match import NO_TEAM
from nathlon.arena.race_log import RaceLog, numbered, start_number
from nathlon.sim.errors import InputError

ENTRANT_COLOURS = (
    (86, 180, 233),
    (230, 159, 0),
    (0, 158, 115),
    (204, 121, 167),
    (240, 228, 66),
    (213, 94, 0),
    (120, 120, 235),
    (160, 190, 120),
)
"""Red, green and blue of entrants in races without teams; colour-blind people tell most of them apart."""


def winner(log: RaceLog) -> int:
    """The car that is first in the last sample; the first car of a race without samples."""
    return int(np.argmin(log.samples["place"][-1])) if len(log.time_s) else 0


def labels(log: RaceLog) -> list[str]:
    """Start number and name of each car."""
    return numbered(log.names)


def car_index(log: RaceLog, car: str, path: Path) -> int:
    """The car with this start number or name; the best placed one of several with the same name.

    Raises:
        InputError: if there is none.
    """
    cars = range(len(log.names))
    found = [index for index in cars if car == str(start_number(index))]
    if found:
        return found[0]
    named = [index for index in cars if car in (log.names[index], labels(log)[index])]
    if not named:
        raise InputError(
            f"{path}: there is no car {car!r}, expected a number from 1 to {len(cars)} "
            f"or one of {', '.join(dict.fromkeys(log.names))}"
        )
    return min(named, key=lambda index: log.samples["place"][-1, index]) if len(log.time_s) else named[0]


def car_colours(log: RaceLog) -> list[tuple[int, int, int]]:
    """A shade of its team's colour for each car, the first the strongest; without teams its entrant's."""
    if set(log.teams) == {NO_TEAM}:
        known = list(dict.fromkeys(log.names))
        groups = [known.index(name) % len(ENTRANT_COLOURS) for name in log.names]
        return [_shade(ENTRANT_COLOURS[group], groups, car) for car, group in enumerate(groups)]
    return [_shade(TEAM_COLOURS[team], log.teams, car) for car, team in enumerate(log.teams)]


def _shade(colour: tuple[int, int, int], groups: Sequence[int], car: int) -> tuple[int, int, int]:
    """Whiter, the more cars of its group come before it."""
    earlier, size = groups[:car].count(groups[car]), groups.count(groups[car])
    white = 0.6 * earlier / size
    red, green, blue = (round(part + white * (255 - part)) for part in colour)
    return red, green, blue
