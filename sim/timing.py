"""Laps, sectors and gaps, timed at lines across the road."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from nathlon.sim.kernel import lean_inlined
from nathlon.sim.physics.course import CourseParameters
from nathlon.sim.state import CarRecord

SECTORS = 3


def first_line(start: NDArray[np.float64], sectors: tuple[float, ...], length: float) -> NDArray[np.int64]:
    """The next timing line of cars that start at `start` metres, counted from the line of lap 0."""
    laps = np.floor(start / length).astype(np.int64)
    passed = np.searchsorted(np.array(sectors), start - laps * length, side="right")
    return laps * SECTORS + passed


@lean_inlined
def time_lines(car: CarRecord, before: float, time: float, dt: float, course: CourseParameters) -> None:
    """Time the crossing of a timing line and of the finish within the step that began at `time`.

    Args:
        before: progress at the beginning of the step, m.
        time: s since the start of the run.
    """
    gained = car.progress - before
    if gained <= 0.0:
        return
    lap = car.line // SECTORS
    sector = car.line - lap * SECTORS
    place = lap * course.length + course.sectors[sector]
    if car.progress >= place:
        crossed = time + dt * (place - before) / gained
        last = sector - 1 if sector > 0 else SECTORS - 1
        car.sector_s[last] = crossed - car.line_s[last]
        if sector == 0:
            if car.line_s[0] == car.line_s[0]:
                car.last_lap_s = crossed - car.line_s[0]
                if not car.best_lap_s <= car.last_lap_s:
                    car.best_lap_s = car.last_lap_s
            car.laps = max(lap, car.laps)
        car.line_s[sector] = crossed
        car.line += 1
    if car.progress >= car.finish:
        car.finish_s = time + dt * (car.finish - before) / gained + car.penalty_s
        car.driving = False


def gaps(cars: NDArray[np.void]) -> NDArray[np.float64]:
    """How far each car is behind the leader of its race, s, at the last timing line that it crossed.

    The leader is the car that crossed the furthest line first.

    Args:
        cars: (..., cars) CAR_STATE.

    Returns:
        (..., cars) float64; nan for a car that has crossed no line or is a lap behind.
    """
    line = cars["line"] - 1
    sector = (line % SECTORS)[..., None]
    own = np.take_along_axis(cars["line_s"], sector, axis=-1)[..., 0]
    leader = np.lexsort((own, -line), axis=-1)[..., :1]
    of_leader = np.take_along_axis(cars["line_s"], leader[..., None], axis=-2)
    same_lap = np.take_along_axis(line, leader, axis=-1) - line < SECTORS
    return np.where(same_lap, own - np.take_along_axis(of_leader, sector, axis=-1)[..., 0], np.nan)
