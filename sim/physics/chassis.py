"""One car over one dynamics step: a double-track model with four wheel spins, on a road in space.

Motion is that of the map, the horizontal projection. The road pushes back along its own normal, so
it neither gives nor takes energy: with gradient G and `heave` the acceleration with which the road
lifts a car that goes straight on, the reaction is (g + heave) / sqrt(1 + G^2) a unit of mass, and its
horizontal part -(g + heave) G / (1 + G^2). Tyre forces lie in the road's plane.

Loads follow the tyre forces quasi-statically through a first-order lag, split between the axles
by roll stiffness. Wheel spins are advanced by a linearly implicit step (`nathlon.sim.physics.wheels`),
position and velocity by a semi-implicit Euler step.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from nathlon.sim.car import CarParameters
from nathlon.sim.kernel import fused, lean_inlined
from nathlon.sim.physics.body import set_body_velocity, turn
from nathlon.sim.physics.powertrain import drive_torque, shift
from nathlon.sim.physics.tyre import Four, Ground
from nathlon.sim.physics.wheels import step_wheels
from nathlon.sim.simd import load, multiply, store
from nathlon.sim.state import CarRecord

GRAVITY = 9.81
AIR_DENSITY = 1.2


class Rates(NamedTuple):
    """How fast tyres wear and fuel burns, as multiples of the car's own figures; 0 is not at all.

    Attributes:
        wear, fuel: the multiples.
        weather: whether the road may get wet.
    """

    wear: float
    fuel: float
    weather: bool = False


@lean_inlined
def set_loads(car: CarRecord, steepness: float, shake: np.ndarray, p: CarParameters) -> Four:
    """Set the normal loads of the four tyres from weight, the road's shape, downforce and load transfer.

    Args:
        car: CAR_STATE record.
        steepness: sqrt(1 + G^2) of the road under the car.
        shake: (4,) what kerbs make of each load, 1 is nothing.
        p: the car's parameters.

    Returns:
        the loads, N.
    """
    wheelbase = p.a + p.b
    speed_squared = car.velocity_x * car.velocity_x + car.velocity_y * car.velocity_y
    downforce = 0.5 * AIR_DENSITY * p.downforce_area * speed_squared
    downforce *= 1.0 - p.draught_downforce * car.draught
    weight = car.mass * max(GRAVITY + car.heave, 0.0) / steepness
    pitch = car.mass * car.carried_x * p.height / wheelbase
    total = weight + downforce
    front = weight * p.b / wheelbase + downforce * p.downforce_front - pitch
    front = min(max(front, 0.0), total)
    rear = total - front
    roll = car.mass * car.carried_y * p.height
    roll_front = roll * p.roll_front / (2.0 * p.half_front_track)
    roll_rear = roll * (1.0 - p.roll_front) / (2.0 * p.half_rear_track)
    roll_front = min(max(roll_front, -0.5 * front), 0.5 * front)
    roll_rear = min(max(roll_rear, -0.5 * rear), 0.5 * rear)
    front, rear = 0.5 * front, 0.5 * rear
    steady = (front - roll_front, front + roll_front, rear - roll_rear, rear + roll_rear)
    loads = multiply(steady, load(shake, 0))
    store(car.load, 0, loads)
    return loads


@lean_inlined
def advance(
    car: CarRecord,
    steer: float,
    ground: Ground,
    dt: float,
    p: CarParameters,
    rates: Rates,
) -> None:
    """Advance one car by dt seconds on the road under it.

    Args:
        car: CAR_STATE record, changed in place.
        steer: wanted angle of the front wheels, rad.
        ground: under the tyres.
        dt: s.
        p: the car's parameters.
        rates: of wear and fuel.
    """
    most = p.steering_rate * dt
    car.steering += min(max(steer - car.steering, -most), most)
    steep_x, steep_y = 1.0 + car.slope_x * car.slope_x, 1.0 + car.slope_y * car.slope_y
    steep = steep_x + steep_y - 1.0
    loads = set_loads(car, math.sqrt(steep), ground.shake, p)

    if rates.fuel > 0.0 and car.fuel <= 0.0:
        car.throttle = 0.0
    driven_spin = (1.0 - p.drive_front) * 0.5 * (car.spin[2] + car.spin[3])
    driven_spin += p.drive_front * 0.5 * (car.spin[0] + car.spin[1])
    shift(car, driven_spin, dt, p)
    torque, engine_inertia = drive_torque(car, driven_spin, p)
    if rates.fuel > 0.0:
        burnt = rates.fuel * p.fuel_per_joule * max(torque * driven_spin, 0.0) / p.efficiency * dt
        car.fuel = max(car.fuel - burnt, 0.0)
        car.mass = p.dry_mass + car.fuel

    peak = car.wet_peak if rates.weather else 1.0
    tyres_x, tyres_y, moment = step_wheels(
        car, loads, torque, engine_inertia, ground, dt, p, rates.wear * car.tyre_wear, peak
    )
    follow = dt / (p.load_lag + dt)
    car.carried_x += (tyres_x / car.mass - car.carried_x) * follow
    car.carried_y += (tyres_y / car.mass - car.carried_y) * follow

    speed = math.sqrt(car.velocity_x * car.velocity_x + car.velocity_y * car.velocity_y)
    air = 0.5 * AIR_DENSITY * p.drag_area * (1.0 - p.draught_drag * car.draught) * speed
    tyres_x -= air * car.velocity_x
    tyres_y -= air * car.velocity_y
    reaction = max(GRAVITY + car.heave, 0.0) / steep
    car.acceleration_x = tyres_x / (car.mass * math.sqrt(steep_x)) - reaction * car.slope_x
    car.acceleration_y = tyres_y / (car.mass * math.sqrt(steep_y)) - reaction * car.slope_y
    car.yaw_rate += dt * moment / p.yaw_inertia
    move(car, dt)


@lean_inlined
def move(car: CarRecord, dt: float) -> None:
    """Advance velocity, direction and place by dt seconds of the present acceleration and yaw rate."""
    car.world_velocity_x += dt * (car.acceleration_x * car.cos_yaw - car.acceleration_y * car.sin_yaw)
    northward = fused(car.acceleration_y, car.cos_yaw, car.acceleration_x * car.sin_yaw)
    car.world_velocity_y += dt * northward
    turn(car, dt * car.yaw_rate)
    car.x += dt * car.world_velocity_x
    car.y += dt * car.world_velocity_y
    set_body_velocity(car)
