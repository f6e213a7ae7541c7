"""The minimum-time lap: its equations against the simulator's, and laps whose answer is known."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import brentq

from nathlon.policies.driver.speed_profile import Path, Profile
from nathlon.policies.lap_limit.guess import follow
from nathlon.policies.lap_limit.model import CONTROLS, STATES, point_of_lap
from nathlon.policies.lap_limit.problem import FIRST_BARRIER, OptimalLap, solve
from nathlon.sim.car import Car, CarParameters, load_car, parameters
from nathlon.sim.kernel import kernel
from nathlon.sim.physics.chassis import AIR_DENSITY, GRAVITY, Rates, advance
from nathlon.sim.physics.powertrain import RPM, engine_torque
from nathlon.sim.physics.tyre import Ground
from nathlon.sim.state import CAR_STATE, Cars
from tests.support.driving import circle

WALL_M = 1.3  # from the centre line, where a car is 2 m wide and slides at an angle
TICK = 1e-7  # s: short enough to tell rates from


@kernel
def advance_one(cars: Cars, steer: float, ground: Ground, dt: float, p: CarParameters, rates: Rates) -> None:
    """One dynamics step of the simulator's for the only car of an array."""
    advance(cars[0], steer, ground, dt, p, rates)


def simulated(
    car: Car, states: NDArray[np.float64], controls: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Accelerations, balance and loads of a car on a level road, by the simulator; see `point_of_lap`."""
    p = parameters(car)
    x = dict(zip((*STATES, *CONTROLS), (*states, *controls), strict=True))
    cars = np.zeros(1, CAR_STATE)
    cars["cos_yaw"] = 1.0
    cars["velocity_x"], cars["velocity_y"] = x["speed"], x["sideways"]
    cars["world_velocity_x"], cars["world_velocity_y"] = x["speed"], x["sideways"]
    for name in ("yaw_rate", "steering", "carried_x", "carried_y"):
        cars[name] = x[name]
    cars["mass"] = car.body.mass_kg
    cars["throttle"], cars["brake"] = max(x["pedal"], 0.0), max(-x["pedal"], 0.0)
    for wheel, slip in enumerate(controls[-4:]):
        turn = x["steering"] if wheel < 2 else 0.0
        half_track = p.half_front_track if wheel < 2 else p.half_rear_track
        point_x = x["speed"] - x["yaw_rate"] * (half_track if wheel % 2 == 0 else -half_track)
        point_y = x["sideways"] + x["yaw_rate"] * (p.a if wheel < 2 else -p.b)
        along = point_x * np.cos(turn) + point_y * np.sin(turn)
        cars["spin"][0, wheel] = along * (1.0 + slip) / p.radius
    spin = cars["spin"][0].copy()
    driven = p.drive_front * spin[:2].mean() + (1.0 - p.drive_front) * spin[2:].mean()
    cars["gear"] = int(np.argmax(np.append(driven * p.ratios[:-1] * RPM < car.engine.shift_up_rpm, True)))
    before = cars.copy()
    road = Ground(np.ones(4), np.full(4, p.rolling_resistance), np.ones(4))
    advance_one(cars, x["steering"], road, TICK, p, Rates(0.0, 0.0))

    def rate(name: str) -> float:
        return float((cars[name][0] - before[name][0]) / TICK)

    gain = float(cars["acceleration_x"][0] + x["yaw_rate"] * x["sideways"])
    rates = [
        gain,
        float(cars["acceleration_y"][0] - x["yaw_rate"] * x["speed"]),
        rate("yaw_rate"),
    ]
    share = np.array([p.drive_front] * 2 + [1.0 - p.drive_front] * 2)
    inertia = p.wheel_inertia + 0.5 * share * p.engine_inertia * p.ratios[cars["gear"][0]] ** 2
    spinning = (cars["spin"][0] - spin) / TICK
    torques = inertia * (spinning - gain / p.radius)
    not_carried = [p.load_lag * rate("carried_x"), p.load_lag * rate("carried_y")]
    return np.array(rates), np.append(torques, not_carried), cars["load"][0].copy()


@pytest.mark.parametrize("name", ["gt3", "coupe", "prototype"])
def test_equations_are_the_simulators(name: str) -> None:
    car = load_car(name)
    model = point_of_lap(car)
    road = np.array([0.0, 0.0, 0.0, 0.0, 0.0, *[50.0, 0.0, 1.0, 0.0, 60.0] * 2])
    rng = np.random.default_rng(3)
    p = parameters(car)
    upshifts = p.radius * car.engine.shift_up_rpm / (p.ratios[:-1] * RPM)
    for _ in range(60):
        speed, turning = rng.uniform(25.0, 65.0), rng.uniform(-12.0, 12.0)
        sideways, steering = rng.normal(0.0, 0.03, 2)
        states = np.array([speed, sideways * speed, turning / speed, 0.0, 0.0, steering])
        if np.abs(speed / upshifts - 1.0).min() < 0.1:
            continue
        # Away from where the model rounds off corners of the simulator's.
        pedal = rng.choice([-1.0, 1.0]) * rng.uniform(0.3, 1.0)
        slips = np.sign(pedal) * rng.uniform(0.005, 0.04, 4)
        controls = np.array([0.0, pedal, rng.uniform(-8.0, 4.0), turning, *slips])
        ours, _, balance, _, loads = (np.array(part).ravel() for part in model(states, controls, road))
        rates, their_balance, their_loads = simulated(car, states, controls)
        np.testing.assert_allclose(loads, their_loads, rtol=0.01, atol=15.0)
        np.testing.assert_allclose(ours[:3], rates, rtol=0.02, atol=0.25)
        np.testing.assert_allclose(balance[:4], their_balance[:4], rtol=0.03, atol=25.0)
        np.testing.assert_allclose(balance[4:], their_balance[4:], rtol=0.02, atol=0.25)


def lap_of_narrow_circle(car: Car, radius: float, speed: float, points: int) -> OptimalLap:
    """The fastest lap of a circle with walls so close that the car has no choice of line."""
    track = circle(radius, WALL_M, WALL_M)
    still = np.zeros(len(track.table))
    path = Path(still + 1.0 / radius, still + track.spacing, still, still, still)
    guess = follow(Profile(still, still, path, still + 1.0, still + speed, 0.0), car)[:, :points]
    return solve(track, car, np.arange(points) * track.length / points, guess, FIRST_BARRIER)


def test_narrow_circle_is_driven_at_the_limit_of_grip() -> None:
    car = load_car("gt3")
    p, mass, radius = parameters(car), car.body.mass_kg, 60.0
    lap = lap_of_narrow_circle(car, radius, 25.0, 40)
    inside = radius - WALL_M + p.half_width

    def spare(speed: float) -> float:
        """Grip of the axle that gives way first, beyond what the circle asks for, N."""
        push = speed**2 / inside
        downforce = 0.5 * AIR_DENSITY * p.downforce_area * speed**2
        left = np.inf
        for axle, roll, half_track, lift in (
            (p.b, p.roll_front, p.half_front_track, p.downforce_front),
            (p.a, 1.0 - p.roll_front, p.half_rear_track, 1.0 - p.downforce_front),
        ):
            load = mass * GRAVITY * axle / (p.a + p.b) + downforce * lift
            moved = mass * push * p.height * roll / (2.0 * half_track)
            tyres = np.array([0.5 * load - moved, 0.5 * load + moved])
            most = tyres * (p.friction_y + p.friction_y_slope * (tyres - p.load_low))
            left = min(left, most.sum() - mass * push * axle / (p.a + p.b))
        return float(left)

    # Some grip pulls the car on, and the two tyres of an axle do not peak together.
    bound = 2.0 * np.pi * inside / brentq(spare, 10.0, 60.0)
    assert lap.solved
    assert bound < lap.lap_s < 1.05 * bound


def test_wide_circle_is_driven_at_top_speed() -> None:
    car = load_car("gt3")
    p, radius = parameters(car), 1500.0
    lap = lap_of_narrow_circle(car, radius, 70.0, 150)

    def spare(speed: float) -> float:
        """Thrust in top gear beyond the resistance of air and rolling, N."""
        spin, ratio = speed / p.radius, p.ratios[-1]
        thrust = engine_torque(1.0, spin * ratio * RPM, p) * ratio * p.efficiency / p.radius
        downforce = 0.5 * AIR_DENSITY * p.downforce_area * speed**2
        rolling = p.rolling_resistance * (car.body.mass_kg * GRAVITY + downforce)
        return float(thrust - 0.5 * AIR_DENSITY * p.drag_area * speed**2 - rolling)

    # The tyres' slip in the bend costs a little beyond that.
    assert lap.solved
    assert 0.98 < lap.states[0].mean() / brentq(spare, 50.0, 81.0) < 1.0
