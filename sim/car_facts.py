"""What a car is, in numbers that a policy can be told: they do not change in a race.

Wet road and tyre compounds show in the friction, surfaces beside the road in their grip against it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from nathlon.sim.car import CarParameters
from nathlon.sim.physics.chassis import AIR_DENSITY

DRIVE_SPEEDS = (10.0, 20.0, 30.0, 45.0, 60.0, 75.0)
"""Speeds, m/s, at which the drive is told."""
LIGHT, HEAVY = 2000.0, 6500.0
"""Loads of a tyre, N, at which its grip is told."""

FACTS = (
    ("mass", 800.0, 1800.0),  # kg, with a full tank
    ("fuel_share", 0.0, 0.15),  # of the mass
    ("front_weight", 0.35, 0.65),
    ("wheelbase", 2.2, 3.2),  # m
    ("front_track", 1.3, 1.8),  # m
    ("rear_track", 1.3, 1.8),
    ("centre_of_mass_height", 0.3, 0.55),  # m
    ("yaw_gyration", 0.8, 1.0),  # radius over the geometric mean of the axles' distances
    ("roll_stiffness_front", 0.4, 0.75),
    ("length", 4.2, 5.0),  # m
    ("width", 1.8, 2.05),  # m
    ("drag", 0.0, 0.0014),  # m/s^2 for each (m/s)^2, at sea level
    ("downforce", 0.0, 0.004),
    ("downforce_front", 0.3, 0.55),
    *((f"drive_at_{speed:.0f}", 0.0, 16.0) for speed in DRIVE_SPEEDS),  # m/s^2 at full throttle
    ("drive_front", 0.0, 1.0),
    ("differential", 0.0, 120.0),  # N m s
    ("traction_slip", 0.06, 0.1),
    ("engine_braking", 0.0, 1.0),  # m/s^2 in top gear
    ("brake", 10.0, 45.0),  # m/s^2 at full pedal
    ("brake_front", 0.4, 0.9),
    ("abs_slip", 0.06, 0.1),
    ("full_lock", 0.25, 0.7),  # rad
    ("steering_rate", 0.7, 1.4),  # rad/s
    *(
        (f"{name}_{load}", low, high)
        for name, low, high in (
            ("grip_x", 0.7, 2.0),
            ("grip_y", 0.7, 2.0),
            ("peak_slip_ratio", 0.07, 0.14),
            ("peak_slip_angle", 0.08, 0.18),  # rad
        )
        for load in ("light", "heavy")
    ),
    ("wear_rate", 0.0, 4e-7),  # a joule of sliding
    ("kerb_grip", 0.7, 1.0),  # over that of the road, as the following
    ("grass_grip", 0.3, 0.8),
    ("gravel_grip", 0.3, 0.8),
)
"""Name of each number, and the range that standardises it."""


def car_facts(car: CarParameters, surface_grip: NDArray[np.float64]) -> NDArray[np.float32]:
    """The numbers of a car on its road, (len(FACTS),) float32, in SI units as FACTS has them.

    Args:
        car: with the friction of its tyres on the road as it is.
        surface_grip: (4,), of road, kerb, grass and gravel, over that of the road.
    """
    mass = car.dry_mass + car.fuel_capacity
    loads = np.array([LIGHT, HEAVY]) - car.load_low
    air = 0.5 * AIR_DENSITY / mass
    brake = 2.0 * (car.brake_torque_front + car.brake_torque_rear)
    values = [
        mass,
        car.fuel_capacity / mass,
        car.b / (car.a + car.b),
        car.a + car.b,
        2.0 * car.half_front_track,
        2.0 * car.half_rear_track,
        car.height,
        np.sqrt(car.yaw_inertia / (mass * car.a * car.b)),
        car.roll_front,
        2.0 * car.half_length,
        2.0 * car.half_width,
        air * car.drag_area,
        air * car.downforce_area,
        car.downforce_front,
        *(drive_force(car, speed) / mass for speed in DRIVE_SPEEDS),
        car.drive_front,
        car.differential,
        car.traction_slip,
        car.engine_braking * car.ratios[-1] / (car.radius * mass),
        brake / (car.radius * mass),
        car.brake_torque_front / (car.brake_torque_front + car.brake_torque_rear),
        car.abs_slip,
        car.full_lock,
        car.steering_rate,
        *(car.friction_x + car.friction_x_slope * loads),
        *(car.friction_y + car.friction_y_slope * loads),
        *(car.peak_x + car.peak_x_slope * loads),
        *(car.peak_y + car.peak_y_slope * loads),
        car.wear_per_joule,
        *surface_grip[1:],
    ]
    return np.array(values, np.float32)


def drive_force(car: CarParameters, speed: float) -> float:
    """Force of the engine at the wheels at full throttle in the gear that suits best, N.

    Args:
        car: the car.
        speed: m/s.
    """
    rpm = speed / car.radius * car.ratios * 30.0 / np.pi
    # The clutch slips below the launch speed.
    held = np.maximum(rpm, min(car.launch_rpm, car.rpm_max))
    torque = np.interp(held, np.linspace(0.0, car.rpm_max, len(car.torque)), car.torque)
    force = np.where(rpm > car.rpm_max, 0.0, torque * car.ratios * car.efficiency / car.radius)
    return float(force.max())
