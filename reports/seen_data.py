"""What a car's drivers saw, as the scripts of a page read it: whole numbers, packed."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from nathlon.arena.sight import Seen
from nathlon.reports.race_data import packed
from nathlon.sim.observation import (
    LINES,
    OPPONENT_SIZE,
    OWN,
    POINT_SIZE,
    PRESENT,
    VELOCITY_X,
    VELOCITY_Y,
    ObservationSpec,
    X,
    Y,
)

WHEELS = ("front left", "front right", "rear left", "rear right")
AXES = ("forward", "left")
PARTS = {
    "velocity": AXES,
    "acceleration": AXES,
    "tyre_load": WHEELS,
    "slip_angle": WHEELS,
    "tyre_wear": WHEELS,
    "progress": ("sine", "cosine"),
    "inclination": AXES,
}
"""What the numbers of a field are called, where it has several."""
NOTES = {
    "velocity": "forward and left",
    "acceleration": "forward and left",
    **dict.fromkeys(("tyre_load", "slip_angle", "tyre_wear"), "each wheel"),
}
"""What is said of these beside their unit."""
LEVELS = 2000
"""Steps of a number over its range."""
MOST_POINTS = 24
"""Course points that are kept, evenly spread: more cannot be told apart in a drawing."""
STEP_M = 0.1
"""Of course points and cars, m and m/s."""
OF_CARS = (PRESENT, X, Y, VELOCITY_X, VELOCITY_Y)


def seen_data(seen: Sequence[Seen]) -> dict[str, Any]:
    """What the drivers saw, as JSON values: the car itself, the course and the cars about it.

    `drivers` have each their moments: `own` has one row a number of `fields`; `course` one for x and one for
    y of the left edge and of the right at every point that is kept; `cars` those of OF_CARS for each opponent
    of the two lists, nearest first.
    """
    return {
        "fields": [
            {
                "name": field.name.replace("_", " "),
                "unit": ", ".join(filter(None, [field.unit.replace("^2", "²"), NOTES.get(field.name)])),
                "parts": PARTS.get(field.name, ("",)),
                "step": (field.high[0] - field.low[0]) / LEVELS,
                "range": field.high[0] - field.low[0],
            }
            for field in OWN
        ],
        "step": STEP_M,
        "drivers": [_driver(each) for each in seen],
    }


def own_numbers(seen: Seen) -> dict[str, NDArray[np.float32]]:
    """What a driver saw of its own car: by field, (n, numbers of the field)."""
    return {field.name: seen.numbers[:, seen.spec.slice(field.name)] for field in OWN}


def course_lines(seen: Seen) -> NDArray[np.float32]:
    """The course that a driver saw, (n, points, LINES, 3) in its frame, m: left edge, centre, right edge."""
    points, n = seen.spec.course_points, len(seen.time_s)
    if not points:
        return np.zeros((n, 0, LINES, 3), np.float32)
    numbers = seen.numbers[:, seen.spec.slice("course")]
    return numbers.reshape(n, points, POINT_SIZE // LINES, LINES).swapaxes(2, 3)


def opponents(seen: Seen, where: str) -> NDArray[np.float32]:
    """The cars that a driver saw `ahead` or `behind`, (n, cars, OPPONENT_SIZE), nearest first."""
    count = {"ahead": seen.spec.cars_ahead, "behind": seen.spec.cars_behind}[where]
    if not count:
        return np.zeros((len(seen.time_s), 0, OPPONENT_SIZE), np.float32)
    return seen.numbers[:, seen.spec.slice(f"cars_{where}")].reshape(-1, count, OPPONENT_SIZE)


def _driver(seen: Seen) -> dict[str, Any]:
    own = np.concatenate(list(own_numbers(seen).values()), axis=1)
    steps = np.concatenate([[(field.high[0] - field.low[0]) / LEVELS] * field.size for field in OWN])
    kept = _kept(seen.spec)
    edges = course_lines(seen)[:, kept][:, :, [0, LINES - 1], :2]
    n = len(seen.time_s)
    cars = {where: opponents(seen, where)[:, :, OF_CARS].reshape(n, -1) for where in ("ahead", "behind")}
    return {
        "ticks": n,
        "time": packed(np.rint(seen.time_s * 1000.0)[None]),
        "own": packed(np.rint(own / steps).T),
        "points": len(kept),
        "course": packed(np.rint(edges.reshape(n, -1) / STEP_M).T),
        **{where: seen_cars.shape[1] // len(OF_CARS) for where, seen_cars in cars.items()},
        "cars": packed(np.rint(np.concatenate(list(cars.values()), axis=1) / STEP_M).T),
    }


def _kept(spec: ObservationSpec) -> NDArray[np.int64]:
    count = min(spec.course_points, MOST_POINTS)
    return (
        np.unique(np.linspace(0, spec.course_points - 1, count).round().astype(np.int64))
        if count
        else np.zeros(0, np.int64)
    )
