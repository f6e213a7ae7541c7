"""The car as a rigid body on the map: its direction, its velocity, and pushes that it takes."""

from __future__ import annotations

import math

from nathlon.sim.car import CarParameters
from nathlon.sim.kernel import lean_inlined
from nathlon.sim.state import CarRecord


@lean_inlined
def small_sin_cos(angle: float) -> tuple[float, float]:
    """Sine and cosine of an angle below 1.2 rad, by their series, to 1e-8."""
    s = angle * angle
    sine = angle * (
        1.0 - s / 6.0 * (1.0 - s / 20.0 * (1.0 - s / 42.0 * (1.0 - s / 72.0 * (1.0 - s / 110.0))))
    )
    cosine = 1.0 - s / 2.0 * (1.0 - s / 12.0 * (1.0 - s / 30.0 * (1.0 - s / 56.0 * (1.0 - s / 90.0))))
    return sine, cosine


@lean_inlined
def set_direction(car: CarRecord) -> None:
    """Cosine and sine of the yaw."""
    car.cos_yaw, car.sin_yaw = math.cos(car.yaw), math.sin(car.yaw)


@lean_inlined
def turn(car: CarRecord, angle: float) -> None:
    """Turn the car by a small angle, rad."""
    sine, cosine = small_sin_cos(angle)
    car.yaw += angle
    car.cos_yaw, car.sin_yaw = (
        car.cos_yaw * cosine - car.sin_yaw * sine,
        car.sin_yaw * cosine + car.cos_yaw * sine,
    )


@lean_inlined
def speed_squared(car: CarRecord) -> float:
    """Square of the car's speed, m^2/s^2."""
    return car.world_velocity_x * car.world_velocity_x + car.world_velocity_y * car.world_velocity_y


@lean_inlined
def set_body_velocity(car: CarRecord) -> None:
    """Velocity in the car's frame from velocity in the world's."""
    car.velocity_x = car.world_velocity_x * car.cos_yaw + car.world_velocity_y * car.sin_yaw
    car.velocity_y = car.world_velocity_y * car.cos_yaw - car.world_velocity_x * car.sin_yaw


@lean_inlined
def push(
    car: CarRecord,
    arm_x: float,
    arm_y: float,
    impulse_x: float,
    impulse_y: float,
    p: CarParameters,
) -> None:
    """Apply an impulse (N s, world frame) at an arm (m, world frame) from the centre of mass."""
    car.world_velocity_x += impulse_x / car.mass
    car.world_velocity_y += impulse_y / car.mass
    car.yaw_rate += (arm_x * impulse_y - arm_y * impulse_x) / p.yaw_inertia


@lean_inlined
def mobility(
    car: CarRecord,
    arm_x: float,
    arm_y: float,
    axis_x: float,
    axis_y: float,
    p: CarParameters,
) -> float:
    """Speed (m/s) along a unit axis that an impulse of 1 N s along it gives the point at an arm."""
    lever = arm_x * axis_y - arm_y * axis_x
    return 1.0 / car.mass + lever * lever / p.yaw_inertia


@lean_inlined
def point_velocity(car: CarRecord, arm_x: float, arm_y: float) -> tuple[float, float]:
    """World velocity (m/s) of the point at an arm (m, world frame) from the centre of mass."""
    return (
        car.world_velocity_x - car.yaw_rate * arm_y,
        car.world_velocity_y + car.yaw_rate * arm_x,
    )
