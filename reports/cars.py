"""What the cars of a race are called, and how they are coloured."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from nathlon.arena.foxglove_scene import TEAM_COLOURS
from nathlon.arena.race_log import RaceLog
from nathlon.sim.errors import InputError


def winner(log: RaceLog) -> int:
    """The car that is first in the last sample; the first car of a race without samples."""
    return int(np.argmin(log.samples["place"][-1])) if len(log.time_s) else 0


def labels(log: RaceLog) -> list[str]:
    """Number and name of each car."""
    return [f"{car} {name}" for car, name in enumerate(log.names)]


def car_index(log: RaceLog, car: str, path: Path) -> int:
    """The car with this number or name; the best placed one of several with the same name.

    Raises:
        InputError: if there is none.
    """
    numbers = range(len(log.names))
    if car.isdecimal() and int(car) in numbers:
        return int(car)
    named = [number for number in numbers if car in (log.names[number], labels(log)[number])]
    if not named:
        raise InputError(
            f"{path}: there is no car {car!r}, expected a number from 0 to {len(numbers) - 1} "
            f"or one of {', '.join(dict.fromkeys(log.names))}"
        )
    return min(named, key=lambda number: log.samples["place"][-1, number]) if len(log.time_s) else named[0]


def car_colours(teams: tuple[int, ...]) -> list[tuple[int, int, int]]:
    """A shade of its team's colour for each car, the first of a team the strongest."""
    colours = []
    for car, team in enumerate(teams):
        earlier, size = teams[:car].count(team), teams.count(team)
        white = 0.6 * earlier / size
        red, green, blue = (round(part + white * (255 - part)) for part in TEAM_COLOURS[team])
        colours.append((red, green, blue))
    return colours
