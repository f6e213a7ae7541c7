"""How the built-in driver turns one car's observation into pedals and steering."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from policies.racing_line import SPEEDS, USED
from sim.kernel import kernel
from sim.observation import OPPONENT, ObservationSpec
from sim.world import AGENT_DT

EDGE_MARGIN_M = 1.15
"""From the edge to the racing line: half a car."""
ACTUATION_S = 0.06
"""From the observation to the middle of the time in which its action works."""
YAW_DAMPING = 2.5
"""Steering against the yaw rate that the line does not ask for, m: gain times speed."""
PASSING_GAP_M = 2.6
"""Lateral distance between centres at which two cars pass each other safely."""
ALONGSIDE_M = 0.4
"""Room wanted beyond the passing gap by a car alongside."""
SIDESTEP_M = 0.35
"""Largest change of the move off the line a tick."""
CLOSE_M = 10.0
REACTION_S = 2.5
"""A car ahead is passed when it is closer than this, or will be reached within the time."""
OFF_LINE_CARE = 0.03
"""Share of the speed given up for each metre off the line, whose speeds hold only on it."""
BRAKING = 4.0
"""m/s^2 at which the driver plans to slow down behind a car in its path."""

SPEED_STEP = float(SPEEDS[1])
SPEED_COUNT = len(SPEEDS)
USED_COUNT = len(USED)
OPPONENT_SIZE = len(OPPONENT)


class Layout(NamedTuple):
    """Where the fields that the driver reads stand in its observation."""

    velocity: int
    yaw_rate: int
    slip_angle: int
    progress: int
    heading: int
    foot: int
    ahead: int
    behind: int
    cars_ahead: int
    cars_behind: int


def layout(spec: ObservationSpec) -> Layout:
    """The layout of a spec with cars ahead and behind."""
    fields = ("velocity", "yaw_rate", "slip_angle", "progress", "heading_error", "course_centre")
    starts = [int(spec.slice(name).start) for name in (*fields, "cars_ahead", "cars_behind")]
    return Layout._make((*starts, spec.cars_ahead, spec.cars_behind))


class Knowledge(NamedTuple):
    """What the driver knows of circuit and car.

    The first six are (rows of the track table,), the next five (SPEEDS,) or (SPEEDS, USED).
    """

    offset: NDArray[np.float64]
    heading: NDArray[np.float64]
    curvature: NDArray[np.float64]
    speed: NDArray[np.float64]
    left: NDArray[np.float64]
    right: NDArray[np.float64]
    corner: NDArray[np.float64]
    power: NDArray[np.float64]
    brake: NDArray[np.float64]
    drag: NDArray[np.float64]
    understeer: NDArray[np.float64]
    length: float
    spacing: float
    wheelbase: float
    full_lock: float
    peak_slip: float
    car_length: float
    car_width: float


@kernel
def along(table: np.ndarray, distance: float, spacing: float) -> float:
    """A table of the lap at a distance, m, from the line."""
    at = distance / spacing
    low = math.floor(at)
    share = at - low
    rows = len(table)
    return table[int(low) % rows] * (1.0 - share) + table[(int(low) + 1) % rows] * share


@kernel
def at_speed(table: np.ndarray, speed: float) -> float:
    """A table over SPEEDS at a speed, m/s."""
    at = min(max(speed / SPEED_STEP, 0.0), SPEED_COUNT - 1.001)
    low = int(at)
    return table[low] + (at - low) * (table[low + 1] - table[low])


@kernel
def clip(value: float, low: float, high: float) -> float:
    """The nearest number in [low, high]."""
    return min(max(value, low), high)


@kernel
def understeer_at(speed: float, curvature: float, knows: Knowledge) -> float:
    """Extra steering, rad, that a steady bend asks for."""
    used = min(speed * speed * abs(curvature) / at_speed(knows.corner, speed), 1.0) * (USED_COUNT - 1)
    low = min(int(used), USED_COUNT - 2)
    less = at_speed(knows.understeer[:, low], speed)
    more = at_speed(knows.understeer[:, low + 1], speed)
    return math.copysign(less + (used - low) * (more - less), curvature)


@kernel
def steer(
    distance: float, velocity: float, error: float, course: float, yaw_rate: float, knows: Knowledge
) -> float:
    """Steering, share of full lock: feed-forward of the line's curvature and its understeer,
    feedback of lateral error (m) and course (rad) as a damped spring over distance."""
    reach = max(8.0, 0.5 * velocity)
    error -= along(knows.offset, distance, knows.spacing)
    turned = course - along(knows.heading, distance, knows.spacing)
    curvature = along(knows.curvature, distance + max(velocity, 5.0) * 0.05, knows.spacing)
    curvature -= error / (reach * reach) + 1.6 * turned / reach
    most = at_speed(knows.corner, velocity) / max(velocity, 5.0) ** 2
    curvature = clip(curvature, -most, most)
    angle = knows.wheelbase * curvature + understeer_at(velocity, curvature, knows)
    angle += YAW_DAMPING / max(velocity, 10.0) * (curvature * velocity - yaw_rate)
    return angle / knows.full_lock


@kernel
def press(distance: float, velocity: float, pace: float, limit: float, knows: Knowledge) -> float:
    """Throttle (+) or brake (-) that meets the profile's speed, or the limit, at the end of the action."""
    target = along(knows.speed, distance + max(velocity, 3.0) * AGENT_DT, knows.spacing) * pace
    wanted = (min(target, limit) - velocity) / AGENT_DT + at_speed(knows.drag, velocity)
    return wanted / at_speed(knows.power if wanted >= 0.0 else knows.brake, velocity)


@kernel
def mind_others(
    values: np.ndarray, where: Layout, velocity: float, left: float, right: float, knows: Knowledge
) -> tuple[float, float]:
    """How far to move from here (m, + is left; nan for back to the line) and how fast to go at most
    (m/s) because of other cars.

    A slower car ahead is passed on the nearer side that has room; until the cars are beside each
    other's paths the driver keeps a speed from which it can still slow down. A car alongside is
    given room.

    Args:
        values: the observation in its own units.
        where: its layout.
        velocity: m/s.
        left, right: room between the car and the edges, m.
        knows: circuit and car.
    """
    move = math.nan
    limit = math.inf
    for place in range(where.cars_ahead - 1, -where.cars_behind - 1, -1):
        k = where.ahead + OPPONENT_SIZE * place if place >= 0 else where.behind + OPPONENT_SIZE * (-place - 1)
        if values[k] < 0.5:
            continue
        x, y, closing = values[k + 1], values[k + 2], values[k + 3]
        gap = x - knows.car_length
        if abs(x) < knows.car_length + 1.0 and abs(y) < PASSING_GAP_M + ALONGSIDE_M:
            move = math.copysign(abs(y) - PASSING_GAP_M - ALONGSIDE_M, y)
        elif x > 0.0 and gap < max(CLOSE_M, -REACTION_S * closing) and abs(y) < PASSING_GAP_M:
            by_left, by_right = y + PASSING_GAP_M, PASSING_GAP_M - y
            if by_left > left and by_right > right:
                move = 0.0
            elif by_right > right or (by_left <= by_right and by_left <= left):
                move = by_left
            else:
                move = -by_right
        if place >= 0 and gap > -1.0 and abs(y) < knows.car_width + 0.25:
            safe = velocity + closing + math.sqrt(2.0 * BRAKING * max(gap - 1.0, 0.0)) - 0.5
            limit = min(limit, max(safe, 3.0))
    return move, limit


@kernel
def drive_one(
    values: np.ndarray, where: Layout, before: float, pace: float, knows: Knowledge
) -> tuple[float, float, float]:
    """Pedal, steering and the move off the line after this tick.

    Args:
        values: the observation in its own units.
        where: its layout.
        before: the move off the line so far, m, + is left.
        pace: share of the profile's speed to drive.
        knows: circuit and car.
    """
    velocity, sideways = values[where.velocity], values[where.velocity + 1]
    yaw_rate, heading = values[where.yaw_rate], values[where.heading]
    lateral = -(values[where.foot] * math.sin(heading) + values[where.foot + 1] * math.cos(heading))
    lap_angle = math.atan2(values[where.progress], values[where.progress + 1])
    distance = lap_angle / (2.0 * math.pi) * knows.length + velocity * ACTUATION_S
    course = heading + math.atan2(sideways, max(velocity, 1.0)) + ACTUATION_S * yaw_rate

    line = along(knows.offset, distance, knows.spacing)
    left = along(knows.left, distance, knows.spacing) - EDGE_MARGIN_M
    right = along(knows.right, distance, knows.spacing) - EDGE_MARGIN_M
    move, limit = mind_others(values, where, velocity, left - lateral, right + lateral, knows)
    wanted = 0.0 if math.isnan(move) else lateral + move - line
    aside = before + clip(wanted - before, -SIDESTEP_M, SIDESTEP_M)
    aside = clip(line + aside, -right, left) - line

    rear_slip = 0.5 * (abs(values[where.slip_angle + 2]) + abs(values[where.slip_angle + 3]))
    ease = clip(2.0 - rear_slip / knows.peak_slip, 0.1, 1.0)
    careful = pace * (1.0 - OFF_LINE_CARE * abs(aside))
    pedal = press(distance, velocity, careful, limit, knows) * ease
    error = lateral + velocity * ACTUATION_S * math.sin(course) - aside
    return (
        clip(pedal, -1.0, 1.0),
        clip(steer(distance, velocity, error, course, yaw_rate, knows), -1.0, 1.0),
        aside,
    )


@kernel
def drive(
    observations: np.ndarray,
    mean: np.ndarray,
    deviation: np.ndarray,
    memory: np.ndarray,
    where: Layout,
    pace: float,
    knows: Knowledge,
    actions: np.ndarray,
    remembered: np.ndarray,
) -> None:
    """Fill `actions` (n, 2) and `remembered` (n, 1) for observations (n, size)."""
    values = np.empty(observations.shape[1])
    for row in range(len(observations)):
        for k in range(len(values)):
            values[k] = observations[row, k] * deviation[k] + mean[k]
        actions[row, 0], actions[row, 1], remembered[row, 0] = drive_one(
            values, where, memory[row, 0], pace, knows
        )
