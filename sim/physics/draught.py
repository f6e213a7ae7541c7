"""Slipstream: how deep a car sits in the wakes of the cars ahead."""

from __future__ import annotations

import math

from nathlon.sim.car import CarParameters
from nathlon.sim.car_models import parameters_of
from nathlon.sim.kernel import lean_inlined
from nathlon.sim.physics.course import CourseParameters, on_other_level
from nathlon.sim.physics.pit_lane import on_road
from nathlon.sim.state import CarRecord, Cars

LENGTH = 45.0  # m over which a wake fades by a factor e
WIDTH = 1.1  # m, half-width of the wake right behind the car
SPREAD = 0.04  # m of half-width gained per metre
REACH = 150.0  # m
EDGE = 4.0  # half-widths beside the wake where nothing of it is left: exp(-8) = 0.0003


@lean_inlined
def wake(behind: float, beside: float) -> float:
    """Strength of a wake in [0, 1] at a place `behind` (m, gap) and `beside` (m) its car."""
    if behind < 0.0 or behind > REACH:
        return 0.0
    spread = beside / (WIDTH + SPREAD * behind)
    if abs(spread) > EDGE:
        return 0.0
    return math.exp(-behind / LENGTH - 0.5 * spread * spread)


@lean_inlined
def half_length(car: CarRecord, models: CarParameters) -> float:
    """Half the length of a car, m."""
    return parameters_of(models, car.model).half_length


@lean_inlined
def set_draught(cars: Cars, models: CarParameters, course: CourseParameters) -> None:
    """Sum the wakes that each car of one race sits in, at most 1."""
    for i in range(len(cars)):
        follower = cars[i]
        if not on_road(follower):
            continue
        total = 0.0
        for j in range(len(cars)):
            leader = cars[j]
            if i == j or not on_road(leader) or leader.velocity_x < 10.0:
                continue
            car_length = half_length(follower, models) + half_length(leader, models)
            dx = leader.x - follower.x
            dy = leader.y - follower.y
            if dx * dx + dy * dy > (REACH + car_length) ** 2 or on_other_level(leader, follower, course):
                continue
            behind = dx * leader.cos_yaw + dy * leader.sin_yaw - car_length
            total += wake(behind, dy * leader.cos_yaw - dx * leader.sin_yaw)
        follower.draught = min(total, 1.0)
