"""Where a car is on the circuit, what its tyres stand on, and the walls."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sim.car import CarParameters
from sim.kernel import inlined
from sim.physics.contact import hit_wall
from sim.state import CarRecord
from sim.track import (
    CURVATURE,
    LEFT,
    RIGHT,
    TANGENT_X,
    TANGENT_Y,
    WALL_LEFT,
    WALL_RIGHT,
    Track,
    X,
    Y,
)


class CourseParameters(NamedTuple):
    """What the kernels read of a track."""

    table: NDArray[np.float64]
    spacing: float
    length: float
    kerb_width: float
    verge_grip: float
    verge_rolling_resistance: float


def course_parameters(track: Track) -> CourseParameters:
    """The kernels' view of a track."""
    return CourseParameters(
        track.table,
        track.spacing,
        track.length,
        track.kerb_width,
        track.verge_grip,
        track.verge_rolling_resistance,
    )


@inlined
def locate(car: CarRecord, course: CourseParameters) -> None:
    """Follow the car along the centre line from where it was last found.

    Between two rows the centre line is taken as a circular arc.
    """
    rows = len(course.table)
    for _ in range(rows):
        line = course.table[car.row]
        dx, dy = car.x - line[X], car.y - line[Y]
        ahead = dx * line[TANGENT_X] + dy * line[TANGENT_Y]
        aside = dy * line[TANGENT_X] - dx * line[TANGENT_Y]
        bend = max(1.0 - line[CURVATURE] * aside, 0.2)
        along = ahead / bend
        if along >= course.spacing:
            car.row += 1
            if car.row == rows:
                car.row = 0
                car.wraps += 1
        elif along < 0.0:
            if along > -1e-9:
                along = 0.0
                break
            car.row -= 1
            if car.row < 0:
                car.row = rows - 1
                car.wraps -= 1
            # Rounding must not send the search to and fro between two rows.
            line = course.table[car.row]
            dx, dy = car.x - line[X], car.y - line[Y]
            ahead = dx * line[TANGENT_X] + dy * line[TANGENT_Y]
            aside = dy * line[TANGENT_X] - dx * line[TANGENT_Y]
            bend = max(1.0 - line[CURVATURE] * aside, 0.2)
            along = ahead / bend
            if along >= course.spacing:
                along = course.spacing
                break
            if along >= 0.0:
                break
        else:
            break
    line = course.table[car.row]
    car.lateral = aside - 0.5 * line[CURVATURE] * ahead * ahead / bend
    car.progress = car.wraps * course.length + car.row * course.spacing + along


@inlined
def heading_error(car: CarRecord, course: CourseParameters) -> float:
    """Yaw of a located car minus the direction of the centre line beside it, rad in [-pi, pi]."""
    line = course.table[car.row]
    along = car.progress - car.wraps * course.length - car.row * course.spacing
    error = math.atan2(
        car.sin_yaw * line[TANGENT_X] - car.cos_yaw * line[TANGENT_Y],
        car.cos_yaw * line[TANGENT_X] + car.sin_yaw * line[TANGENT_Y],
    )
    return error - line[CURVATURE] * along


@inlined
def facing(car: CarRecord, course: CourseParameters) -> tuple[float, float]:
    """Sine and cosine of the heading error, without its trigonometry.

    The turn of the centre line between two rows, at most some 0.06 rad, is taken as a small angle.
    """
    line = course.table[car.row]
    turn = line[CURVATURE] * (car.progress - car.wraps * course.length - car.row * course.spacing)
    sine = car.sin_yaw * line[TANGENT_X] - car.cos_yaw * line[TANGENT_Y]
    cosine = car.cos_yaw * line[TANGENT_X] + car.sin_yaw * line[TANGENT_Y]
    return sine - cosine * turn, cosine + sine * turn


@inlined
def stand_on(
    car: CarRecord, grip: np.ndarray, drag: np.ndarray, p: CarParameters, course: CourseParameters
) -> int:
    """Set grip and rolling resistance under each tyre.

    Returns:
        the number of tyres out of bounds.
    """
    line = course.table[car.row]
    most = line[LEFT] + course.kerb_width
    least = -line[RIGHT] - course.kerb_width
    reach = p.a + p.half_front_track
    if car.lateral + reach < most and car.lateral - reach > least:
        for wheel in range(4):
            grip[wheel] = 1.0
            drag[wheel] = p.rolling_resistance
        return 0
    sin_error, cos_error = facing(car, course)
    out = 0
    for wheel in range(4):
        x = p.a if wheel < 2 else -p.b
        y = p.half_front_track if wheel < 2 else p.half_rear_track
        if wheel % 2 == 1:
            y = -y
        ahead = x * cos_error - y * sin_error
        bend = 0.5 * line[CURVATURE] * ahead * ahead
        lateral = car.lateral + x * sin_error + y * cos_error - bend
        if lateral > most or lateral < least:
            out += 1
            grip[wheel] = course.verge_grip
            drag[wheel] = course.verge_rolling_resistance
        else:
            grip[wheel] = 1.0
            drag[wheel] = p.rolling_resistance
    return out


@inlined
def meet_walls(car: CarRecord, p: CarParameters, course: CourseParameters) -> bool:
    """Resolve the contact of the car's deepest corner with a wall, if there is one."""
    line = course.table[car.row]
    reach = p.half_length + p.half_width
    if car.lateral + reach < line[WALL_LEFT] and car.lateral - reach > -line[WALL_RIGHT]:
        return False
    sin_error, cos_error = facing(car, course)
    depth = 0.0
    side = deepest_x = deepest_y = 0.0
    for corner in range(4):
        x = p.half_length if corner < 2 else -p.half_length
        y = p.half_width if corner % 2 == 0 else -p.half_width
        ahead = x * cos_error - y * sin_error
        lateral = car.lateral + x * sin_error + y * cos_error - 0.5 * line[CURVATURE] * ahead * ahead
        beyond_left = lateral - line[WALL_LEFT]
        beyond_right = -line[WALL_RIGHT] - lateral
        if beyond_left > depth:
            depth, side, deepest_x, deepest_y = beyond_left, -1.0, x, y
        if beyond_right > depth:
            depth, side, deepest_x, deepest_y = beyond_right, 1.0, x, y
    if side == 0.0:
        return False
    arm_x = deepest_x * car.cos_yaw - deepest_y * car.sin_yaw
    arm_y = deepest_x * car.sin_yaw + deepest_y * car.cos_yaw
    hit_wall(car, arm_x, arm_y, -side * line[TANGENT_Y], side * line[TANGENT_X], depth, p)
    return True


@inlined
def time_laps(car: CarRecord, before: float, time: float, dt: float, course: CourseParameters) -> None:
    """Time the crossing of the line and of the finish within the step that began at `time`.

    Args:
        before: progress at the beginning of the step, m.
        time: s since the start of the run.
    """
    gained = car.progress - before
    if gained <= 0.0:
        return
    next_line = (car.laps + 1) * course.length
    if car.line_s != car.line_s and car.start < 0.0:
        next_line = 0.0
    if before < next_line <= car.progress:
        crossed = time + dt * (next_line - before) / gained
        if car.line_s == car.line_s:
            car.last_lap_s = crossed - car.line_s
            if not car.best_lap_s <= car.last_lap_s:
                car.best_lap_s = car.last_lap_s
        if next_line > 0.0:
            car.laps += 1
        car.line_s = crossed
    if car.progress >= car.finish:
        car.finish_s = time + dt * (car.finish - before) / gained
        car.driving = False
