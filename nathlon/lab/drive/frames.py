"""Binary frames that tell the page how a race stands."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from nathlon.sim.timing import gaps
from nathlon.sim.world import World

COUNTDOWN, RACING, PAUSED, OVER = range(4)
"""Phases of a race."""
OUT, DRIVING, FINISHED = range(3)
"""What a car is doing."""

HEAD = np.dtype(
    [
        ("tick", "<u4"),
        ("number", "<u4"),  # of the inputs that worked in the last step
        ("time_s", "<f4"),
        ("phase", "u1"),
        ("cars", "u1"),
        ("off_course", "u1"),
        ("warnings", "u1"),
        ("steering", "<f4"),  # share of full lock
        ("rpm", "<f4"),
        ("gear", "<u4"),  # from 1, 0 is reverse
        ("laps", "<u4"),
        ("lap_s", "<f4"),  # since the line; nan before the first lap
        ("last_lap_s", "<f4"),
        ("best_lap_s", "<f4"),
        ("penalty_s", "<f4"),
        ("sliding", "<f4"),  # greatest slip angle of the tyres, rad
    ]
)
"""What stands first; the second half is of the person's car."""
CAR = np.dtype(
    [
        ("x", "<f4"),
        ("y", "<f4"),
        ("z", "<f4"),
        ("yaw", "<f4"),
        ("pitch", "<f4"),
        ("roll", "<f4"),
        ("speed", "<f4"),
        ("progress", "<f4"),
        ("gap_s", "<f4"),  # to the leader, at the last timing line; nan where there is none
        ("throttle", "u1"),  # of 255
        ("brake", "u1"),
        ("place", "u1"),
        ("doing", "u1"),  # OUT, DRIVING or FINISHED
    ]
)
"""What follows for every car."""
SAME = ("x", "y", "z", "yaw", "progress")
"""Fields of CAR and of CAR_STATE."""


def frame(world: World, car: int, number: int, phase: int) -> bytes:
    """How the first race of a world stands.

    Args:
        world: the world.
        car: the person's.
        number: of the inputs that worked in the last step.
        phase: COUNTDOWN, RACING, PAUSED or OVER.
    """
    cars, now_s = world.state[0], float(world.time[0])
    own = cars[car]
    head = np.zeros((), HEAD)
    head["tick"], head["number"], head["time_s"] = world.ticks[0], number, now_s
    head["phase"], head["cars"] = phase, len(cars)
    head["off_course"], head["warnings"] = own["off_course"], min(int(own["warnings"]), 255)
    head["steering"] = own["steering"] / world.parameters.car.full_lock
    head["gear"], head["laps"] = own["gear"] + 1, own["laps"]
    driven = np.max(own["spin"][2:]) * world.parameters.car.ratios[max(own["gear"], 0)]
    head["rpm"] = driven * 30.0 / np.pi
    head["lap_s"] = now_s - own["line_s"][0]
    for name in ("last_lap_s", "best_lap_s", "penalty_s"):
        head[name] = own[name]
    head["sliding"] = np.abs(own["slip_angle"]).max()
    return head.tobytes() + car_rows(cars).tobytes()


def car_rows(cars: NDArray[np.void]) -> NDArray[np.void]:
    """The rows of CAR for the cars of a race (schema CAR_STATE)."""
    rows = np.zeros(len(cars), CAR)
    for name in SAME:
        rows[name] = cars[name]
    rows["pitch"] = -np.arctan(cars["slope_x"])
    rows["roll"] = np.arctan(cars["slope_y"])
    rows["speed"] = np.hypot(cars["velocity_x"], cars["velocity_y"])
    rows["gap_s"] = gaps(cars)
    rows["throttle"], rows["brake"] = cars["throttle"] * 255.0, cars["brake"] * 255.0
    rows["place"] = places(cars)
    rows["doing"] = np.where(np.isfinite(cars["finish_s"]), FINISHED, np.where(cars["driving"], DRIVING, OUT))
    return rows


def places(cars: NDArray[np.void]) -> NDArray[np.int64]:
    """Places on the road of the cars of a race, from 1: finishers by their time, then by progress."""
    finish_s = np.where(np.isnan(cars["finish_s"]), np.inf, cars["finish_s"])
    places = np.empty(len(cars), np.int64)
    places[np.lexsort((-cars["progress"], finish_s))] = np.arange(1, len(cars) + 1)
    return places
