"""How to steer along a speed profile: a linear-quadratic regulator that sees the line ahead.

Around every place of the lap the car is a bicycle whose tyres have the stiffness that their load and
their forces leave them there. One backward sweep of Riccati's equation over the lap gives feedback
gains, and the steering that anticipates the bends to come.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from nathlon.policies.driver.envelope import SPEEDS, Axle, Envelope, Limits
from nathlon.policies.driver.speed_profile import Line, Profile
from nathlon.sim.car import Car
from nathlon.sim.clock import AGENT_DT, SUBSTEPS
from nathlon.sim.physics.chassis import GRAVITY

LATERAL_M = 0.15
STEERING_RAD = 0.03
"""So much off the line is as bad as so much steering beside that of a steady bend."""
SLOWEST = 8.0
SATURATED = 0.97
"""Share of its grip at which an axle counts as no more loaded."""


class Steering(NamedTuple):
    """Steering along a lap at a profile's speeds; arrays are (rows,), `gains` (rows, 4).

    Attributes:
        speed: for which the rest holds, m/s.
        slip: angle of the front wheels beyond that which the bend's geometry asks for, rad.
        rear_slip: slip angle of the rear tyres in the steady bend, rad.
        gains: steering for each unit of lateral error (m), course error, sideslip (rad) and yaw rate
            (rad/s) beyond those of the steady bend.
    """

    speed: Line
    slip: Line
    rear_slip: Line
    gains: Line


class _Bicycle(NamedTuple):
    """The car at every place of the lap; arrays are (rows,)."""

    speed: Line
    curvature: Line
    slip_front: Line
    slip_rear: Line
    stiff_front: Line
    stiff_rear: Line
    a: float
    b: float
    mass: float
    inertia: float


def _stiffness(limits: Limits, axle: Axle, lateral: Line, along: Line, shape: float) -> tuple[Line, Line]:
    """Slip angle (rad) of an axle in a bend and its stiffness there (N/rad), beside driving or braking."""
    p = limits.p
    load = np.maximum(limits.load(axle, along), 500.0)
    most_x, most_y = limits.grip(axle, load, np.abs(lateral))
    share = np.where(along > 0, axle.drive, axle.brake)
    used_x = limits.mass * along * share / np.maximum(most_x, 1.0)
    used_y = limits.mass * lateral * axle.weight / np.maximum(most_y, 1.0)
    used = np.maximum(np.hypot(used_x, used_y), 1e-3)
    held = np.minimum(used, SATURATED)
    steep = np.tan(np.pi / 2 / shape)
    slip = np.tan(np.arcsin(held) / shape) / steep
    secant = held / slip
    tangent = np.sqrt(1 - held**2) * shape * steep / (1 + (steep * slip) ** 2)
    peak = np.maximum(p.peak_y + p.peak_y_slope * (load / 2 - p.load_low), 0.02)
    lean = (used_y / used) ** 2
    stiffness = most_y / peak * (secant + lean * (tangent - secant))
    return slip * used_y / used * peak, np.maximum(stiffness, 0.2 * most_y / peak * secant)


def _bicycle(profile: Profile, car: Car, limits: Envelope, pace: float) -> _Bicycle:
    path = profile.path
    speed = np.maximum(profile.speed * pace, SLOWEST)
    lift = np.maximum(GRAVITY + path.heave * speed**2, 1.0)
    steep = 1.0 + path.climb**2 + path.camber**2
    loads = Limits(car, speed, lift / np.sqrt(steep))
    lateral = np.sqrt(1 + path.camber**2) * (path.curvature * speed**2 + lift / steep * path.camber)
    gain = (np.roll(speed, -1) ** 2 - np.roll(speed, 1) ** 2) / 2 / (path.step + np.roll(path.step, 1))
    along = gain + np.interp(speed, SPEEDS, limits.drag) + lift / steep * path.climb
    (slip_front, stiff_front), (slip_rear, stiff_rear) = (
        _stiffness(loads, axle, lateral, along, car.tyre.shape) for axle in loads.axles
    )
    p = loads.p
    return _Bicycle(
        speed,
        path.curvature,
        slip_front,
        slip_rear,
        stiff_front,
        stiff_rear,
        p.a,
        p.b,
        loads.mass,
        p.yaw_inertia,
    )


def _ticks(car: _Bicycle, rows: NDArray[np.int64]) -> Line:
    """What a tick at each row makes of (lateral error, course error, sideslip, yaw rate, one, steering).

    Returns:
        (ticks, 5, 6)
    """
    v, stiff_front, stiff_rear = car.speed[rows], car.stiff_front[rows], car.stiff_rear[rows]
    by_front, by_rear = np.zeros((2, len(rows), 6))
    by_front[:, 2], by_rear[:, 2] = -stiff_front, -stiff_rear
    by_front[:, 3], by_rear[:, 3] = -stiff_front * car.a / v, stiff_rear * car.b / v
    by_front[:, 4], by_rear[:, 4] = -stiff_front * car.slip_front[rows], -stiff_rear * car.slip_rear[rows]
    by_front[:, 5] = stiff_front
    rates = np.zeros((len(rows), 6, 6))
    rates[:, 0, 1] = v
    rates[:, 1] = rates[:, 2] = (by_front + by_rear) / (car.mass * v)[:, None]
    rates[:, 2, 3] -= 1.0
    rates[:, 2, 4] += car.curvature[rows] * v
    rates[:, 3] = (car.a * by_front - car.b * by_rear) / car.inertia
    steps: Line = np.linalg.matrix_power(np.eye(6) + AGENT_DT / SUBSTEPS * rates, SUBSTEPS)[:, :5]
    return steps


def _sweep(car: _Bicycle, rows: NDArray[np.int64], wheels: Line) -> Line:
    """The best steering at each tick of the lap as a law on `_ticks`' first five, (ticks, 5).

    Two laps backward, after which nothing is left of where the sweep began.
    """
    cost, value = np.zeros((5, 5)), np.zeros((5, 5))
    cost[0, 0] = (STEERING_RAD / LATERAL_M) ** 2
    steps, wanted = _ticks(car, rows), wheels[rows]
    laws = np.zeros((len(rows), 5))
    for tick in range(2 * len(rows) - 1, -1, -1):
        step, steady = steps[tick % len(rows)], wanted[tick % len(rows)]
        state, control = step[:, :5], step[:, 5]
        weighed = control @ value
        law = -(weighed @ state)
        law[4] += steady
        law /= 1.0 + weighed @ control
        laws[tick % len(rows)] = law
        closed = state + np.outer(control, law)
        effort = law.copy()
        effort[4] -= steady
        value = cost + np.outer(effort, effort) + closed.T @ value @ closed
    return laws


def plan(profile: Profile, car: Car, limits: Envelope, pace: float) -> Steering:
    """The steering along a profile driven at a share of its speeds.

    Args:
        profile: line and speeds.
        car: the car.
        limits: its envelope.
        pace: the share.
    """
    model = _bicycle(profile, car, limits, pace)
    time = np.concatenate([[0.0], np.cumsum(profile.path.step / model.speed)])
    ticks = np.arange(0.0, time[-1], AGENT_DT)
    rows = np.minimum(np.searchsorted(time, ticks, "right") - 1, len(model.speed) - 1)
    slip = model.slip_front - model.slip_rear
    wheels = (model.a + model.b) * model.curvature + slip
    laws = _sweep(model, rows, wheels)
    sideslip = model.b * model.curvature - model.slip_rear
    yaw_rate = model.curvature * model.speed
    # What the law adds to the steady bend's steering in view of the bends to come.
    ahead = laws[:, 4] + laws[:, 2] * sideslip[rows] + laws[:, 3] * yaw_rate[rows] - wheels[rows]
    gains = np.stack(
        [np.interp(time[:-1], ticks, column, period=time[-1]) for column in laws[:, :4].T], axis=1
    )
    return Steering(
        speed=model.speed,
        slip=slip + np.interp(time[:-1], ticks, ahead, period=time[-1]),
        rear_slip=model.slip_rear,
        gains=gains,
    )
