"""One car over one dynamics step: a double-track model with four wheel spins, on a road in space.

Motion is that of the map, the horizontal projection. The road pushes back along its own normal, so
it neither gives nor takes energy: with gradient G and `heave` the acceleration with which the road
lifts a car that goes straight on, the reaction is (g + heave) / sqrt(1 + G^2) a unit of mass, and its
horizontal part -(g + heave) G / (1 + G^2). Tyre forces lie in the road's plane.

Loads follow the tyre forces quasi-statically through a first-order lag, split between the axles
by roll stiffness. Wheel spin is far stiffer than the rest (some 500/s at 20 m/s), so it is
advanced by a linearly implicit step; position and velocity by a semi-implicit Euler step.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from sim.car import CarParameters
from sim.kernel import fused, lean_inlined
from sim.physics.body import set_body_velocity, small_sin_cos, turn
from sim.physics.powertrain import drive_torque, shift
from sim.physics.tyre import tyre_force
from sim.state import CarRecord

GRAVITY = 9.81
AIR_DENSITY = 1.2
SLOWEST = 6.0  # m/s: slips are formed with at least this speed, which keeps a car at rest well behaved
ROLLING_SPEED = 0.5  # m/s over which rolling resistance builds up


class Rates(NamedTuple):
    """How fast tyres wear and fuel burns, as multiples of the car's own figures; 0 is not at all."""

    wear: float
    fuel: float


@lean_inlined
def set_loads(car: CarRecord, steepness: float, shake: np.ndarray, p: CarParameters) -> None:
    """Normal loads of the four tyres from weight, the road's shape, downforce and load transfer, N.

    Args:
        car: CAR_STATE record.
        steepness: sqrt(1 + G^2) of the road under the car.
        shake: (4,) what kerbs make of each load, 1 is nothing.
        p: the car's parameters.
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
    car.load[0] = (0.5 * front - roll_front) * shake[0]
    car.load[1] = (0.5 * front + roll_front) * shake[1]
    car.load[2] = (0.5 * rear - roll_rear) * shake[2]
    car.load[3] = (0.5 * rear + roll_rear) * shake[3]


@lean_inlined
def brake_torque(spin: float, limit: float, other: float) -> float:
    """Torque of a brake that can apply `limit` N m: against the spin, or holding a locked wheel."""
    if abs(spin) > 1e-3:
        return -math.copysign(limit, spin)
    return -min(max(other, -limit), limit)


@lean_inlined
def within(force: float, most_squared: float) -> float:
    """A force cut to the largest one, of which the square is given."""
    if force * force <= most_squared:
        return force
    return math.copysign(math.sqrt(most_squared), force)


@lean_inlined
def prepare_wheel(
    car: CarRecord,
    wheel: int,
    along: float,
    across: float,
    gain_speed: float,
    grip: float,
    brake: float,
    drive: float,
    p: CarParameters,
) -> tuple[float, float, float, float, float]:
    """Forces of one tyre and the terms of the implicit step of its spin.

    Args:
        car: CAR_STATE record; slips are noted in it.
        wheel: which.
        along, across: velocity of its contact point in its frame, m/s.
        gain_speed: change of `along` over the step, m/s.
        grip: of surface and tyre.
        brake: torque of its brake, N m.
        drive: torque from the engine, N m.
        p: the car's parameters.

    Returns:
        longitudinal force if the spin does not change, and its gain with the spin; lateral force;
        square of the largest longitudinal force; torque without the tyre's.
    """
    reference = max(abs(along), SLOWEST)
    spin = car.spin[wheel]
    slip_ratio = (spin * p.radius - along) / reference
    slip_angle = -across / reference
    _, fy, stiffness, most = tyre_force(slip_ratio, slip_angle, car.load[wheel], grip, p)
    car.slip_ratio[wheel] = slip_ratio
    car.slip_angle[wheel] = slip_angle
    after = along + gain_speed
    per_speed = stiffness / max(abs(after), SLOWEST)
    fx = within(per_speed * (spin * p.radius - after), most)
    torque = drive + brake_torque(spin, brake, drive - p.radius * fx)
    return fx, per_speed * p.radius, fy, most, torque


@lean_inlined
def controlled(
    change: float,
    spin: float,
    along: float,
    brake: float,
    drive: float,
    inertia: float,
    dt: float,
    p: CarParameters,
) -> float:
    """Change of a wheel's spin under slip control, which eases the torque that would exceed its slip.

    Args:
        change: without control, rad/s.
        spin: before, rad/s.
        along: velocity of the contact point after the step, m/s.
        brake, drive: torques that the control can ease, N m.
        inertia: with the tyre's resistance, kg m^2.
        dt: s.
    """
    reference = max(abs(along), SLOWEST)
    if brake > 0.0:
        least = (along - p.abs_slip * reference) / p.radius - spin
        return change if change > least else min(least, change + brake * dt / inertia)
    if drive > 0.0:
        most = (along + p.traction_slip * reference) / p.radius - spin
        return change if change < most else max(most, change - drive * dt / inertia)
    return change


@lean_inlined
def solve_axle(
    rhs_left: float,
    rhs_right: float,
    own_left: float,
    own_right: float,
    difference: float,
    coupling: float,
) -> tuple[float, float]:
    """Changes of spin of two wheels that a differential couples: two implicit equations at once."""
    rhs_left -= coupling * difference
    rhs_right += coupling * difference
    own_left += coupling
    own_right += coupling
    determinant = own_left * own_right - coupling * coupling
    return (
        (rhs_left * own_right + coupling * rhs_right) / determinant,
        (rhs_right * own_left + coupling * rhs_left) / determinant,
    )


@lean_inlined
def step_axle(
    car: CarRecord,
    front: bool,
    torque: float,
    engine_inertia: float,
    grip: np.ndarray,
    drag: np.ndarray,
    dt: float,
    p: CarParameters,
    rates: Rates,
) -> tuple[float, float, float]:
    """Advance the spins of one axle and sum its tyre forces.

    Args:
        torque: that drives the axle, N m.
        engine_inertia: as the axle feels it, kg m^2.
        grip, drag: (4,) grip and rolling resistance under each tyre.

    Returns:
        forces (N) and moment (N m) on the car in its frame.
    """
    u, v, r = car.velocity_x, car.velocity_y, car.yaw_rate
    if front:
        left, x, half_track, share = 0, p.a, p.half_front_track, p.drive_front
        sine, cosine = small_sin_cos(car.steering)
        brake = car.brake * p.brake_torque_front
    else:
        left, x, half_track, share = 2, -p.b, p.half_rear_track, 1.0 - p.drive_front
        sine, cosine = 0.0, 1.0
        brake = car.brake * p.brake_torque_rear
    right = left + 1
    point_y = v + r * x
    along_left = (u - r * half_track) * cosine + point_y * sine
    along_right = (u + r * half_track) * cosine + point_y * sine
    across_left = point_y * cosine - (u - r * half_track) * sine
    across_right = point_y * cosine - (u + r * half_track) * sine
    # The last step's acceleration foretells the road speed, but would set a car at rest swinging.
    gain_speed = dt * (car.acceleration_x + r * v) * cosine if abs(u) > SLOWEST else 0.0
    inertia = p.wheel_inertia + 0.5 * engine_inertia * share
    drive = 0.5 * torque * share

    fx_left, gain_left, fy_left, most_left, torque_left = prepare_wheel(
        car, left, along_left, across_left, gain_speed, grip[left], brake, drive, p
    )
    fx_right, gain_right, fy_right, most_right, torque_right = prepare_wheel(
        car, right, along_right, across_right, gain_speed, grip[right], brake, drive, p
    )
    spin_left, spin_right = car.spin[left], car.spin[right]
    difference = spin_left - spin_right
    coupling = dt * p.differential * (1.0 if share > 0.0 else 0.0)
    own_left = inertia + dt * p.radius * gain_left
    own_right = inertia + dt * p.radius * gain_right
    change_left, change_right = solve_axle(
        dt * (torque_left - p.radius * fx_left),
        dt * (torque_right - p.radius * fx_right),
        own_left,
        own_right,
        difference,
        coupling,
    )
    new_left, new_right = (
        fx_left + gain_left * change_left,
        fx_right + gain_right * change_right,
    )
    over_left, over_right = (
        new_left * new_left > most_left,
        new_right * new_right > most_right,
    )
    if over_left or over_right:
        # The secant overshoots the peak: a saturated tyre pulls with its friction, whatever the spin.
        held_left, held_right = fx_left, fx_right
        if over_left:
            held_left, own_left = within(new_left, most_left), inertia
        if over_right:
            held_right, own_right = within(new_right, most_right), inertia
        change_left, change_right = solve_axle(
            dt * (torque_left - p.radius * held_left),
            dt * (torque_right - p.radius * held_right),
            own_left,
            own_right,
            difference,
            coupling,
        )
    change_left = controlled(change_left, spin_left, along_left + gain_speed, brake, drive, own_left, dt, p)
    change_right = controlled(
        change_right, spin_right, along_right + gain_speed, brake, drive, own_right, dt, p
    )
    if brake > 0.0:
        # A brake stops a wheel, it does not turn it the other way.
        if (spin_left + change_left) * spin_left < 0.0:
            change_left = -spin_left
        if (spin_right + change_right) * spin_right < 0.0:
            change_right = -spin_right
    new_left = within(fx_left + gain_left * change_left, most_left)
    new_right = within(fx_right + gain_right * change_right, most_right)
    car.spin[left] = spin_left + change_left
    car.spin[right] = spin_right + change_right
    if rates.wear > 0.0:
        work = rates.wear * p.wear_per_joule * dt
        slide_left = abs(new_left * (spin_left * p.radius - along_left)) + abs(fy_left * across_left)
        slide_right = abs(new_right * (spin_right * p.radius - along_right)) + abs(fy_right * across_right)
        car.wear[left] += work * slide_left
        car.wear[right] += work * slide_right

    new_left -= drag[left] * car.load[left] * along_left / (abs(along_left) + ROLLING_SPEED)
    new_right -= drag[right] * car.load[right] * along_right / (abs(along_right) + ROLLING_SPEED)
    left_x, left_y = (
        new_left * cosine - fy_left * sine,
        new_left * sine + fy_left * cosine,
    )
    right_x, right_y = (
        new_right * cosine - fy_right * sine,
        new_right * sine + fy_right * cosine,
    )
    return (
        left_x + right_x,
        left_y + right_y,
        x * (left_y + right_y) + half_track * (right_x - left_x),
    )


@lean_inlined
def advance(
    car: CarRecord,
    steer: float,
    grip: np.ndarray,
    drag: np.ndarray,
    shake: np.ndarray,
    dt: float,
    p: CarParameters,
    rates: Rates,
) -> None:
    """Advance one car by dt seconds on the road under it.

    Args:
        car: CAR_STATE record, changed in place.
        steer: wanted angle of the front wheels, rad.
        grip: (4,) grip under each tyre, 1 is a new tyre on dry road.
        drag: (4,) rolling resistance under each tyre, share of the load.
        shake: (4,) what kerbs make of each tyre's load, 1 is nothing.
        dt: s.
        p: the car's parameters.
        rates: of wear and fuel.
    """
    most = p.steering_rate * dt
    car.steering += min(max(steer - car.steering, -most), most)
    steep_x, steep_y = 1.0 + car.slope_x * car.slope_x, 1.0 + car.slope_y * car.slope_y
    steep = steep_x + steep_y - 1.0
    set_loads(car, math.sqrt(steep), shake, p)

    driven_spin = (1.0 - p.drive_front) * 0.5 * (car.spin[2] + car.spin[3])
    driven_spin += p.drive_front * 0.5 * (car.spin[0] + car.spin[1])
    shift(car, driven_spin, dt, p)
    torque, engine_inertia = drive_torque(car, driven_spin, p)
    if rates.fuel > 0.0:
        burnt = rates.fuel * p.fuel_per_joule * max(torque * driven_spin, 0.0) / p.efficiency * dt
        car.fuel = max(car.fuel - burnt, 0.0)
        car.mass = p.dry_mass + car.fuel

    front_x, front_y, front_turn = step_axle(car, True, torque, engine_inertia, grip, drag, dt, p, rates)
    rear_x, rear_y, rear_turn = step_axle(car, False, torque, engine_inertia, grip, drag, dt, p, rates)
    tyres_x, tyres_y = front_x + rear_x, front_y + rear_y
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
    car.yaw_rate += dt * (front_turn + rear_turn) / p.yaw_inertia
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
