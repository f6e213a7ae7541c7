"""A moment that the driver marks with a key."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from nathlon.sim.world import World

MOST_MARKS = 50
"""In a race."""


class Mark(NamedTuple):
    """A moment of a race.

    Attributes:
        time_s: since the start.
        lap_m: where the driver's car was, along the lap.
        nearest: the car nearest to it on the road, as a place on the grid from 0; None where no other drove.
        apart_m: how far its centre was.
    """

    time_s: float
    lap_m: float
    nearest: int | None
    apart_m: float | None


def mark(world: World, car: int, lap_m: float) -> Mark:
    """The moment at which the first race of a world stands.

    Args:
        world: the world.
        car: the driver's.
        lap_m: length of the circuit.
    """
    cars = world.state[0]
    own = cars[car]
    apart = np.sqrt(sum((cars[axis] - own[axis]) ** 2 for axis in ("x", "y", "z")))
    others = np.flatnonzero(cars["driving"] & (np.arange(len(cars)) != car))
    time_s, place_m = round(float(world.time[0]), 3), round(float(own["progress"] % lap_m), 1)
    if not len(others):
        return Mark(time_s, place_m, None, None)
    nearest = int(others[np.argmin(apart[others])])
    return Mark(time_s, place_m, nearest, round(float(apart[nearest]), 1))
