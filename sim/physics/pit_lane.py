"""Stops: how a car drives itself through the pit lane, and what is done to it there.

Between the lane's entry and exit lines a car obeys no policy and meets nobody. It keeps to the limit, stands
in its box as long as the service takes, and comes back to the road at the limit. There it still meets nobody
for three seconds, and until the road around it is free.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from nathlon.sim.car import CarParameters
from nathlon.sim.kernel import fused, lean_inlined
from nathlon.sim.physics.body import set_body_velocity, set_direction
from nathlon.sim.physics.course import CourseParameters, feel_road
from nathlon.sim.physics.powertrain import RPM
from nathlon.sim.rules import PitParameters
from nathlon.sim.state import CarRecord, Cars
from nathlon.sim.track import LEFT, RIGHT, TANGENT_X, TANGENT_Y, Track, X, Y

ON_ROAD, ENTERING, IN_BOX, LEAVING, REJOINING = range(5)
"""Stages of a stop."""

BRAKING, PULLING = 8.0, 4.0
"""m/s^2 in the lane."""
APPROACH = 6.0
"""m/s^2 with which a car that wants to stop slows down before the entry line."""
SLOWING = 0.35
"""Share of the brakes for each m/s that it is too fast there."""
TOO_FAST = 4.0
"""m/s over the limit at the entry line with which it is missed."""
ASIDE_M, ASIDE_M_S = 6.0, 2.5
"""How far beside the road's edge the lane lies, and how fast a car moves there and back."""
INSIDE_M = 2.0
"""From the road's edge, where cars come back."""
REJOIN_S, CLEAR_M = 3.0, 12.0
"""For so long, and until so much room is round it, a car that came back meets nobody."""
FIRST_BOX, LAST_BOX = 0.4, 0.8
"""Shares of the lane between which the boxes lie."""
MOST_BOXES = 20


class LaneParameters(NamedTuple):
    """What the kernels read of a pit lane; m, m/s.

    Attributes:
        entry: along the lap.
        length: of the lane.
        speed: the limit.
        side: 1 where the lane is left of the road, else -1.
    """

    entry: float
    length: float
    speed: float
    side: float


def lane_parameters(track: Track) -> LaneParameters:
    """The kernels' view of a circuit's pit lane."""
    lane = track.pit_lane
    side = 1.0 if lane.side == "left" else -1.0
    return LaneParameters(lane.entry_m, lane.length(track.length), lane.speed_m_s, side)


@lean_inlined
def on_road(car: CarRecord) -> bool:
    """Whether others can meet a car: it drives, and is not in the pit lane or just back from there."""
    return car.driving and car.stage == ON_ROAD


@lean_inlined
def in_lane(car: CarRecord) -> bool:
    """Whether a car drives itself."""
    return car.stage != ON_ROAD and car.stage != REJOINING


@lean_inlined
def box_of(number: int, lane: LaneParameters) -> float:
    """Where a car stands, m from the entry line; the first car's box is the last."""
    share = LAST_BOX - (LAST_BOX - FIRST_BOX) * (number % MOST_BOXES) / MOST_BOXES
    return share * lane.length


@lean_inlined
def to_entry(progress: float, lane: LaneParameters, length: float) -> float:
    """m from a progress to the next entry line."""
    gap = lane.entry - progress
    return gap - math.floor(gap / length) * length


@lean_inlined
def approach(car: CarRecord, lane: LaneParameters, length: float) -> None:
    """Slow a car down that wants to stop, so that it has the limit's speed at the entry line."""
    gap = to_entry(car.progress, lane, length)
    above = car.velocity_x - math.sqrt(lane.speed * lane.speed + 2.0 * APPROACH * gap)
    if above > -1.0:
        car.throttle = 0.0
        car.brake = max(car.brake, min(SLOWING * above, 1.0))


@lean_inlined
def enter(car: CarRecord, before: float, lane: LaneParameters, length: float) -> None:
    """Have a car that wants to stop enter the lane, if it crossed the entry line in the last step.

    Args:
        before: progress before the step, m.
    """
    if math.floor((before - lane.entry) / length) >= math.floor((car.progress - lane.entry) / length):
        return
    if car.velocity_x > lane.speed + TOO_FAST:
        car.missed += 1
        return
    car.stage = ENTERING
    car.lane_m = length - to_entry(car.progress, lane, length)


@lean_inlined
def serve(car: CarRecord, p: CarParameters, pit: PitParameters) -> None:
    """Do what was asked for to a car in its box, and set how long it stands.

    Penalties that are not served yet are, first.
    """
    tyres = pit.tyres if car.asked_tyres else 0.0
    added = max(min(car.asked_fuel, p.fuel_capacity) - car.fuel, 0.0)
    fuel = added / pit.fuel_rate
    car.service_s = car.penalty_s + (max(tyres, fuel) if pit.together else tyres + fuel)
    car.penalty_s = 0.0
    car.fuel += added
    car.mass = p.dry_mass + car.fuel
    if car.asked_tyres:
        car.tyre_grip, car.tyre_wear = car.asked_grip, car.asked_wear
        car.tyre_film, car.tyre_peak = car.asked_film, car.asked_peak
        for wheel in range(4):
            car.wear[wheel] = 0.0
    car.asked = car.asked_tyres = False
    car.asked_fuel = 0.0
    car.stops += 1


@lean_inlined
def drive_lane(
    car: CarRecord,
    number: int,
    dt: float,
    p: CarParameters,
    lane: LaneParameters,
    pit: PitParameters,
    course: CourseParameters,
) -> None:
    """Advance a car in the lane by dt seconds.

    Args:
        number: of the car in its race, which says where its box is.
    """
    car.lane_s += dt
    car.stationary_s = 0.0
    speed = car.velocity_x
    if car.stage == IN_BOX:
        car.service_s -= dt
        car.stood_s += dt
        if car.service_s > 0.0:
            return
        car.stage = LEAVING
    most = lane.speed
    if car.stage == ENTERING:
        left = box_of(number, lane) - car.lane_m
        most = min(most, math.sqrt(2.0 * BRAKING * max(left, 0.0)))
        if left <= speed * dt:
            car.stage = IN_BOX
            serve(car, p, pit)
            most = 0.0
    if car.stage == IN_BOX:
        speed = 0.0
    else:
        speed += min(max(most - speed, -BRAKING * dt), PULLING * dt)
    move_along(car, speed, dt, lane, course)
    if car.stage == LEAVING and car.lane_m >= lane.length:
        car.stage = REJOINING
        car.clear_s = 0.0
        settle(car, speed, p)


@lean_inlined
def move_along(
    car: CarRecord, speed: float, dt: float, lane: LaneParameters, course: CourseParameters
) -> None:
    """Move a car along the lane, and towards it or back to the road."""
    rows = len(course.table)
    step = speed * dt
    car.lane_m += step
    car.along += step
    while car.along >= course.spacing:
        car.along -= course.spacing
        car.row += 1
        if car.row == rows:
            car.row = 0
            car.wraps += 1
    car.progress = fused(float(car.row), course.spacing, car.wraps * course.length) + car.along
    line = course.table[car.row]
    edge = line[LEFT] if lane.side > 0.0 else line[RIGHT]
    back = (lane.length - car.lane_m) * ASIDE_M_S / lane.speed
    aside = lane.side * min(edge + ASIDE_M, edge - INSIDE_M + back)
    most = ASIDE_M_S * dt * speed / lane.speed
    car.lateral += min(max(aside - car.lateral, -most), most)
    car.x = line[X] + line[TANGENT_X] * car.along - line[TANGENT_Y] * car.lateral
    car.y = line[Y] + line[TANGENT_Y] * car.along + line[TANGENT_X] * car.lateral
    heading = math.atan2(line[TANGENT_Y], line[TANGENT_X])
    car.yaw = heading + math.floor((car.yaw - heading) / (2.0 * math.pi) + 0.5) * 2.0 * math.pi
    set_direction(car)
    car.world_velocity_x, car.world_velocity_y = speed * car.cos_yaw, speed * car.sin_yaw
    set_body_velocity(car)
    car.yaw_rate = 0.0
    car.acceleration_x = car.acceleration_y = 0.0
    car.throttle = car.brake = car.steering = 0.0
    feel_road(car, 0.0, 1.0, course)


@lean_inlined
def settle(car: CarRecord, speed: float, p: CarParameters) -> None:
    """Set what a car at a steady speed has: wheels that roll, a gear that fits, no slip."""
    for wheel in range(4):
        car.spin[wheel] = speed / p.radius
        car.slip_ratio[wheel] = car.slip_angle[wheel] = 0.0
    car.carried_x = car.carried_y = 0.0
    car.shifting = 0.0
    car.gear = 0
    while car.gear < p.gears - 1 and speed / p.radius * p.ratios[car.gear] * RPM > p.shift_up_rpm:
        car.gear += 1


@lean_inlined
def clear_road(cars: Cars, dt: float) -> None:
    """Have cars that came back to the road meet others again, once there is room round them."""
    for i in range(len(cars)):
        car = cars[i]
        if car.stage != REJOINING:
            continue
        car.clear_s += dt
        room = car.clear_s >= REJOIN_S
        for j in range(len(cars)):
            other = cars[j]
            if j != i and other.driving and not in_lane(other):
                dx, dy = other.x - car.x, other.y - car.y
                room = room and dx * dx + dy * dy > CLEAR_M * CLEAR_M
        if room:
            car.stage = ON_ROAD
