"""What the cars of a race are called, and how they are coloured."""

from __future__ import annotations

import numpy as np

from nathlon.arena.foxglove_scene import TEAM_COLOURS
from nathlon.arena.race_log import RaceLog


def winner(log: RaceLog) -> int:
    """The car that is first in the last sample; the first car of a race without samples."""
    return int(np.argmin(log.samples["place"][-1])) if len(log.time_s) else 0


def labels(log: RaceLog) -> list[str]:
    """Number and name of each car."""
    return [f"{car} {name}" for car, name in enumerate(log.names)]


def car_colours(teams: tuple[int, ...]) -> list[tuple[int, int, int]]:
    """A shade of its team's colour for each car, the first of a team the strongest."""
    colours = []
    for car, team in enumerate(teams):
        earlier, size = teams[:car].count(team), teams.count(team)
        white = 0.6 * earlier / size
        red, green, blue = (round(part + white * (255 - part)) for part in TEAM_COLOURS[team])
        colours.append((red, green, blue))
    return colours
