"""What a car can hold in steady motion, from the same equations and parameters as the simulator's car."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from nathlon.sim.car import Car, CarParameters, parameters
from nathlon.sim.physics.chassis import AIR_DENSITY, GRAVITY
from nathlon.sim.physics.powertrain import RPM, engine_torque

SPEEDS = np.linspace(0.0, 110.0, 111)
WEIGHTS = np.linspace(0.0, 24.0, 13)
"""Force with which the road carries a unit of mass, downforce apart, m/s^2: more in dips, less on crests."""
USED = np.linspace(0.0, 1.0, 41)
"""Shares of the largest lateral acceleration."""
REAR_DRIVING = 0.85
REAR_BRAKING = 0.92
"""Shares of the rear axle's friction ellipse to use while it also drives or brakes.

Past the peak of its rear tyres the car spins."""
Table = NDArray[np.float64]


class Envelope(NamedTuple):
    """Accelerations that the car can hold in the plane of the road, m/s^2.

    The first is (SPEEDS, WEIGHTS), those up to `understeer` (SPEEDS, WEIGHTS, USED), then (SPEEDS,).
    """

    corner: Table  # lateral, by both axles
    brake: Table  # by grip
    traction: Table  # by the grip of the driven wheels
    scrub: Table  # drag of the tyres that push the car sideways
    understeer: Table  # front less rear slip angle, rad, in a left bend
    power: Table  # by the engine, less the tyres' rolling resistance
    coast: Table  # the same with a closed throttle, negative
    drag: Table  # of the air
    speed_step: float
    weight_step: float


class Axle(NamedTuple):
    """What tells the axles apart."""

    weight: float  # share of the car's
    downforce: float
    pitch: float  # sign of the load that comes with acceleration
    transfer: float  # N from tyre to tyre for each newton of lateral force on the car
    drive: float  # share of torque
    brake: float
    driving: float  # share of its friction ellipse to use, squared
    braking: float


def _axles(p: CarParameters) -> tuple[Axle, Axle]:
    wheelbase = p.a + p.b
    front_brake = p.brake_torque_front / (p.brake_torque_front + p.brake_torque_rear)
    front_transfer = p.height * p.roll_front / (2 * p.half_front_track)
    rear_transfer = p.height * (1 - p.roll_front) / (2 * p.half_rear_track)
    return (
        Axle(p.b / wheelbase, p.downforce_front, -1.0, front_transfer, p.drive_front, front_brake, 1.0, 1.0),
        Axle(
            p.a / wheelbase,
            1 - p.downforce_front,
            1.0,
            rear_transfer,
            1 - p.drive_front,
            1 - front_brake,
            REAR_DRIVING,
            REAR_BRAKING,
        ),
    )


class Limits:
    """Loads and grip of a car's axles at speeds (m/s) and weights (m/s^2), arrays of any one shape."""

    def __init__(self, car: Car, speed: Table, weight: Table) -> None:
        self.p = p = parameters(car)
        self.mass = p.dry_mass + p.fuel_capacity
        self.axles = _axles(p)
        self.speed = speed
        self.weight = weight

    def load(self, axle: Axle, acceleration_x: Table | float) -> Table:
        """Load of an axle, N, (SPEEDS, WEIGHTS, USED or 1)."""
        downforce = 0.5 * AIR_DENSITY * self.p.downforce_area * self.speed**2
        pitch = axle.pitch * self.mass * acceleration_x * self.p.height / (self.p.a + self.p.b)
        held: Table = self.mass * self.weight * axle.weight + downforce * axle.downforce + pitch
        return held

    def grip(self, axle: Axle, load: Table, lateral: Table) -> tuple[Table, Table]:
        """Largest longitudinal and lateral force of an axle's two tyres, N, at a lateral acceleration."""
        p = self.p
        most_x, most_y = np.zeros(np.broadcast(load, lateral).shape), np.zeros(())
        for side in (-1.0, 1.0):
            tyre = np.maximum(load / 2 + side * axle.transfer * self.mass * lateral, 0.0)
            above = np.minimum(tyre, 3.0 * p.load_low + 6000.0) - p.load_low
            most_x = most_x + tyre * (p.friction_x + p.friction_x_slope * above)
            most_y = most_y + tyre * (p.friction_y + p.friction_y_slope * above)
        return most_x, most_y

    def corner(self) -> tuple[Table, Table]:
        """Lateral acceleration that the grip of each axle holds, (SPEEDS, WEIGHTS, 1)."""
        front = rear = np.broadcast_to(self.weight, (len(SPEEDS), len(WEIGHTS), 1))
        for _ in range(30):
            lateral = np.minimum(front, rear)
            front, rear = (
                self.grip(axle, self.load(axle, 0.0), lateral)[1] / axle.weight / self.mass
                for axle in self.axles
            )
        return front, rear

    def longitudinal(self, sign: float, corner: Table) -> Table:
        """Largest acceleration (sign +1) or braking (-1) by the tyres while cornering.

        Bisects for the acceleration at which the first axle runs out of grip on its friction ellipse.
        """
        lateral = corner * USED
        low, high = np.zeros(lateral.shape), np.full(lateral.shape, 80.0)
        for _ in range(24):
            tried = (low + high) / 2
            holds = np.ones(lateral.shape, np.bool_)
            for axle in self.axles:
                share = axle.drive if sign > 0 else axle.brake
                most_x, most_y = self.grip(axle, self.load(axle, sign * tried), lateral)
                used_x = self.mass * tried * share / np.maximum(most_x, 1.0)
                used_y = self.mass * lateral * axle.weight / np.maximum(most_y, 1.0)
                holds &= used_x**2 + used_y**2 <= (axle.driving if sign > 0 else axle.braking)
            low, high = np.where(holds, tried, low), np.where(holds, high, tried)
        return low

    def slip(self, axle: Axle, most: Table, corner: Table, shape: float) -> Table:
        """Slip angle of an axle in a steady bend, rad; `most` is the lateral acceleration it holds.

        Inverts the magic formula, of the given shape, at the axle's share of its grip.
        """
        p = self.p
        used = np.minimum(corner * USED / np.maximum(most, 1e-6), 0.99)
        peak = p.peak_y + p.peak_y_slope * (self.load(axle, 0.0) * (1 + used / 2) / 2 - p.load_low)
        slip: Table = np.maximum(peak, 0.02) * np.tan(np.arcsin(used) / shape) / np.tan(np.pi / 2 / shape)
        return slip

    def engine(self, throttle: float) -> Table:
        """Acceleration by the engine in the best gear, turning parts included, (SPEEDS,)."""
        p = self.p
        best = np.full(len(SPEEDS), -np.inf)
        for ratio in p.ratios:
            rpm = SPEEDS / p.radius * ratio * RPM
            inertia = 4 * p.wheel_inertia + np.where(rpm < p.launch_rpm, 0.0, p.engine_inertia * ratio**2)
            torque = np.array([engine_torque(throttle, max(turns, p.launch_rpm), p) for turns in rpm])
            thrust = torque * ratio * p.efficiency / p.radius
            best = np.maximum(best, thrust / (self.mass + inertia / p.radius**2))
        return best - p.rolling_resistance * GRAVITY


@lru_cache
def envelope(car: Car) -> Envelope:
    """The car's quasi-steady limits on new tyres with a full tank."""
    limits = Limits(car, SPEEDS[:, None, None], WEIGHTS[None, :, None])
    p = limits.p
    most_front, most_rear = limits.corner()
    corner = np.minimum(most_front, most_rear)
    front, rear = limits.axles
    shape = car.tyre.shape
    slip_front = limits.slip(front, most_front, corner, shape)
    slip_rear = limits.slip(rear, most_rear, corner, shape)
    return Envelope(
        corner=corner[:, :, 0].copy(),
        brake=limits.longitudinal(-1.0, corner),
        traction=limits.longitudinal(1.0, corner),
        scrub=corner * USED * (front.weight * slip_front + rear.weight * slip_rear),
        understeer=slip_front - slip_rear,
        power=limits.engine(1.0),
        coast=limits.engine(0.0),
        drag=0.5 * AIR_DENSITY * p.drag_area * SPEEDS**2 / limits.mass,
        speed_step=float(SPEEDS[1]),
        weight_step=float(WEIGHTS[1]),
    )
