"""Engine torque and automatic gears.

A car that has a reverse gear is in it once it has stood with the brake held for a while. The brake pedal
then drives it back slowly; the throttle takes it out again. Motion forward is the same, to the bit, as
without one.
"""

from __future__ import annotations

import math

from nathlon.sim.car import TORQUE_POINTS, CarParameters
from nathlon.sim.kernel import lean_inlined
from nathlon.sim.state import CarRecord

RPM = 60.0 / (2.0 * math.pi)
DOWNSHIFT_MARGIN_RPM = 700.0
"""A lower gear is taken only if it leaves the engine so far below its upshift."""


REVERSE = -1
STANDING_M_S = 0.5
"""Speed below which a car stands, as far as the reverse gear is concerned."""
HELD_S = 0.5
"""For so long the brake is held then."""
BACK_M_S = 4.0
"""Where the torque in reverse ends."""
BACK_SHARE = 0.4
"""Of the engine's torque in first gear that there is in reverse, from rest."""


@lean_inlined
def choose_direction(car: CarRecord, dt: float) -> None:
    """Put the box into reverse or take it out, and have the brake pedal be the throttle there."""
    if car.gear == REVERSE:
        if car.throttle > 0.0:
            car.gear = 0
        else:
            car.throttle, car.brake = car.brake, 0.0
        return
    if car.brake > 0.0 and abs(car.velocity_x) < STANDING_M_S:
        car.held_s += dt
        if car.held_s > HELD_S:
            car.gear, car.held_s = REVERSE, 0.0
    else:
        car.held_s = 0.0


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
    if car.gear == REVERSE:
        return
    if car.shifting > 0.0:
        car.shifting -= dt
        return
    rpm = driven_spin * p.ratios[car.gear] * RPM
    if rpm > p.shift_up_rpm and car.gear < p.gears - 1:
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
    if car.gear == REVERSE:
        left = min(max(1.0 + driven_spin * p.radius / BACK_M_S, 0.0), 1.0)
        most = max(engine_torque(1.0, p.launch_rpm, p), 0.0) * p.ratios[0] * p.efficiency
        return -BACK_SHARE * left * car.throttle * most, 0.0
    if car.shifting > 0.0:
        return 0.0, 0.0
    ratio = p.ratios[car.gear]
    rpm = driven_spin * ratio * RPM
    if rpm < p.launch_rpm:
        slipping = max(engine_torque(car.throttle, p.launch_rpm, p), 0.0)
        return slipping * ratio * p.efficiency, 0.0
    return engine_torque(car.throttle, rpm, p) * ratio * p.efficiency, p.engine_inertia * ratio * ratio
