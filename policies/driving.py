"""How the built-in driver turns one car's observation into pedals and steering."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from policies.envelope import Envelope
from policies.speed_profile import Path, at_speed, demand, look_up
from policies.steering import Steering
from sim.kernel import inlined, kernel
from sim.observation import OPPONENT, ObservationSpec
from sim.physics.chassis import GRAVITY
from sim.physics.tyre import worn_grip
from sim.world import AGENT_DT

ACTUATION_S = 0.06
"""From the observation to the middle of the time in which its action works."""
PASSING_GAP_M = 2.6
"""Lateral distance between centres at which two cars pass each other safely."""
ROOM_M = 0.7
"""Wanted between the flanks of two cars side by side."""
SIDESTEP_M_S = 1.5
SIDESTEP_M_S2 = 3.0
"""Speed and acceleration with which the driver moves aside at most."""
SIDESTEP_S = 1.0
"""In which a small move would be made at its first speed."""
LOST_LINE_M = 1.0
"""Further off the line than this the driver goes back to it as after a move aside."""
CLOSE_M = 10.0
REACTION_S = 2.5
"""A car ahead is passed when it is closer than this, or will be reached within the time."""
OFF_LINE_CARE = 0.03
"""Share of the speed given up for each metre off the line, whose speeds hold only on it."""
BRAKING = 4.0
"""m/s^2 at which the driver plans to slow down behind a car in its path."""
SPIN_RAD = 0.5
"""Beyond this angle to the line, or of sideslip, the driver slows down to turn round."""
TURNING_SPEED = 5.0
TURNING_PEDAL = 0.35

OPPONENT_SIZE = len(OPPONENT)


class Layout(NamedTuple):
    """Where the fields that the driver reads stand in its observation."""

    velocity: int
    yaw_rate: int
    slip_angle: int
    slipstream: int
    wear: int
    progress: int
    heading: int
    course: int
    ahead: int
    behind: int
    cars_ahead: int
    cars_behind: int


def layout(spec: ObservationSpec) -> Layout:
    """The layout of a spec with cars ahead and behind."""
    fields = (
        "velocity",
        "yaw_rate",
        "slip_angle",
        "slipstream",
        "tyre_wear",
        "progress",
        "heading_error",
        "course",
    )
    starts = [int(spec.slice(name).start) for name in (*fields, "cars_ahead", "cars_behind")]
    return Layout._make((*starts, spec.cars_ahead, spec.cars_behind))


class Knowledge(NamedTuple):
    """What the driver knows of circuit and car; the arrays are (rows of the track table,)."""

    offset: NDArray[np.float64]
    heading: NDArray[np.float64]
    speed: NDArray[np.float64]
    x: NDArray[np.float64]  # of the centre line, m, and its direction, rad
    y: NDArray[np.float64]
    direction: NDArray[np.float64]
    left: NDArray[np.float64]  # room beside it
    right: NDArray[np.float64]
    path: Path
    steering: Steering
    limits: Envelope
    most_brake: float  # m/s^2 at full pedal, by the brakes alone
    length: float
    spacing: float
    a: float  # centre of mass to the axles
    b: float
    full_lock: float
    peak_slip: float
    downforce: float  # m/s^2 for each (m/s)^2
    draught_loss: float  # share of it lost in full slipstream
    car_length: float
    car_width: float


@inlined
def along(table: np.ndarray, distance: float, spacing: float) -> float:
    """A table of the lap at a distance, m, from the line."""
    at = distance / spacing
    low = math.floor(at)
    share = at - low
    rows = len(table)
    return table[int(low) % rows] * (1.0 - share) + table[(int(low) + 1) % rows] * share


@inlined
def clip(value: float, low: float, high: float) -> float:
    """The nearest number in [low, high]."""
    return min(max(value, low), high)


@inlined
def steer(
    distance: float,
    velocity: float,
    error: float,
    course: float,
    sideslip: float,
    yaw_rate: float,
    knows: Knowledge,
) -> float:
    """Angle of the front wheels, rad: that of the bend, and feedback of what is off.

    Args:
        distance: along the centre line, m.
        velocity: m/s.
        error: lateral, m, + is left of the line.
        course: direction of travel relative to the line, rad.
        sideslip: direction of travel relative to the car, rad.
        yaw_rate: rad/s.
        knows: circuit and car.
    """
    plan = knows.steering
    ratio = min(velocity / along(plan.speed, distance, knows.spacing), 1.1)
    slipping = ratio * ratio
    curvature = along(knows.path.curvature, distance, knows.spacing)
    angle = (knows.a + knows.b) * curvature + slipping * along(plan.slip, distance, knows.spacing)
    aside = sideslip - (knows.b * curvature - slipping * along(plan.rear_slip, distance, knows.spacing))
    turning = yaw_rate - curvature * velocity
    angle += along(plan.gains[:, 0], distance, knows.spacing) * error
    angle += along(plan.gains[:, 1], distance, knows.spacing) * course
    angle += along(plan.gains[:, 2], distance, knows.spacing) * aside
    angle += along(plan.gains[:, 3], distance, knows.spacing) * turning
    straight = sideslip + knows.a * yaw_rate / max(velocity, 5.0)
    return clip(angle, straight - knows.peak_slip, straight + knows.peak_slip)


@inlined
def press(distance: float, velocity: float, pace: float, limit: float, knows: Knowledge) -> float:
    """Throttle (+) or brake (-) that meets the profile's speed, or the limit, at the end of the action."""
    limits = knows.limits
    target = along(knows.speed, distance + max(velocity, 3.0) * AGENT_DT, knows.spacing) * pace
    bend = along(knows.path.curvature, distance, knows.spacing)
    climb = along(knows.path.climb, distance, knows.spacing)
    camber = along(knows.path.camber, distance, knows.spacing)
    heave = along(knows.path.heave, distance, knows.spacing)
    used, weight, gravity = demand(velocity, bend, climb, camber, heave, limits)
    wanted = (min(target, limit) - velocity) / AGENT_DT + at_speed(limits.drag, velocity, limits) + gravity
    wanted += look_up(limits.scrub, velocity, weight, abs(used), limits)
    coast = at_speed(limits.coast, velocity, limits)
    if wanted < coast:
        return (wanted - coast) / knows.most_brake
    return (wanted - coast) / (at_speed(limits.power, velocity, limits) - coast)


@inlined
def find(
    x: float, y: float, distance: float, lateral: float, heading: float, knows: Knowledge
) -> tuple[float, float, float]:
    """Where on the circuit something lies that the car sees at (x, y) m in its own frame.

    Returns:
        m along the centre line from the car, m to the left of the centre line, and the direction of
        the centre line there in the car's frame, rad.
    """
    yaw = along(knows.direction, distance, knows.spacing) + heading
    sine, cosine = math.sin(yaw), math.cos(yaw)
    direction = yaw - heading
    x_there = along(knows.x, distance, knows.spacing) - math.sin(direction) * lateral + x * cosine - y * sine
    y_there = along(knows.y, distance, knows.spacing) + math.cos(direction) * lateral + x * sine + y * cosine
    ahead = x * math.cos(heading) - y * math.sin(heading)
    aside = 0.0
    for _ in range(3):
        direction = along(knows.direction, distance + ahead, knows.spacing)
        dx = x_there - along(knows.x, distance + ahead, knows.spacing)
        dy = y_there - along(knows.y, distance + ahead, knows.spacing)
        ahead += dx * math.cos(direction) + dy * math.sin(direction)
        aside = dy * math.cos(direction) - dx * math.sin(direction)
    return ahead, aside, direction - yaw


@inlined
def mind_others(
    values: np.ndarray,
    where: Layout,
    distance: float,
    lateral: float,
    line: float,
    left: float,
    right: float,
    knows: Knowledge,
) -> tuple[float, float]:
    """Where to drive (m left of the centre line) and how fast at most (m/s) because of other cars.

    A car alongside is given room. A slower car ahead is passed on the nearer side that has room;
    until the cars are out of each other's paths the driver keeps a speed from which it can still
    slow down.

    Args:
        values: the observation in its own units.
        where: its layout.
        distance, lateral: of the car, m.
        line: lateral offset where it would be alone, m.
        left, right: room beside the centre line, m.
        knows: circuit and car.
    """
    velocity, sideways = values[where.velocity], values[where.velocity + 1]
    heading = values[where.heading]
    limit = math.inf
    low, high = -right, left
    blocked_by, blocked_at = math.inf, 0.0
    for place in range(where.cars_ahead + where.cars_behind):
        if place < where.cars_ahead:
            k = where.ahead + OPPONENT_SIZE * place
        else:
            k = where.behind + OPPONENT_SIZE * (place - where.cars_ahead)
        if values[k] < 0.5:
            continue
        ahead, there, turned = find(values[k + 1], values[k + 2], distance, lateral, heading, knows)
        speed = (velocity + values[k + 3]) * math.cos(turned) + (sideways + values[k + 4]) * math.sin(turned)
        gap = ahead - knows.car_length
        apart = there - lateral
        if abs(ahead) < knows.car_length + 1.5 and abs(apart) > 0.5 * knows.car_width:
            if apart > 0.0:
                high = min(high, there - knows.car_width - ROOM_M)
            else:
                low = max(low, there + knows.car_width + ROOM_M)
        elif (
            ahead > 0.0
            and gap < min(blocked_by, max(CLOSE_M, REACTION_S * (velocity - speed)))
            and (abs(there - line) < PASSING_GAP_M or abs(apart) < PASSING_GAP_M)
        ):
            blocked_by, blocked_at = gap, there
        if ahead > 0.0 and abs(apart) < knows.car_width + 0.3:
            safe = speed + math.sqrt(2.0 * BRAKING * max(gap - 1.5, 0.0)) - 0.5
            limit = min(limit, max(safe, 3.0))
    wish = line
    if blocked_by < math.inf:
        by_left, by_right = blocked_at + PASSING_GAP_M, blocked_at - PASSING_GAP_M
        if by_left > high and by_right < low:
            wish = lateral
        elif by_right < low or (by_left <= high and abs(by_left - lateral) < abs(by_right - lateral)):
            wish = max(line, by_left)
        else:
            wish = min(line, by_right)
    if low > high:
        return 0.5 * (low + high), limit
    return clip(wish, low, high), limit


@inlined
def grip_left(values: np.ndarray, where: Layout, velocity: float, knows: Knowledge) -> float:
    """Share of the grip on new tyres in still air."""
    down = knows.downforce * velocity * velocity
    lost = knows.draught_loss * values[where.slipstream] * down / (GRAVITY + down)
    wear = 0.0
    for wheel in range(4):
        wear = max(wear, values[where.wear + wheel])
    return (1.0 - lost) * worn_grip(wear)


@inlined
def drive_one(
    values: np.ndarray, where: Layout, aside: float, drift: float, pace: float, knows: Knowledge
) -> tuple[float, float, float, float]:
    """Pedal and steering, and the move off the line and its speed after this tick.

    Args:
        values: the observation in its own units.
        where: its layout.
        aside, drift: the move off the line so far, m, + is left, and its speed, m/s.
        pace: share of the profile's speed to drive.
        knows: circuit and car.
    """
    velocity, sideways = values[where.velocity], values[where.velocity + 1]
    yaw_rate, heading = values[where.yaw_rate], values[where.heading]
    centre_x, centre_y = values[where.course + 1], values[where.course + 4]
    lateral = -(centre_x * math.sin(heading) + centre_y * math.cos(heading))
    lap_angle = math.atan2(values[where.progress], values[where.progress + 1])
    distance = lap_angle / (2.0 * math.pi) * knows.length
    sideslip = math.atan2(sideways, max(velocity, 1.0))

    line = along(knows.offset, distance, knows.spacing)
    left = along(knows.left, distance, knows.spacing)
    right = along(knows.right, distance, knows.spacing)
    course = heading + sideslip - along(knows.heading, distance, knows.spacing)
    if abs(lateral - line - aside) > LOST_LINE_M:
        aside, drift = lateral - line, clip(velocity * course, -SIDESTEP_M_S, SIDESTEP_M_S)
    target, limit = mind_others(values, where, distance, lateral, line, left, right, knows)
    most = min(SIDESTEP_M_S, 0.1 * max(velocity, 1.0))
    wanted = clip((target - line - aside) / SIDESTEP_S, -most, most)
    drift += clip(wanted - drift, -SIDESTEP_M_S2 * AGENT_DT, SIDESTEP_M_S2 * AGENT_DT)
    course -= drift / max(velocity, 5.0)
    angle = steer(distance, velocity, lateral - line - aside, course, sideslip, yaw_rate, knows)
    aside += drift * AGENT_DT
    careful = pace * (1.0 - OFF_LINE_CARE * abs(aside)) * math.sqrt(grip_left(values, where, velocity, knows))
    pedal = clip(press(distance + velocity * ACTUATION_S, velocity, careful, limit, knows), -1.0, 1.0)
    rear_slip = 0.5 * (abs(values[where.slip_angle + 2]) + abs(values[where.slip_angle + 3]))
    pedal *= clip(2.0 - rear_slip / knows.peak_slip, 0.1, 1.0)
    if abs(sideslip) > SPIN_RAD or abs(course) > SPIN_RAD:
        pedal = -1.0 if abs(velocity) > TURNING_SPEED else TURNING_PEDAL
    return pedal, clip(angle / knows.full_lock, -1.0, 1.0), aside, drift


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
    """Fill `actions` (n, 2) and `remembered` (n, 2) for observations (n, size)."""
    values = np.empty(observations.shape[1])
    for row in range(len(observations)):
        for k in range(len(values)):
            values[k] = observations[row, k] * deviation[k] + mean[k]
        actions[row, 0], actions[row, 1], remembered[row, 0], remembered[row, 1] = drive_one(
            values, where, memory[row, 0], memory[row, 1], pace, knows
        )
