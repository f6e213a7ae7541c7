"""The simulator's equations of one car in CasADi, smooth, with the way along the circuit for time.

The states are those of `nathlon.sim.physics.chassis` but for what is faster than the mesh can follow. Wheels
are taken to spin up and down with the car, so that their slip ratios follow from the balance of torques;
loads to follow the tyre forces at once instead of within the springs' 0.06 s. Both become unknowns of
their own, with equations that they have to meet. Every `min` and `max` is rounded off over a small
width; gears change at the speed of the upshift, at once.
"""

from __future__ import annotations

from typing import NamedTuple

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from nathlon.sim.car import Car, CarParameters, parameters
from nathlon.sim.physics.chassis import AIR_DENSITY, GRAVITY
from nathlon.sim.physics.course import KERB, SURFACE_DRAG, SURFACE_GRIP
from nathlon.sim.physics.powertrain import RPM

STATES = {
    "speed": 50.0,  # in the car's frame, forward, m/s
    "sideways": 2.0,  # to the left, m/s
    "yaw_rate": 1.0,  # rad/s
    "lateral": 5.0,  # m left of the centre line
    "heading": 0.2,  # yaw minus the direction of the centre line, rad
    "steering": 0.2,  # rad at the road wheels
}
CONTROLS = {
    "steering_rate": 1.0,  # rad/s
    "pedal": 1.0,  # throttle (+) or brake (-), shares of all there is
    "carried_x": 10.0,  # tyre forces over mass, which the springs carry, m/s^2
    "carried_y": 15.0,
    "slip_front_left": 0.1,
    "slip_front_right": 0.1,
    "slip_rear_left": 0.1,
    "slip_rear_right": 0.1,
}
"""Names and typical sizes of the unknowns at each point of the lap."""
ROAD = (
    *("curvature", "slope", "bank", "crest", "twist"),
    *("left", "kerb_left", "grip_left", "drag_left", "wall_left"),
    *("right", "kerb_right", "grip_right", "drag_right", "wall_right"),
)
"""The road beside a point of the centre line, columns as in nathlon.sim.track; grip and drag are the
run-off's.
"""

EDGE_WIDTH = 0.12  # m over which one surface passes into the next
PEDAL_WIDTH = 0.02
SLIP_WIDTH = 0.1  # of the threshold of the slip control
LOAD_WIDTH = 100.0  # N
GEAR_WIDTH = 0.01  # of the speed of the upshift
RPM_WIDTH = 60.0
COMBINED_SLIP = 1e-3  # below it the tyre's curve is flat

Array = NDArray[np.float64]


class PerTyre(NamedTuple):
    """Four numbers or expressions: front left, front right, rear left, rear right."""

    front_left: ca.SX
    front_right: ca.SX
    rear_left: ca.SX
    rear_right: ca.SX


def positive(value: ca.SX, width: float) -> ca.SX:
    """max(value, 0), rounded off."""
    return 0.5 * (value + ca.sqrt(value * value + width * width))


def step(value: ca.SX, width: float) -> ca.SX:
    """0 below zero and 1 above, rounded off."""
    return 0.5 * (1.0 + ca.tanh(value / width))


def slip_control(slip: ca.SX, threshold: float) -> ca.SX:
    """Share of the torque that the simulator's slip control lets through, which holds the threshold."""
    width = SLIP_WIDTH * threshold
    return 1.0 - step(slip - threshold - 0.5 * width, width)


def gear_ratio(spin: ca.SX, car: Car, p: CarParameters) -> ca.SX:
    """Overall ratio at a spin of the driven wheels: the lowest gear below the upshift."""
    ratio = ca.SX(float(p.ratios[0]))
    for lower, higher in zip(p.ratios[:-1], p.ratios[1:], strict=True):
        upshift = car.engine.shift_up_rpm / (lower * RPM)
        ratio += (higher - lower) * step(spin - upshift, GEAR_WIDTH * upshift)
    return ratio


def full_torque(rpm: ca.SX, car: Car) -> ca.SX:
    """Torque at the crank at full throttle, N m: the car's curve with rounded corners."""
    points, torques = np.array(car.engine.rpm), np.array(car.engine.torque_n_m)
    slopes = np.diff(torques) / np.diff(points)
    torque = torques[0] + slopes[0] * (rpm - points[0])
    for point, bend in zip(points[1:-1], np.diff(slopes), strict=True):
        torque += bend * positive(rpm - point, RPM_WIDTH)
    return torque


def drive(spin: ca.SX, throttle: ca.SX, car: Car, p: CarParameters) -> tuple[ca.SX, ca.SX]:
    """Torque on the driven axles, N m, and the engine's inertia as they feel it, kg m^2."""
    ratio = gear_ratio(spin, car, p)
    rpm = spin * ratio * RPM
    engaged = p.launch_rpm + positive(rpm - p.launch_rpm, RPM_WIDTH)
    drag = -p.engine_braking * engaged / p.rpm_max
    most = full_torque(engaged, car) - drag
    most *= 1.0 - step(engaged - p.rpm_max, RPM_WIDTH)
    inertia = p.engine_inertia * ratio * ratio * step(rpm - p.launch_rpm, RPM_WIDTH)
    return (drag + throttle * most) * ratio * p.efficiency, inertia


def tyre_force(
    slip_ratio: ca.SX, slip_angle: ca.SX, load: ca.SX, grip: ca.SX, p: CarParameters, shape: float
) -> tuple[ca.SX, ca.SX]:
    """Longitudinal and lateral force of a tyre, N; see `nathlon.sim.physics.tyre`."""
    above = load - p.load_low
    x = slip_ratio / (p.peak_x + p.peak_x_slope * above)
    y = slip_angle / (p.peak_y + p.peak_y_slope * above)
    combined = ca.sqrt(x * x + y * y + COMBINED_SLIP * COMBINED_SLIP)
    curve = ca.sin(shape * ca.atan(np.tan(np.pi / (2.0 * shape)) * combined)) / combined
    most_x = (p.friction_x + p.friction_x_slope * above) * grip * load
    most_y = (p.friction_y + p.friction_y_slope * above) * grip * load
    return most_x * curve * x, most_y * curve * y


def surface(lateral: ca.SX, road: dict[str, ca.SX]) -> tuple[ca.SX, ca.SX]:
    """Grip and further rolling resistance of what lies `lateral` metres left of the centre line."""
    grip, drag = ca.SX(1.0), ca.SX(0.0)
    for side, sign in (("left", 1.0), ("right", -1.0)):
        beyond = sign * lateral - road[side]
        on_kerb = step(beyond, EDGE_WIDTH)
        off = step(beyond - road[f"kerb_{side}"], EDGE_WIDTH)
        grip += on_kerb * (SURFACE_GRIP[KERB] - 1.0) + off * (road[f"grip_{side}"] - SURFACE_GRIP[KERB])
        drag += on_kerb * SURFACE_DRAG[KERB] + off * (road[f"drag_{side}"] - SURFACE_DRAG[KERB])
    return grip, drag


def gradient_and_heave(
    speed: ca.SX, sideways: ca.SX, lateral: ca.SX, sine: ca.SX, cosine: ca.SX, road: dict[str, ca.SX]
) -> tuple[ca.SX, ca.SX, ca.SX]:
    """Slope of the road along and across the car, and heave, m/s^2; see
    `nathlon.sim.physics.course.feel_road`.
    """
    stretch = 1.0 / (1.0 - road["curvature"] * lateral)
    climb = (road["slope"] + road["twist"] * lateral) * stretch
    slope_x = climb * cosine + road["bank"] * sine
    slope_y = road["bank"] * cosine - climb * sine
    forward = speed * cosine - sideways * sine
    aside = speed * sine + sideways * cosine
    advance = forward * stretch
    bending = road["curvature"] * (2.0 * climb * aside - road["bank"] * forward)
    heave = advance * (road["crest"] * advance + 2.0 * road["twist"] * aside + bending)
    return slope_x, slope_y, heave


def tyre_loads(
    mass: float, speed_squared: ca.SX, weight: ca.SX, carried_x: ca.SX, carried_y: ca.SX, p: CarParameters
) -> PerTyre:
    """Normal loads, N; see `nathlon.sim.physics.chassis.set_loads`."""
    wheelbase = p.a + p.b
    downforce = 0.5 * AIR_DENSITY * p.downforce_area * speed_squared
    pitch = mass * carried_x * p.height / wheelbase
    front = weight * p.b / wheelbase + downforce * p.downforce_front - pitch
    rear = weight * p.a / wheelbase + downforce * (1.0 - p.downforce_front) + pitch
    roll = mass * carried_y * p.height
    roll_front = roll * p.roll_front / (2.0 * p.half_front_track)
    roll_rear = roll * (1.0 - p.roll_front) / (2.0 * p.half_rear_track)
    loads = (
        0.5 * front - roll_front,
        0.5 * front + roll_front,
        0.5 * rear - roll_rear,
        0.5 * rear + roll_rear,
    )
    return PerTyre(*(positive(load, LOAD_WIDTH) for load in loads))


def aside_of(lateral: ca.SX, x: float, y: float, sine: ca.SX, cosine: ca.SX, curvature: ca.SX) -> ca.SX:
    """Metres left of the centre line of a point of the car, given in the car's frame."""
    ahead = x * cosine - y * sine
    return lateral + x * sine + y * cosine - 0.5 * curvature * ahead * ahead


def point_of_lap(car: Car) -> ca.Function:
    """What the equations of motion make of one point of the lap.

    Arguments of the function: STATES (6,), CONTROLS (8,), ROAD (15,), in SI units.

    Its results: `rates` (6,) of the states a second; `per_metre`, seconds a metre of centre line;
    `balance` (6,), which has to vanish: torques that accelerate the wheels more than the car, N m, and tyre
    forces over mass beyond those carried, m/s^2; `room` (8,), m,
    which has to be positive: from the tyres of each side to the other side's bounds (three tyres beyond
    them are off course), and from the corners of the body to the walls; `loads` (4,), N.
    """
    p = parameters(car)
    mass = car.body.mass_kg
    states, controls, beside = (
        ca.SX.sym("x", len(STATES)),
        ca.SX.sym("u", len(CONTROLS)),
        ca.SX.sym("r", len(ROAD)),
    )
    speed, sideways, yaw_rate, lateral, heading, steering = ca.vertsplit(states)
    steering_rate, pedal, carried_x, carried_y, *slips = ca.vertsplit(controls)
    road = dict(zip(ROAD, ca.vertsplit(beside), strict=True))
    curvature = road["curvature"]
    sine, cosine = ca.sin(heading), ca.cos(heading)

    slope_x, slope_y, heave = gradient_and_heave(speed, sideways, lateral, sine, cosine, road)
    steep_x, steep_y = 1.0 + slope_x * slope_x, 1.0 + slope_y * slope_y
    steep = steep_x + steep_y - 1.0
    speed_squared = speed * speed + sideways * sideways
    weight = mass * (GRAVITY + heave) / ca.sqrt(steep)
    loads = tyre_loads(mass, speed_squared, weight, carried_x, carried_y, p)

    places = (
        (p.a, p.half_front_track),
        (p.a, -p.half_front_track),
        (-p.b, p.half_rear_track),
        (-p.b, -p.half_rear_track),
    )
    asides = PerTyre(*(aside_of(lateral, x, y, sine, cosine, curvature) for x, y in places))
    force_x = force_y = moment = ca.SX(0.0)
    pulls, spins = [], []
    for wheel, (x, y) in enumerate(places):
        turn_sine, turn_cosine = (
            (ca.sin(steering), ca.cos(steering)) if wheel < 2 else (ca.SX(0.0), ca.SX(1.0))
        )
        point_x, point_y = speed - yaw_rate * y, sideways + yaw_rate * x
        along = point_x * turn_cosine + point_y * turn_sine
        across = point_y * turn_cosine - point_x * turn_sine
        grip, drag = surface(asides[wheel], road)
        pull, push = tyre_force(slips[wheel], -across / along, loads[wheel], grip, p, car.tyre.shape)
        pulls.append(pull)
        spins.append(along * (1.0 + slips[wheel]) / p.radius)
        pull = pull - (p.rolling_resistance + drag) * loads[wheel]
        wheel_x, wheel_y = pull * turn_cosine - push * turn_sine, pull * turn_sine + push * turn_cosine
        force_x, force_y = force_x + wheel_x, force_y + wheel_y
        moment = moment + x * wheel_y - y * wheel_x

    air = 0.5 * AIR_DENSITY * p.drag_area * ca.sqrt(speed_squared)
    reaction = (GRAVITY + heave) / steep
    acceleration_x = (force_x - air * speed) / (mass * ca.sqrt(steep_x)) - reaction * slope_x
    acceleration_y = (force_y - air * sideways) / (mass * ca.sqrt(steep_y)) - reaction * slope_y
    gain = acceleration_x + yaw_rate * sideways
    rates = ca.vertcat(
        gain,
        acceleration_y - yaw_rate * speed,
        moment / p.yaw_inertia,
        speed * sine + sideways * cosine,
        yaw_rate,
        steering_rate,
    )
    per_metre = (1.0 - curvature * lateral) / (speed * cosine - sideways * sine)
    torques = wheel_torques(car, p, pedal, slips, spins, pulls, gain)
    balance = ca.vertcat(torques, force_x / mass - carried_x, force_y / mass - carried_y)

    bounds_left, bounds_right = road["left"] + road["kerb_left"], road["right"] + road["kerb_right"]
    room = [
        bounds_left - asides.front_right,
        bounds_left - asides.rear_right,
        bounds_right + asides.front_left,
        bounds_right + asides.rear_left,
    ]
    for x in (p.half_length, -p.half_length):
        room.append(road["wall_left"] - aside_of(lateral, x, p.half_width, sine, cosine, curvature))
        room.append(road["wall_right"] + aside_of(lateral, x, -p.half_width, sine, cosine, curvature))
    return ca.Function(
        "point_of_lap",
        [states, controls, beside],
        [rates, per_metre, balance, ca.vertcat(*room), ca.vertcat(*loads)],
        ["states", "controls", "road"],
        ["rates", "per_metre", "balance", "room", "loads"],
    )


def wheel_torques(
    car: Car,
    p: CarParameters,
    pedal: ca.SX,
    slips: list[ca.SX],
    spins: list[ca.SX],
    pulls: list[ca.SX],
    gain: ca.SX,
) -> ca.SX:
    """Torque on each wheel beyond that with which it follows the car, N m, (4,).

    Args:
        pulls: longitudinal forces of the tyres, N.
        gain: of the car's speed, m/s^2.
    """
    throttle, brake = positive(pedal, PEDAL_WIDTH), positive(-pedal, PEDAL_WIDTH)
    front_spin, rear_spin = 0.5 * (spins[0] + spins[1]), 0.5 * (spins[2] + spins[3])
    driven_spin = p.drive_front * front_spin + (1.0 - p.drive_front) * rear_spin
    torque, engine_inertia = drive(driven_spin, throttle, car, p)
    left_over = []
    for wheel in range(4):
        share = p.drive_front if wheel < 2 else 1.0 - p.drive_front
        brakes = brake * (p.brake_torque_front if wheel < 2 else p.brake_torque_rear)
        other = wheel + 1 if wheel % 2 == 0 else wheel - 1
        applied = 0.5 * share * torque * slip_control(slips[wheel], p.traction_slip)
        applied -= brakes * slip_control(-slips[wheel], p.abs_slip)
        if share > 0.0:
            applied -= p.differential * (spins[wheel] - spins[other])
        inertia = p.wheel_inertia + 0.5 * share * engine_inertia
        left_over.append(applied - p.radius * pulls[wheel] - inertia * gain / p.radius)
    return ca.vertcat(*left_over)
