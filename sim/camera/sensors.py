"""What a car with a camera feels: an inertial unit, the wheel, the pedals, the dashboard."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from nathlon.sim.camera_spec import CameraSpec
from nathlon.sim.car import Car
from nathlon.sim.kernel import lean_inlined
from nathlon.sim.observation import ObservationSpec
from nathlon.sim.state import CarRecord

SEEING = ObservationSpec(camera=CameraSpec())

# Where the fields begin. The compiler takes them for numbers that it knows.
VELOCITY = SEEING.start("velocity")
YAW_RATE = SEEING.start("yaw_rate")
ACCELERATION = SEEING.start("acceleration")
STEERING = SEEING.start("steering")
THROTTLE = SEEING.start("throttle")
BRAKE = SEEING.start("brake")
LAST_ACTION = SEEING.start("last_action")
CONTACT = SEEING.start("contact")
TYRE_WEAR = SEEING.start("tyre_wear")
FUEL = SEEING.start("fuel")


class FeelingParameters(NamedTuple):
    """What the kernel reads of a spec and of a car.

    Attributes:
        mean, scale: (size,) float32, of the spec's scaling; the scale is one over the deviation.
        full_lock: of the car's steering, rad.
        fuel_capacity: of the car, kg.
    """

    mean: NDArray[np.float32]
    scale: NDArray[np.float32]
    full_lock: float
    fuel_capacity: float


def feeling_parameters(spec: ObservationSpec, car: Car) -> FeelingParameters:
    """The kernel's view of a spec and a car."""
    mean, deviation = spec.scaling
    return FeelingParameters(
        mean, np.float32(1.0) / deviation, car.steering.full_lock_rad, car.fuel.capacity_kg
    )


@lean_inlined
def feel(car: CarRecord, values: np.ndarray, p: FeelingParameters) -> None:
    """Fill in what one car feels, (size,) float32, standardised."""
    values[VELOCITY], values[VELOCITY + 1] = car.velocity_x, car.velocity_y
    values[YAW_RATE] = car.yaw_rate
    values[ACCELERATION], values[ACCELERATION + 1] = car.acceleration_x, car.acceleration_y
    values[STEERING] = car.steering / p.full_lock
    values[THROTTLE] = car.throttle
    values[BRAKE] = car.brake
    values[LAST_ACTION], values[LAST_ACTION + 1] = car.asked_pedal, car.asked_steering
    values[CONTACT] = 1.0 if car.wall_contact or car.car_contact else 0.0
    for wheel in range(4):
        values[TYRE_WEAR + wheel] = car.wear[wheel]
    values[FUEL] = car.fuel / p.fuel_capacity
    for k in range(len(p.mean)):
        values[k] = (values[k] - p.mean[k]) * p.scale[k]
