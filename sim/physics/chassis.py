"""One car over one dynamics step: a planar double-track model with four wheel spins.

Loads follow the accelerations quasi-statically through a first-order lag, split between the axles
by roll stiffness. Wheel spin is far stiffer than the rest (some 500/s at 20 m/s), so it is
advanced by a linearly implicit step; position and velocity by a semi-implicit Euler step.
"""

from __future__ import annotations

import math

import numpy as np

from sim.car import CarParameters
from sim.kernel import inlined
from sim.physics.powertrain import drive_torque, shift
from sim.physics.tyre import tyre_force
from sim.state import CarRecord

GRAVITY = 9.81
AIR_DENSITY = 1.2
SLOWEST = 6.0  # m/s: slips are formed with at least this speed, which keeps a car at rest well behaved
ROLLING_SPEED = 0.5  # m/s over which rolling resistance builds up


@inlined
def set_loads(car: CarRecord, speed_squared: float, p: CarParameters) -> None:
    """Normal loads of the four tyres from weight, downforce and load transfer, N."""
    wheelbase = p.a + p.b
    downforce = 0.5 * AIR_DENSITY * p.downforce_area * speed_squared
    downforce *= 1.0 - p.draught_downforce * car.draught
    pitch = p.mass * car.carried_x * p.height / wheelbase
    front = p.mass * GRAVITY * p.b / wheelbase + downforce * p.downforce_front - pitch
    rear = p.mass * GRAVITY * p.a / wheelbase + downforce * (1.0 - p.downforce_front) + pitch
    roll = p.mass * car.carried_y * p.height
    roll_front = roll * p.roll_front / (2.0 * p.half_front_track)
    roll_rear = roll * (1.0 - p.roll_front) / (2.0 * p.half_rear_track)
    car.load[0] = max(0.5 * front - roll_front, 0.0)
    car.load[1] = max(0.5 * front + roll_front, 0.0)
    car.load[2] = max(0.5 * rear - roll_rear, 0.0)
    car.load[3] = max(0.5 * rear + roll_rear, 0.0)


@inlined
def eased(slip: float, threshold: float) -> tuple[float, float]:
    """Share of the torque that a mild slip control lets through, and how fast it falls with slip."""
    if slip <= threshold:
        return 1.0, 0.0
    if slip >= 1.5 * threshold:
        return 0.1, 0.0
    return 1.0 - 0.9 * (slip - threshold) / (0.5 * threshold), 0.9 / (0.5 * threshold)


@inlined
def brake_torque(spin: float, limit: float, other: float) -> float:
    """Torque of a brake that can apply `limit` N m: against the spin, or holding a locked wheel."""
    if spin > 1e-3:
        return -limit
    if spin < -1e-3:
        return limit
    return -min(max(other, -limit), limit)


@inlined
def advance(
    car: CarRecord, steer: float, grip: np.ndarray, drag: np.ndarray, dt: float, p: CarParameters
) -> None:
    """Advance one car by dt seconds on a surface of given grip.

    Args:
        car: CAR_STATE record, changed in place.
        steer: wanted angle of the front wheels, rad.
        grip: (4,) grip of the surface under each tyre, 1 is dry road.
        drag: (4,) rolling resistance under each tyre, share of the load.
        dt: s.
        p: the car's parameters.
    """
    most = p.steering_rate * dt
    car.steering += min(max(steer - car.steering, -most), most)
    sin_steer, cos_steer = math.sin(car.steering), math.cos(car.steering)

    u, v, r = car.velocity_x, car.velocity_y, car.yaw_rate
    speed_squared = u * u + v * v
    set_loads(car, speed_squared, p)

    driven_spin = 0.5 * (car.spin[2] + car.spin[3])
    shift(car, driven_spin, dt, p)
    axle_torque, engine_inertia = drive_torque(car, driven_spin, p)

    force_x = (
        -0.5 * AIR_DENSITY * p.drag_area * (1.0 - p.draught_drag * car.draught) * math.sqrt(speed_squared)
    )
    force_y = force_x * v
    force_x *= u
    moment = 0.0

    # Of each rear wheel: what the coupled step of the driven axle below needs.
    rhs_left = rhs_right = diagonal_left = diagonal_right = 1.0
    gain_left = gain_right = 0.0

    for wheel in range(4):
        front = wheel < 2
        left = wheel % 2 == 0
        x = p.a if front else -p.b
        half_track = p.half_front_track if front else p.half_rear_track
        y = half_track if left else -half_track
        point_x = u - r * y
        point_y = v + r * x
        if front:
            along = point_x * cos_steer + point_y * sin_steer
            across = point_y * cos_steer - point_x * sin_steer
        else:
            along = point_x
            across = point_y
        reference = max(abs(along), SLOWEST)
        spin = car.spin[wheel]
        slip_ratio = (spin * p.radius - along) / reference
        slip_angle = -across / reference
        load = car.load[wheel]
        fx, fy, stiffness = tyre_force(slip_ratio, slip_angle, load, grip[wheel], p)
        car.slip_angle[wheel] = slip_angle

        # d(force)/d(spin), and the slip controls' share of the torque with its slope.
        gain = stiffness * p.radius / reference
        share, slope = eased(-slip_ratio, p.abs_slip)
        limit = car.brake * (p.brake_torque_front if front else p.brake_torque_rear)
        inertia = p.wheel_inertia
        torque = -p.radius * fx
        implicit = p.radius * gain + limit * slope * p.radius / reference
        if not front:
            inertia += 0.5 * engine_inertia
            if axle_torque > 0.0:
                drive_share, drive_slope = eased(slip_ratio, p.traction_slip)
                torque += 0.5 * axle_torque * drive_share
                implicit += 0.5 * axle_torque * drive_slope * p.radius / reference
            else:
                torque += 0.5 * axle_torque
        torque += brake_torque(spin, limit * share, torque)

        if front:
            new_spin = spin + dt * torque / (inertia + dt * implicit)
            if new_spin * spin < 0.0 and limit > 0.0:
                new_spin = 0.0
            car.spin[wheel] = new_spin
            fx += gain * (new_spin - spin)
        elif left:
            rhs_left, diagonal_left, gain_left = dt * torque, inertia + dt * implicit, gain
        else:
            rhs_right, diagonal_right, gain_right = dt * torque, inertia + dt * implicit, gain

        car.slip_ratio[wheel] = slip_ratio
        fx -= drag[wheel] * load * along / (abs(along) + ROLLING_SPEED)
        if front:
            body_x = fx * cos_steer - fy * sin_steer
            body_y = fx * sin_steer + fy * cos_steer
        else:
            body_x = fx
            body_y = fy
        force_x += body_x
        force_y += body_y
        moment += x * body_y - y * body_x

    # The differential couples the driven wheels: two implicit equations at once.
    coupling = dt * p.differential
    difference = coupling * (car.spin[2] - car.spin[3])
    rhs_left -= difference
    rhs_right += difference
    diagonal_left += coupling
    diagonal_right += coupling
    determinant = diagonal_left * diagonal_right - coupling * coupling
    change_left = (rhs_left * diagonal_right + coupling * rhs_right) / determinant
    change_right = (rhs_right * diagonal_left + coupling * rhs_left) / determinant
    for wheel in range(2, 4):
        change = change_left if wheel == 2 else change_right
        gain = gain_left if wheel == 2 else gain_right
        half_track = p.half_rear_track if wheel == 2 else -p.half_rear_track
        spin = car.spin[wheel]
        if car.brake > 0.0 and (spin + change) * spin < 0.0:
            change = -spin
        car.spin[wheel] = spin + change
        force_x += gain * change
        moment -= half_track * gain * change

    move(car, force_x, force_y, moment, dt, p)


@inlined
def move(car: CarRecord, force_x: float, force_y: float, moment: float, dt: float, p: CarParameters) -> None:
    """Advance the rigid body under a force (N, car frame) and a moment (N m) by dt seconds."""
    car.acceleration_x = force_x / p.mass
    car.acceleration_y = force_y / p.mass
    follow = dt / (p.load_lag + dt)
    car.carried_x += (car.acceleration_x - car.carried_x) * follow
    car.carried_y += (car.acceleration_y - car.carried_y) * follow
    car.world_velocity_x += dt * (car.acceleration_x * car.cos_yaw - car.acceleration_y * car.sin_yaw)
    car.world_velocity_y += dt * (car.acceleration_x * car.sin_yaw + car.acceleration_y * car.cos_yaw)
    car.yaw_rate += dt * moment / p.yaw_inertia
    car.yaw += dt * car.yaw_rate
    set_direction(car)
    car.x += dt * car.world_velocity_x
    car.y += dt * car.world_velocity_y
    set_body_velocity(car)


@inlined
def set_body_velocity(car: CarRecord) -> None:
    """Velocity in the car's frame from velocity in the world's."""
    car.velocity_x = car.world_velocity_x * car.cos_yaw + car.world_velocity_y * car.sin_yaw
    car.velocity_y = car.world_velocity_y * car.cos_yaw - car.world_velocity_x * car.sin_yaw


@inlined
def set_direction(car: CarRecord) -> None:
    """Cosine and sine of the yaw; to be called whenever the yaw changes."""
    car.cos_yaw, car.sin_yaw = math.cos(car.yaw), math.sin(car.yaw)
