"""The batched world: many races at once, advanced by one compiled kernel per agent step."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sim.car import Car, CarParameters, parameters
from sim.kernel import kernel
from sim.observation import ObservationSpec
from sim.observe import observe
from sim.physics.chassis import GRAVITY, advance, set_body_velocity, set_direction
from sim.physics.contact import collide
from sim.physics.course import (
    CourseParameters,
    course_parameters,
    heading_error,
    locate,
    meet_walls,
    stand_on,
    time_laps,
)
from sim.physics.draught import set_draught
from sim.state import CAR_STATE
from sim.track import Track

AGENT_HZ = 10
DYNAMICS_HZ = 60
SUBSTEPS = DYNAMICS_HZ // AGENT_HZ
AGENT_DT = 1.0 / AGENT_HZ
DYNAMICS_DT = 1.0 / DYNAMICS_HZ
CONTACT_GAP_S = 1.0
"""Touches of the same two cars closer together than this are one contact."""
MOVING_M_S = 2.0


@dataclass(frozen=True)
class Start:
    """Where the cars of one race begin; every array is (cars,) float64.

    Attributes:
        distance: along the centre line, m; negative is before the line.
        lateral: left of the centre line, m.
        heading: relative to the centre line, rad.
        speed: along the heading, m/s.
        finish: progress at which the run is over, m; inf for none.
    """

    distance: NDArray[np.float64]
    lateral: NDArray[np.float64]
    heading: NDArray[np.float64]
    speed: NDArray[np.float64]
    finish: NDArray[np.float64]


@kernel
def touch(cars: np.ndarray, i: int, j: int, faster: bool, blame: np.ndarray, length: float) -> None:
    """Count a new contact of cars i and j, of which i was the `faster`, and note who was behind."""
    a, b = cars[i], cars[j]
    gap = b.progress - a.progress
    gap -= np.round(gap / length) * length
    a.contacts += 1
    b.contacts += 1
    if gap > 0.0 and faster:
        blame[i, j] = True
        a.contacts_faster_behind += 1
    elif gap < 0.0 and not faster:
        blame[j, i] = True
        b.contacts_faster_behind += 1


@kernel
def step_races(
    state: np.ndarray,
    actions: np.ndarray,
    time: np.ndarray,
    touched: np.ndarray,
    impact: np.ndarray,
    blame: np.ndarray,
    p: CarParameters,
    course: CourseParameters,
) -> None:
    """Advance every race by one agent step; see `World.step`."""
    races, count = state.shape
    grip = np.empty(4)
    drag = np.empty(4)
    for race in range(races):
        cars = state[race]
        for i in range(count):
            car = cars[i]
            car.off_course = car.wall_contact = car.car_contact = False
            car.throttle = max(actions[race, i, 0], 0.0)
            car.brake = max(-actions[race, i, 0], 0.0)
        impact[race] = -1.0
        blame[race] = False
        set_draught(cars, 2.0 * p.half_length)
        for substep in range(SUBSTEPS):
            now = time[race] + substep * DYNAMICS_DT
            for i in range(count):
                car = cars[i]
                if not car.driving:
                    continue
                before = car.progress
                if stand_on(car, grip, drag, p, course) >= 3:
                    car.off_course = True
                    car.off_course_s += DYNAMICS_DT
                advance(car, actions[race, i, 1] * p.full_lock, grip, drag, DYNAMICS_DT, p)
                locate(car, course)
                if meet_walls(car, p, course):
                    car.wall_contact = True
                    car.wall_s += DYNAMICS_DT
                    locate(car, course)
                time_laps(car, before, now, DYNAMICS_DT, course)
            for i in range(count):
                for j in range(i + 1, count):
                    if not (cars[i].driving and cars[j].driving):
                        continue
                    faster = cars[i].velocity_x > cars[j].velocity_x
                    closing = collide(cars[i], cars[j], p)
                    if closing < 0.0:
                        continue
                    cars[i].car_contact = cars[j].car_contact = True
                    if now - touched[race, i, j] > CONTACT_GAP_S:
                        impact[race, i, j] = impact[race, j, i] = closing
                        touch(cars, i, j, faster, blame[race], course.length)
                    touched[race, i, j] = now
        time[race] += SUBSTEPS * DYNAMICS_DT
        for i in range(count):
            car = cars[i]
            car.heading_error = heading_error(car, course)
            if car.velocity_x > MOVING_M_S:
                car.stationary_s = 0.0
            else:
                car.stationary_s += SUBSTEPS * DYNAMICS_DT


@kernel
def locate_all(cars: np.ndarray, course: CourseParameters) -> None:
    """Locate every car of one race, their rows being near the truth."""
    for i in range(len(cars)):
        set_direction(cars[i])
        set_body_velocity(cars[i])
        locate(cars[i], course)
        cars[i].heading_error = heading_error(cars[i], course)


class World:
    """Races of the same circuit, car model and number of cars, advanced together.

    Attributes:
        state: (races, cars) CAR_STATE, the whole state; read it freely.
        time: (races,) float64, s since each race's start.
        impact: (races, cars, cars) float32, closing speed (m/s) of a contact that began in the
            last agent step, else -1; symmetric.
        blame: (races, cars, cars) bool, whether the first car was behind and faster in it.
    """

    def __init__(self, track: Track, car: Car, races: int, cars: int) -> None:
        self.track = track
        self.car = car
        self.parameters = parameters(car)
        self.course = course_parameters(track)
        self.state = np.zeros((races, cars), CAR_STATE)
        self.time = np.zeros(races)
        self.impact = np.full((races, cars, cars), -1.0, np.float32)
        self.blame = np.zeros((races, cars, cars), np.bool_)
        self._touched = np.full((races, cars, cars), -np.inf)

    def reset(self, race: int, start: Start) -> None:
        """Put the cars of one race at their start, wheels rolling at the speed of the road."""
        cars = self.state[race]
        cars[:] = np.zeros((), CAR_STATE)
        x, y, heading = self.track.pose(start.distance, start.lateral)
        cars["x"], cars["y"], cars["yaw"] = x, y, heading + start.heading
        cars["world_velocity_x"] = start.speed * np.cos(cars["yaw"])
        cars["world_velocity_y"] = start.speed * np.sin(cars["yaw"])
        cars["spin"] = (start.speed / self.car.wheel.radius_m)[:, None]
        shift_up = self.car.engine.shift_up_rpm / 60.0 * 2.0 * np.pi
        fastest = shift_up / self.parameters.ratios * self.car.wheel.radius_m
        cars["gear"] = np.minimum(np.searchsorted(fastest, start.speed), len(fastest) - 1)
        cars["wraps"] = np.floor(start.distance / self.track.length)
        along = start.distance - cars["wraps"] * self.track.length
        cars["row"] = np.minimum(along / self.track.spacing, len(self.track.table) - 1)
        cars["load"] = self.car.body.mass_kg * GRAVITY / 4.0
        for unset in ("line_s", "last_lap_s", "best_lap_s", "finish_s"):
            cars[unset] = np.nan
        cars["driving"] = True
        cars["finish"] = start.finish
        locate_all(cars, self.course)
        cars["start"] = cars["progress"]
        cars["laps"] = np.maximum(cars["wraps"], 0)
        self.time[race] = 0.0
        self._touched[race] = -np.inf

    def step(self, actions: NDArray[np.floating]) -> None:
        """Advance all races by one agent step, 0.1 s.

        Args:
            actions: (races, cars, 2) in [-1, 1]: throttle (+) or brake (-), steering (+ is left).
                Must be finite; values outside the range are clipped. Cars that no longer drive
                ignore theirs.
        """
        step_races(
            self.state,
            np.clip(actions, -1.0, 1.0, dtype=np.float64),
            self.time,
            self._touched,
            self.impact,
            self.blame,
            self.parameters,
            self.course,
        )

    def observe(
        self, spec: ObservationSpec, races: NDArray[np.int64], cars: NDArray[np.int64]
    ) -> NDArray[np.float32]:
        """Standardised observations of some cars.

        Args:
            spec: what to observe.
            races, cars: (n,) indices of the cars.

        Returns:
            (n, spec.size) float32.
        """
        return observe(self.state, spec, races, cars, self.parameters, self.course)
