"""Who rests where more entrants play for themselves than there are places: all meet about equally often.

A cyclic design (John and Williams, Cyclic and Computer Generated Designs, 2nd edition, 1995): the entrants
are numbered round a circle, and a unit has a race for each turn of the circle by one number. Its first race
decides the others, and how often two entrants meet depends on how far apart they are on the circle.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

CYCLE = 24
"""Units after which the design begins again."""


def first_race(entrants: int, places: int, unit: int) -> tuple[int, ...]:
    """Who of (0, ..., entrants - 1) take the places of the first race of a unit, in their order.

    The units so far, this one included, have everybody meet everybody as evenly as could be found. In every
    second one the order is turned round: who started ahead of another then starts behind it.

    Args:
        entrants: more than places.
        places: of a race.
        unit: its number, from 0.
    """
    cycle, number = divmod(unit, CYCLE)
    chosen = _chosen(entrants, places, number)
    return chosen[::-1] if (cycle + number) % 2 else chosen


@lru_cache(maxsize=256)
def _chosen(entrants: int, places: int, unit: int) -> tuple[int, ...]:
    met = np.zeros(entrants, np.int64)
    for before in range(unit):
        met += _meetings(_chosen(entrants, places, before), entrants)
    race = [0]
    while len(race) < places:
        race.append(_best(race, met, entrants))
    # One after another gives its place to whoever suits better, until nobody does.
    changed = True
    while changed:
        changed = False
        for place in range(1, places):
            others = race[:place] + race[place + 1 :]
            better = [*others, _best(others, met, entrants)]
            if _unevenness(better, met, entrants) < _unevenness(race, met, entrants):
                race, changed = better, True
    return tuple(race)


def _meetings(race: tuple[int, ...] | list[int], entrants: int) -> NDArray[np.int64]:
    """(entrants,) how often two meet in a unit that are so far apart, counted both ways round."""
    numbers = np.array(race)
    apart = (numbers[:, None] - numbers) % entrants
    met = np.bincount(apart.ravel(), minlength=entrants)
    met[0] = 0
    return met


def _unevenness(race: list[int], met: NDArray[np.int64], entrants: int) -> int:
    total = met + _meetings(race, entrants)
    return int(total @ total)


def _best(race: list[int], met: NDArray[np.int64], entrants: int) -> int:
    """The entrant to add to a race so that meetings stay as even as can be; of equals the first."""
    total = met + _meetings(race, entrants)
    distances = (np.arange(entrants)[:, None] - np.array(race)) % entrants
    # Each distance is met once more both ways round.
    added = (2 * total[distances] + 2 * total[-distances % entrants]).sum(axis=1)
    added[race] = np.iinfo(np.int64).max
    return int(np.argmin(added))
