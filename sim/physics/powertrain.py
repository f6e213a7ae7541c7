"""Engine torque and automatic gears."""

from __future__ import annotations

import math

from nathlon.sim.car import TORQUE_POINTS, CarParameters
from nathlon.sim.kernel import lean_inlined
from nathlon.sim.state import CarRecord

RPM = 60.0 / (2.0 * math.pi)
DOWNSHIFT_MARGIN_RPM = 700.0
"""A lower gear is taken only if it leaves the engine so far below its upshift."""


@lean_inlined
def engine_torque(throttle: float, rpm: float, p: CarParameters) -> float:
    """Torque at the crank, N m, between closed-throttle drag and the full-load curve."""
    if rpm >= p.rpm_max:
        return -p.engine_braking
    at = max(rpm, 0.0) / p.rpm_max * (TORQUE_POINTS - 1)
    low = int(at)
    full = p.torque[low] + (at - low) * (p.torque[min(low + 1, TORQUE_POINTS - 1)] - p.torque[low])
    drag = -p.engine_braking * rpm / p.rpm_max
    return drag + throttle * (full - drag)


@lean_inlined
def shift(car: CarRecord, driven_spin: float, dt: float, p: CarParameters) -> None:
    """Change gear by engine speed; the torque is cut while `shifting` lasts."""
    if car.shifting > 0.0:
        car.shifting -= dt
        return
    rpm = driven_spin * p.ratios[car.gear] * RPM
    if rpm > p.shift_up_rpm and car.gear < len(p.ratios) - 1:
        car.gear += 1
        car.shifting = p.shift_time
    elif car.gear > 0 and rpm < p.shift_down_rpm:
        lower = rpm * p.ratios[car.gear - 1] / p.ratios[car.gear]
        if lower < p.shift_up_rpm - DOWNSHIFT_MARGIN_RPM:
            car.gear -= 1
            car.shifting = p.shift_time


@lean_inlined
def drive_torque(car: CarRecord, driven_spin: float, p: CarParameters) -> tuple[float, float]:
    """Torque on the driven axle, N m, and the engine's inertia as the axle feels it, kg m^2.

    Below `launch_rpm` the clutch slips: the engine turns at that speed and its inertia is not felt.
    """
    if car.shifting > 0.0:
        return 0.0, 0.0
    ratio = p.ratios[car.gear]
    rpm = driven_spin * ratio * RPM
    if rpm < p.launch_rpm:
        slipping = max(engine_torque(car.throttle, p.launch_rpm, p), 0.0)
        return slipping * ratio * p.efficiency, 0.0
    return engine_torque(car.throttle, rpm, p) * ratio * p.efficiency, p.engine_inertia * ratio * ratio
