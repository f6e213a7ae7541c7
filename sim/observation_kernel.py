"""The kernel that fills in observations as `nathlon.sim.observation` describes them."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from nathlon.sim.kernel import lean_inlined, lean_kernel
from nathlon.sim.observation import (
    ACCELERATION_X,
    ACCELERATION_Y,
    AHEAD_M,
    BEHIND_M,
    ERRORS,
    LINES,
    OPPONENT_SIZE,
    POINT_SIZE,
    PRESENT,
    ROOM_M,
    STATION_SIZE,
    VELOCITY_X,
    VELOCITY_Y,
    ObservationSpec,
    X,
    Y,
)
from nathlon.sim.observation_parameters import LayoutParameters, ViewParameters
from nathlon.sim.physics.course import CourseParameters, on_other_level
from nathlon.sim.physics.pit_lane import in_lane
from nathlon.sim.plan import CURVATURE, DIRECTION, OFFSET, SIDESLIP, SPEED
from nathlon.sim.plan import STEERING as WHEELS
from nathlon.sim.plan import X as LINE_X
from nathlon.sim.plan import Y as LINE_Y
from nathlon.sim.simd import add, load, multiply, store, subtract
from nathlon.sim.state import CarRecord, Cars
from nathlon.sim.track import WALL_LEFT, WALL_RIGHT
from nathlon.sim.work_stealing import Tally, finish, take

BLOCK = 8
"""Rows that a thread takes at once: between two takes a core cannot work ahead."""
SLOWEST = 10.0  # m/s: course points span the horizon at no less than this speed
Numbers = tuple[np.floating, np.floating, np.floating, np.floating]
OWN = ObservationSpec(course_points=0, cars_ahead=0, cars_behind=0)
"""What the car sees of itself, with which every vector begins."""
OWN_SIZE = OWN.size

# Where the fields begin. The compiler takes them for numbers that it knows.
VELOCITY = OWN.start("velocity")
YAW_RATE = OWN.start("yaw_rate")
ACCELERATION = OWN.start("acceleration")
TYRE_LOAD = OWN.start("tyre_load")
SLIP_ANGLE = OWN.start("slip_angle")
PLACE = OWN.start("progress")
"""Of the progress, or of the slip of the axles."""
HEADING_ERROR = OWN.start("heading_error")
INCLINATION = OWN.start("inclination")
WALL_CONTACT = OWN.start("wall_contact")
OFF_COURSE = OWN.start("off_course")
STEERING = OWN.start("steering")
THROTTLE = OWN.start("throttle")
BRAKE = OWN.start("brake")
CAR_CONTACT = OWN.start("car_contact")
SLIPSTREAM = OWN.start("slipstream")
PENALTY = OWN.start("penalty")
TYRE_WEAR = OWN.start("tyre_wear")
FUEL = OWN.start("fuel")


class Nearby(NamedTuple):
    """The cars in sight, first those of the list ahead, then those of the list behind.

    Attributes:
        nearest: (ahead + behind,) int64, indices, -1 for none.
        distance: (ahead + behind,) float64, squared, m^2.
    """

    nearest: NDArray[np.int64]
    distance: NDArray[np.float64]


@lean_inlined
def blocks(rows: int) -> int:
    """How many blocks of rows there are for threads to take."""
    return (rows + BLOCK - 1) // BLOCK


@lean_kernel
def observe_cars(
    state: np.ndarray,
    races: np.ndarray,
    cars: np.ndarray,
    out: np.ndarray,
    layout: LayoutParameters,
    nearby: Nearby,
    p: ViewParameters,
    tally: Tally,
    thread: int,
) -> None:
    """Fill in standardised observations, those that a thread takes.

    Args:
        state: (races, cars) CAR_STATE.
        races, cars: (n,) indices of the cars that look.
        out: (n, size) float32, set.
        layout: of the spec.
        nearby: scratch.
        p: of the world.
        tally, thread: see `nathlon.sim.work_stealing`.
    """
    rows = len(races)
    while True:
        block = take(tally, thread, blocks(rows))
        if block < 0:
            return
        for row in range(BLOCK * block, min(BLOCK * (block + 1), rows)):
            observe_car(state[races[row]], cars[row], out[row], layout, nearby, p)
        finish(tally, thread)


@lean_inlined
def observe_car(
    field: Cars,
    index: int,
    values: np.ndarray,
    layout: LayoutParameters,
    nearby: Nearby,
    p: ViewParameters,
) -> None:
    """Fill in what one car of a race sees.

    Args:
        field: the cars of the race.
        index: of the car that looks.
        values: (size,) float32, set.
        layout, nearby, p: as in `observe_cars`.
    """
    mean, scale = layout.mean, layout.scale
    lists = OWN_SIZE + POINT_SIZE * layout.points
    facts = len(values) - layout.facts
    walls = facts - layout.walls
    plan = walls
    if len(layout.stations) > 0:
        plan -= STATION_SIZE * len(layout.stations) + ERRORS
    observe_self(field[index], values, p)
    find_opponents(field, index, layout.ahead, nearby, p.course)
    observe_opponents(field, index, nearby.nearest, values[lists:plan])
    if len(layout.stations) > 0:
        observe_plan(field[index], values[plan:walls], layout, p)
    if layout.walls > 0:
        observe_walls(field[index], values[walls:facts], p.course)
    if layout.facts > 0:
        observe_slip(field[index], values)
        for k in range(layout.facts):
            values[facts + k] = p.facts[k]
        for k in range(len(p.grips)):
            car = field[index]
            values[facts + k] += p.grips[k] * (car.tyre_grip * car.wet_grip - 1.0)
            values[facts + k] += p.peaks[k] * (car.wet_peak - 1.0)
    for k in range(OWN_SIZE):
        values[k] = (values[k] - mean[k]) * scale[k]
    for k in range(lists, facts):
        values[k] = (values[k] - mean[k]) * scale[k]
    observe_course(field[index], values[OWN_SIZE:lists], layout, p.course)


@lean_inlined
def observe_self(car: CarRecord, values: np.ndarray, p: ViewParameters) -> None:
    """The car's own motion, tyres, place and controls, before standardisation."""
    values[VELOCITY], values[VELOCITY + 1] = car.velocity_x, car.velocity_y
    values[YAW_RATE] = car.yaw_rate
    values[ACCELERATION], values[ACCELERATION + 1] = car.acceleration_x, car.acceleration_y
    for wheel in range(4):
        values[TYRE_LOAD + wheel] = car.load[wheel]
        values[SLIP_ANGLE + wheel] = car.slip_angle[wheel]
    angle = 2.0 * math.pi * car.progress / p.course.length
    values[PLACE], values[PLACE + 1] = math.sin(angle), math.cos(angle)
    values[HEADING_ERROR] = car.heading_error
    values[INCLINATION], values[INCLINATION + 1] = car.slope_x, car.slope_y
    values[WALL_CONTACT] = 1.0 if car.wall_contact else 0.0
    values[OFF_COURSE] = 1.0 if car.off_course else 0.0
    values[STEERING] = car.steering / p.full_lock
    values[THROTTLE] = car.throttle
    values[BRAKE] = car.brake
    values[CAR_CONTACT] = 1.0 if car.car_contact else 0.0
    values[SLIPSTREAM] = car.draught
    values[PENALTY] = car.penalty_s
    for wheel in range(4):
        values[TYRE_WEAR + wheel] = car.wear[wheel]
    values[FUEL] = car.fuel / p.fuel_capacity


@lean_inlined
def observe_slip(car: CarRecord, values: np.ndarray) -> None:
    """The mean slip ratio of front and of rear wheels, before standardisation."""
    slip = car.slip_ratio
    values[PLACE], values[PLACE + 1] = 0.5 * (slip[0] + slip[1]), 0.5 * (slip[2] + slip[3])


@lean_inlined
def observe_course(
    car: CarRecord, values: np.ndarray, layout: LayoutParameters, course: CourseParameters
) -> None:
    """Standardised points of left edge, centre line and right edge over the next seconds."""
    points, scale = layout.points, layout.scale[OWN_SIZE:]
    x, y, z = alike(car.x), alike(car.y), alike(car.z)
    cos_yaw, sin_yaw = alike(car.cos_yaw), alike(car.sin_yaw)
    slope_x, slope_y = alike(car.slope_x), alike(car.slope_y)
    gap = max(car.velocity_x, SLOWEST) * layout.horizon / points / course.spacing
    rows = len(course.edges)
    at = car.row + car.along / course.spacing
    for point in range(points):
        if at >= rows:
            at -= rows * math.floor(at / rows)
        # A car flung off at any speed, or at none that is a number, must see a row that there is.
        low = min(max(int(at), 0), rows - 1)
        share = alike(at - low)
        high = low + 1
        if high == rows:
            high = 0
        here, there = course.edges[low], course.edges[high]
        dx = subtract(between(here, there, 0, share), x)
        dy = subtract(between(here, there, 4, share), y)
        dz = subtract(between(here, there, 8, share), z)
        ahead = add(multiply(dx, cos_yaw), multiply(dy, sin_yaw))
        aside = subtract(multiply(dy, cos_yaw), multiply(dx, sin_yaw))
        above = subtract(subtract(dz, multiply(slope_x, ahead)), multiply(slope_y, aside))
        # The fourth number of a vector is no line's, and gives way to the next vector's first.
        k = POINT_SIZE * point
        store(values, k, multiply(ahead, load(scale, k)))
        store(values, k + LINES, multiply(aside, load(scale, k + LINES)))
        for line in range(LINES):
            values[k + 2 * LINES + line] = above[line] * scale[k + 2 * LINES + line]
        at += gap


@lean_inlined
def observe_plan(car: CarRecord, values: np.ndarray, layout: LayoutParameters, p: ViewParameters) -> None:
    """The plan over the next seconds, and how far the car is off it, before standardisation."""
    plan, velocity, rows = p.plan, car.velocity_x, len(p.plan) - 1
    gap = max(velocity, SLOWEST) / p.course.spacing
    here = car.row + car.along / p.course.spacing
    sideslip = math.atan2(car.velocity_y, max(velocity, 1.0))
    wear = max(max(car.wear[0], car.wear[1]), max(car.wear[2], car.wear[3]))
    pace = layout.plan_pace * car.pace * (1.0 - layout.worn * wear)
    for station in range(len(layout.stations)):
        at = here + layout.stations[station] * gap
        at -= rows * math.floor(at / rows)
        # As for the course: a car flung off must see a row that there is.
        low = min(max(int(at), 0), rows - 1)
        share = at - low
        aside = on_plan(plan, low, share, LINE_Y) - car.y
        ahead = on_plan(plan, low, share, LINE_X) - car.x
        offset = on_plan(plan, low, share, OFFSET) - car.lateral
        heading = on_plan(plan, low, share, DIRECTION) - car.yaw
        heading -= 2.0 * math.pi * math.floor(heading / (2.0 * math.pi) + 0.5)
        target = pace * on_plan(plan, low, share, SPEED)
        faster = (target - velocity) / max(target, velocity, SLOWEST)
        curvature = on_plan(plan, low, share, CURVATURE)
        k = STATION_SIZE * station
        values[k] = offset
        values[k + 1] = aside * car.cos_yaw - ahead * car.sin_yaw
        values[k + 2] = heading
        values[k + 3] = faster
        values[k + 4] = curvature
        values[k + 5] = on_plan(plan, low, share, WHEELS)
        if station == 0:
            k = STATION_SIZE * len(layout.stations)
            slip = sideslip - on_plan(plan, low, share, SIDESLIP)
            values[k] = saturated(offset, 0.5)
            values[k + 1] = saturated(heading - sideslip, 0.05)
            values[k + 2] = saturated(faster, 0.05)
            values[k + 3] = saturated(slip, 0.05)
            values[k + 4] = saturated(car.yaw_rate - curvature * velocity, 0.1)


@lean_inlined
def observe_walls(car: CarRecord, values: np.ndarray, course: CourseParameters) -> None:
    """The room from the car's centre to the walls, before standardisation."""
    line = course.table[car.row]
    left, right = line[WALL_LEFT] - car.lateral, line[WALL_RIGHT] + car.lateral
    values[0], values[1] = saturated(max(left, 0.0), ROOM_M), saturated(max(right, 0.0), ROOM_M)


@lean_inlined
def on_plan(plan: np.ndarray, low: int, share: float, column: int) -> float:
    """A number of the plan on a share of the way from one row to the next."""
    return plan[low, column] + share * (plan[low + 1, column] - plan[low, column])


@lean_inlined
def saturated(error: float, fine: float) -> float:
    """An error in -1..1: sharp up to what is fine, and bounded beyond."""
    return error / (fine + abs(error))


@lean_inlined
def alike(number: float) -> Numbers:
    """A vector of the same number."""
    one = np.float32(number)
    return one, one, one, one


@lean_inlined
def between(here: np.ndarray, there: np.ndarray, axis: int, share: Numbers) -> Numbers:
    """The three lines' coordinates on a share of the way from one row of edges to another.

    Args:
        here, there: rows of `Track.edges`.
        axis: where the coordinate begins in them.
        share: of the way, from 0 to 1.
    """
    first = load(here, axis)
    return add(first, multiply(share, subtract(load(there, axis), first)))


@lean_inlined
def find_opponents(
    field: Cars,
    index: int,
    ahead: int,
    nearby: Nearby,
    course: CourseParameters,
) -> None:
    """Sort the cars in sight into two lists, nearest first.

    Args:
        field: the cars of the race.
        index: of the car that looks.
        ahead: length of the list of cars ahead.
        nearby: set.
        course: where bridges hide cars from each other.
    """
    nearest, distance = nearby
    car = field[index]
    nearest[:] = -1
    distance[:] = np.inf
    for j in range(len(field)):
        if j == index or not field[j].driving or in_lane(field[j]):
            continue
        dx, dy = field[j].x - car.x, field[j].y - car.y
        forward = dx * car.cos_yaw + dy * car.sin_yaw >= 0.0
        limit = AHEAD_M if forward else BEHIND_M
        apart = dx * dx + dy * dy
        if apart >= limit * limit or on_other_level(car, field[j], course):
            continue
        first, end = (0, ahead) if forward else (ahead, len(nearest))
        place = end
        while place > first and apart < distance[place - 1]:
            place -= 1
            if place + 1 < end:
                distance[place + 1], nearest[place + 1] = distance[place], nearest[place]
        if place < end:
            distance[place], nearest[place] = apart, j


@lean_inlined
def observe_opponents(field: Cars, index: int, nearest: np.ndarray, values: np.ndarray) -> None:
    """What is seen of the listed cars, relative in the car's frame."""
    car = field[index]
    values[:] = 0.0
    for place in range(len(nearest)):
        if nearest[place] < 0:
            continue
        other = field[nearest[place]]
        dx, dy = other.x - car.x, other.y - car.y
        dvx = other.world_velocity_x - car.world_velocity_x
        dvy = other.world_velocity_y - car.world_velocity_y
        turn_cos = other.cos_yaw * car.cos_yaw + other.sin_yaw * car.sin_yaw
        turn_sin = other.sin_yaw * car.cos_yaw - other.cos_yaw * car.sin_yaw
        k = OPPONENT_SIZE * place
        values[k + PRESENT] = 1.0
        values[k + X] = dx * car.cos_yaw + dy * car.sin_yaw
        values[k + Y] = dy * car.cos_yaw - dx * car.sin_yaw
        values[k + VELOCITY_X] = dvx * car.cos_yaw + dvy * car.sin_yaw
        values[k + VELOCITY_Y] = dvy * car.cos_yaw - dvx * car.sin_yaw
        forward = other.acceleration_x * turn_cos - other.acceleration_y * turn_sin
        aside = other.acceleration_x * turn_sin + other.acceleration_y * turn_cos
        values[k + ACCELERATION_X] = forward - car.acceleration_x
        values[k + ACCELERATION_Y] = aside - car.acceleration_y
