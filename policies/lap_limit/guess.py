"""Where the search for the fastest lap begins: the built-in driver's line, at lower speeds."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from nathlon.policies.driver.envelope import envelope
from nathlon.policies.driver.racing_line import minimum_time
from nathlon.policies.driver.speed_profile import Profile, profile
from nathlon.sim.car import Car, parameters
from nathlon.sim.physics.chassis import AIR_DENSITY, GRAVITY
from nathlon.sim.track import Track

GRIP = 0.92
"""Share of the tyres' grip that the first guess uses."""
USED = 0.85
"""Largest share of a tyre's peak force for which the guess's slips are set."""

Array = NDArray[np.float64]


def quasi_steady(track: Track, car: Car) -> Profile:
    """The line and the speeds to begin with."""
    limits = envelope(car)
    return profile(track, minimum_time(track, limits, GRIP), limits, GRIP)


def slip_for(share: Array, peak: float, shape: float) -> Array:
    """The slip at which a tyre's curve reaches a share of its peak, at most USED."""
    share = np.clip(share, -USED, USED)
    return peak * np.tan(np.arcsin(share) / shape) / np.tan(np.pi / (2.0 * shape))


def follow(line: Profile, car: Car) -> Array:
    """States and controls, about, of a car that follows a line, (14, rows of the track table)."""
    p, shape = parameters(car), car.tyre.shape
    speed, curvature = line.speed, line.path.curvature
    gain = 0.5 * (np.roll(speed, -1) ** 2 - np.roll(speed, 1) ** 2)
    gain /= line.path.step + np.roll(line.path.step, 1)
    push, yaw_rate = speed * speed * curvature, speed * curvature
    slip = slip_for(push / (p.friction_y * GRAVITY), p.peak_y, shape)
    sideways = p.b * yaw_rate - slip * speed
    lock = car.steering.full_lock_rad
    steering = np.clip(slip + (sideways + p.a * yaw_rate) / speed, -lock, lock)
    thrust = gain + 0.5 * AIR_DENSITY * p.drag_area * speed * speed / car.body.mass_kg
    brakes = p.brake_torque_front + p.brake_torque_rear
    slip_ratios = []
    for driven, braked in (
        (p.drive_front, p.brake_torque_front / brakes),
        (1.0 - p.drive_front, p.brake_torque_rear / brakes),
    ):
        used = thrust * np.where(thrust > 0.0, driven, braked) / (0.5 * p.friction_x * GRAVITY)
        slip_ratios += [slip_for(used, p.peak_x, shape)] * 2
    full_brakes = 2.0 * brakes / (p.radius * car.body.mass_kg)
    pedal = np.where(thrust > 0.0, np.minimum(thrust / 6.0, 0.9), thrust / full_brakes)
    heading = line.heading - sideways / speed
    still = np.zeros_like(speed)
    states = [speed, sideways, yaw_rate, line.offset, heading, steering]
    return np.stack([*states, still, pedal, thrust, push, *slip_ratios])
