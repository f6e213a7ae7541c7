"""Roads with known answers, and cars put on them, for the tests of the simulator."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from nathlon.sim.car import Car, load_car
from nathlon.sim.conditions import Conditions, Start
from nathlon.sim.track import CircuitFile, Grid, Track, build_track
from nathlon.sim.world import World

GT3: Car = load_car("gt3")
Profile = NDArray[np.float64] | float


def road(
    x: NDArray[np.float64],
    y: NDArray[np.float64],
    half_width: float,
    wall: float,
    z: Profile = 0.0,
    bank: Profile = 0.0,
    **facts: Any,
) -> Track:
    """A road through the points of a closed line, as wide and walled on both sides.

    Args:
        x, y: (n,) m.
        half_width, wall: from the centre line, m.
        z: height, m, (n,) or the same everywhere.
        bank: angle, rad, + is left side up, (n,) or the same everywhere.
        facts: fields of the circuit's file; otherwise grass lies beside the road, without kerbs.
    """
    length = np.hypot(np.diff(x, append=x[0]), np.diff(y, append=y[0])).sum()
    circuit = CircuitFile(
        name="test road",
        description="",
        centre_line="",
        runoff=facts.pop("runoff", "grass"),
        sectors_m=(length / 3, 2 * length / 3),
        grid=Grid(pole_m=0.0, spacing_m=9.0, lateral_m=2.0),
        **facts,
    )
    columns = (x, y, z, half_width, half_width, bank, wall, wall)
    return build_track(np.stack([np.broadcast_to(column, x.shape) for column in columns], axis=1), circuit)


@cache
def circle(radius: float, half_width: float = 6.0, wall: float = 15.0, bank: float = 0.0) -> Track:
    """A circle driven counter-clockwise from (radius, 0), banked by an angle, rad, + is outside down."""
    angle = np.linspace(0.0, 2 * np.pi, 360, endpoint=False)
    return road(radius * np.cos(angle), radius * np.sin(angle), half_width, wall, bank=bank)


STRAIGHT_M = 6000.0


@cache
def stadium(half_width: float = 20.0, wall: float = 40.0) -> Track:
    """Two straights, the first from (0, 0) to (STRAIGHT_M, 0), joined by half circles of 200 m radius."""
    along = np.arange(0.0, STRAIGHT_M, 10.0)
    angle = np.arange(0.0, np.pi, 10.0 / 200.0)
    x = [along, STRAIGHT_M + 200 * np.sin(angle), STRAIGHT_M - along, -200 * np.sin(angle)]
    y = [0 * along, 200 - 200 * np.cos(angle), 0 * along + 400, 200 + 200 * np.cos(angle)]
    return road(np.concatenate(x), np.concatenate(y), half_width, wall)


def world_with(
    track: Track,
    distance: list[float],
    lateral: list[float] | float = 0.0,
    speed: list[float] | float = 0.0,
    heading: list[float] | float = 0.0,
    finish: float = np.inf,
    car: Car = GT3,
    conditions: Conditions = Conditions(),  # it cannot change
) -> World:
    """A world of one race with cars at the given places, m, m/s, rad."""
    world = World(track, car, 1, len(distance), conditions)
    world.reset(0, start_at(distance, lateral, speed, heading, finish))
    return world


def start_at(
    distance: list[float],
    lateral: list[float] | float = 0.0,
    speed: list[float] | float = 0.0,
    heading: list[float] | float = 0.0,
    finish: float = np.inf,
) -> Start:
    """A start; numbers instead of lists hold for all cars."""

    def spread(value: list[float] | float) -> NDArray[np.float64]:
        return np.broadcast_to(np.array(value, np.float64), len(distance)).copy()

    return Start(spread(distance), spread(lateral), spread(heading), spread(speed), spread(finish))


def drive(world: World, throttle: float, steering: float = 0.0, seconds: float = 0.1) -> NDArray[np.void]:
    """Give all cars of all races the same action for some time; returns their state, a view."""
    actions = np.broadcast_to([throttle, steering], (*world.state.shape, 2))
    for _ in range(round(seconds * 10)):
        world.step(actions)
    return world.state
