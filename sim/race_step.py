"""A step of races, compiled: what cars do by themselves, then what they do to each other."""

from __future__ import annotations

import numpy as np

from nathlon.sim.car_models import parameters_of
from nathlon.sim.clock import DYNAMICS_DT
from nathlon.sim.kernel import lean_inlined, lean_kernel
from nathlon.sim.parameters import WorldParameters
from nathlon.sim.physics.body import set_body_velocity, set_direction, speed_squared
from nathlon.sim.physics.chassis import advance
from nathlon.sim.physics.contact import collide
from nathlon.sim.physics.course import (
    CourseParameters,
    facing,
    feel_road,
    locate,
    meet_walls,
    on_other_level,
    set_heading_error,
    stand_on,
)
from nathlon.sim.physics.draught import set_draught
from nathlon.sim.physics.pit_lane import approach, clear_road, drive_lane, enter, in_lane, on_road
from nathlon.sim.physics.powertrain import REVERSE, choose_direction
from nathlon.sim.physics.tyre import Ground
from nathlon.sim.state import CarRecord, Cars, RaceRows, Races
from nathlon.sim.steward import Approach, note_contact, serve_penalty, watch_limits
from nathlon.sim.timing import time_lines
from nathlon.sim.work_stealing import Tally, finish, take

RENEWAL_SUBSTEPS = 6
"""Slipstreams change slowly, and so do the rounding errors of directions: they are renewed so often."""
CONTACT_GAP_S = 1.0
"""Touches of the same two cars closer together than this are one contact."""
MOVING_M_S = 2.0


@lean_kernel
def step_races(
    races: Races,
    actions: np.ndarray,
    substeps: int,
    ground: Ground,
    p: WorldParameters,
    tally: Tally,
    thread: int,
) -> None:
    """Advance the races that a thread takes by some dynamics steps; see `step_race` and
    `nathlon.sim.work_stealing`.
    """
    while True:
        index = take(tally, thread, len(races.cars))
        if index < 0:
            return
        step_race(race_of(races, index), actions[index], substeps, ground, p)
        finish(tally, thread)


@lean_inlined
def race_of(races: Races, index: int) -> RaceRows:
    """One of the races, without copying."""
    return RaceRows(
        races.cars[index],
        races.ticks[index:],
        races.touched[index],
        races.contacts[index],
        races.contact_count[index:],
    )


@lean_inlined
def step_race(race: RaceRows, actions: np.ndarray, substeps: int, ground: Ground, p: WorldParameters) -> None:
    """Advance one race by some dynamics steps.

    Args:
        race: changed in place.
        actions: (cars, 2), see `World.step`.
        substeps: how many steps.
        ground: scratch.
        p: of the world.
    """
    cars, ticks, course = race.cars, race.ticks, p.course
    worn = p.rates.wear > 0.0 or p.rates.weather
    reach_squared = 0.0
    count = len(cars)
    for i in range(count):
        car = cars[i]
        model = parameters_of(p.car, car.model)
        diagonal = model.half_length * model.half_length + model.half_width * model.half_width
        reach_squared = max(reach_squared, 4.0 * diagonal)
        car.off_course = car.wall_contact = car.car_contact = False
    race.contact_count[0] = 0
    for _ in range(substeps):
        now = ticks[0] * DYNAMICS_DT
        if ticks[0] % RENEWAL_SUBSTEPS == 0:
            for i in range(count):
                set_direction(cars[i])
            set_draught(cars, p.car, course)
        for i in range(count):
            car = cars[i]
            if not car.driving:
                continue
            model = parameters_of(p.car, car.model)
            if in_lane(car):
                before = car.progress
                drive_lane(car, i, DYNAMICS_DT, model, p.lane, p.rules.pit, course)
                time_lines(car, before, now, DYNAMICS_DT, course)
                continue
            before = car.progress
            # Anew each step, since a penalty that is served overrides them.
            car.asked_pedal, car.asked_steering = actions[i, 0], actions[i, 1]
            car.throttle = max(actions[i, 0], 0.0)
            car.brake = max(-actions[i, 0], 0.0)
            sine, cosine = facing(car, course)
            off = stand_on(car, sine, cosine, worn, ground, model, course) >= 3
            if off:
                car.off_course = True
                car.off_course_s += DYNAMICS_DT
            watch_limits(car, off, now, DYNAMICS_DT, p.rules)
            serve_penalty(car, DYNAMICS_DT, course, p.rules)
            if car.has_reverse:
                choose_direction(car, DYNAMICS_DT)
            if car.asked:
                approach(car, p.lane, course.length)
            feel_road(car, sine, cosine, course)
            advance(car, actions[i, 1] * model.full_lock, ground, DYNAMICS_DT, model, p.rates)
            locate(car, course)
            sine, cosine = facing(car, course)
            if meet_walls(car, sine, cosine, model, course):
                car.wall_contact = True
                car.wall_s += DYNAMICS_DT
                locate(car, course)
            time_lines(car, before, now, DYNAMICS_DT, course)
            moving = car.velocity_x > MOVING_M_S or (car.gear == REVERSE and car.velocity_x < -MOVING_M_S)
            car.stationary_s = 0.0 if moving else car.stationary_s + DYNAMICS_DT
            if car.asked:
                enter(car, before, p.lane, course.length)
        for i in range(count):
            for j in range(i + 1, count):
                if near(cars[i], cars[j], reach_squared) and not on_other_level(cars[i], cars[j], course):
                    meet(race, i, j, now, p)
        clear_road(cars, DYNAMICS_DT)
        ticks[0] += 1
    for i in range(count):
        set_heading_error(cars[i], course)


@lean_inlined
def near(a: CarRecord, b: CarRecord, reach_squared: float) -> bool:
    """Whether two cars on the road are near enough to touch."""
    dx, dy = b.x - a.x, b.y - a.y
    return dx * dx + dy * dy < reach_squared and on_road(a) and on_road(b)


@lean_kernel
def meet(race: RaceRows, i: int, j: int, now: float, p: WorldParameters) -> None:
    """Resolve the contact of two cars of a race, if they touch, and note it if it is a new one."""
    a, b = race.cars[i], race.cars[j]
    relative_x = b.world_velocity_x - a.world_velocity_x
    relative_y = b.world_velocity_y - a.world_velocity_y
    faster = i if speed_squared(a) > speed_squared(b) else j
    of_a, of_b = parameters_of(p.car, a.model), parameters_of(p.car, b.model)
    touch = collide(a, b, DYNAMICS_DT, of_a, of_b)
    if touch.closing < 0.0:
        return
    a.car_contact = b.car_contact = True
    if now - race.touched[i, j] > CONTACT_GAP_S:
        note = race.contacts[race.contact_count[0]]
        approach = Approach(relative_x, relative_y, faster)
        note_contact(race.cars, i, j, touch, approach, now, note, p.course, p.rules)
        race.contact_count[0] += 1
    race.touched[i, j] = now
    a.contact_s = b.contact_s = now


@lean_kernel
def locate_all(cars: Cars, course: CourseParameters) -> None:
    """Locate every car of one race, their rows being near the truth."""
    for i in range(len(cars)):
        car = cars[i]
        set_direction(car)
        set_body_velocity(car)
        locate(car, course)
        set_heading_error(car, course)
        sine, cosine = facing(car, course)
        feel_road(car, sine, cosine, course)
