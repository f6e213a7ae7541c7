"""Closed forms of one car's physics, written out anew from the figures of its file."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import pytest
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.optimize import brentq

from nathlon.sim.car import Car, load_car, parameters
from nathlon.sim.clock import DYNAMICS_DT
from nathlon.sim.race_step import locate_all
from nathlon.sim.track import Track
from nathlon.sim.world import World
from tests.support.driving import GT3, circle, road, stadium

G = 9.81
P = parameters(GT3)
CARS = {name: load_car(name) for name in ("gt3", "coupe", "prototype")}
PLANE = circle(2000.0, half_width=1500.0, wall=1600.0)
"""So wide that a car may turn circles on it."""

loads = st.floats(200.0, 10_000.0)
slip_ratios = st.floats(-2.0, 2.0)
slip_angles = st.floats(-1.5, 1.5)
each_car = pytest.mark.parametrize("car", CARS.values(), ids=CARS)


def changed(car: Car, section: str, **values: object) -> Car:
    """A car with some figures of one section replaced."""
    return car.model_copy(update={section: getattr(car, section).model_copy(update=values)})


def without_losses(car: Car) -> Car:
    """A car that nothing holds back: no air, no rolling resistance, weightless wheels, no engine drag."""
    car = changed(car, "aero", drag_area_m2=0.0, downforce_area_m2=0.0)
    car = changed(car, "wheel", rolling_resistance=0.0, inertia_kg_m2=1e-3)
    return changed(car, "engine", braking_torque_n_m=0.0, inertia_kg_m2=0.0)


FREE = without_losses(GT3)
FRONT_DRIVEN = changed(CARS["coupe"], "gearbox", front_share=1.0)


def at_load(car: Car, values: tuple[float, float], load: float) -> float:
    """A tyre's property, linear in the load through the two points of its file."""
    low, high = car.tyre.load_n
    return values[0] + (values[1] - values[0]) * (load - low) / (high - low)


def magic(car: Car, slip: float) -> float:
    """Share of the peak force at a slip normalised by that of the peak."""
    return math.sin(car.tyre.shape * math.atan(math.tan(math.pi / 2 / car.tyre.shape) * slip))


def pull(car: Car, slip: float, load: float) -> float:
    """Longitudinal force of a tyre that runs straight, N."""
    share = magic(car, slip / at_load(car, car.tyre.peak_slip_ratio, load))
    return share * at_load(car, car.tyre.friction_longitudinal, load) * load


def hold(car: Car, slip: float, load: float) -> float:
    """Lateral force of a tyre that rolls freely, N."""
    share = magic(car, slip / at_load(car, car.tyre.peak_slip_angle_rad, load))
    return share * at_load(car, car.tyre.friction_lateral, load) * load


def wheelbase(car: Car) -> float:
    return car.body.front_axle_m + car.body.rear_axle_m


def downforce(car: Car, speed: float) -> float:
    return 0.5 * 1.2 * car.aero.downforce_area_m2 * speed**2


def air_drag(car: Car, speed: float) -> float:
    return 0.5 * 1.2 * car.aero.drag_area_m2 * speed**2


def axle_loads(car: Car, speed: float, forward: float = 0.0) -> tuple[float, float]:
    """Loads of the axles, N, on the level, where the tyres push the car with `forward` m/s^2."""
    down, share = downforce(car, speed), car.aero.downforce_front_share
    pitch = car.body.mass_kg * forward * car.body.centre_of_mass_height_m / wheelbase(car)
    weight = car.body.mass_kg * G
    front = weight * car.body.rear_axle_m / wheelbase(car) + down * share - pitch
    return front, weight + down - front


def rolling(car: Car, speed: float) -> float:
    """Rolling resistance, N, which builds up over half a metre per second."""
    load = car.body.mass_kg * G + downforce(car, speed)
    return car.wheel.rolling_resistance * load * speed / (speed + 0.5)


def deceleration(car: Car, speed: float, grip: float = 1.0, drag: float = 0.0) -> float:
    """Braking with all tyres at the slip that the control holds, or with the force of their brakes.

    Args:
        car: without losses in its engine.
        speed: m/s.
        grip: of surface and tyres.
        drag: rolling resistance of the surface beyond the tyres'.
    """
    air = air_drag(car, speed)
    shares = car.brakes.front_share, 1 - car.brakes.front_share

    def excess(backward: float) -> float:
        force = air + rolling(car, speed) + drag * (car.body.mass_kg * G + downforce(car, speed))
        loads = axle_loads(car, speed, air / car.body.mass_kg - backward)
        for load, share in zip(loads, shares, strict=True):
            turning = 2 * car.wheel.inertia_kg_m2 * backward / car.wheel.radius_m**2
            brakes = car.brakes.torque_n_m * share / car.wheel.radius_m - turning
            force += min(2 * grip * pull(car, car.brakes.abs_slip, load / 2), brakes)
        return force - car.body.mass_kg * backward

    return brentq(excess, 0.1, 80.0)


def follow(world: World, speed: float, seconds: float) -> NDArray[np.void]:
    """Steer the first car along the centre line at a speed, m/s; returns its state, a view."""
    car = world.state[0, 0]
    for _ in range(round(seconds / DYNAMICS_DT)):
        steer = -0.02 * car["lateral"] - 0.5 * car["heading_error"]
        steer += wheelbase(world.car) * world.track.table[car["row"], 4]
        throttle = float(np.clip(speed - car["velocity_x"], -1.0, 1.0))
        world.step(np.array([[[throttle, steer / world.car.steering.full_lock_rad]]]), 1)
    return car


@cache
def tilted(slope_x: float, slope_y: float) -> Track:
    """The stadium on a plane that rises so much per metre of map to the east and to the north."""
    table = stadium().table[::5]
    x, y, tangent_x, tangent_y = table[:, :4].T
    bank = np.arctan(slope_y * tangent_x - slope_x * tangent_y)
    return road(x, y, 20.0, 40.0, z=slope_x * x + slope_y * y, bank=bank)


@cache
def hills(height: float, count: int, radius: float = 600.0, bank: float = 0.0) -> Track:
    """A banked circle on which sine hills follow each other, `height` m above and below the plain."""
    angle = np.linspace(0.0, 2 * np.pi, 720, endpoint=False)
    x, y = radius * np.cos(angle), radius * np.sin(angle)
    return road(x, y, 40.0, 60.0, z=height * np.sin(count * angle), bank=bank)


def energy(world: World) -> float:
    """Kinetic and potential energy of the first car per kilogram, J/kg."""
    cars = world.state[0].copy()
    locate_all(cars, world.parameters.course)
    car, body, wheel = cars[0], world.car.body, world.car.wheel
    climb = car["slope_x"] * car["velocity_x"] + car["slope_y"] * car["velocity_y"]
    moving = car["velocity_x"] ** 2 + car["velocity_y"] ** 2 + climb**2
    turning = body.yaw_inertia_kg_m2 * car["yaw_rate"] ** 2
    spinning = wheel.inertia_kg_m2 * (car["spin"] ** 2).sum()
    return float(0.5 * (moving + (turning + spinning) / body.mass_kg) + G * car["z"])
