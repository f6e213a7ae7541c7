"""How the built-in driver turns one car's observation into pedals and steering."""

from __future__ import annotations

import math

import numpy as np

from nathlon.policies.driver.knowledge import Knowledge, Layout, Ways, along, clip
from nathlon.policies.driver.speed_profile import at_speed, corner_limit, demand, look_up
from nathlon.policies.driver.traffic import mind_others
from nathlon.policies.driver.turning import OVERHANG_M, backs_out, turn_round
from nathlon.sim.clock import AGENT_DT
from nathlon.sim.kernel import inlined, kernel
from nathlon.sim.observation import CENTRE, LINES
from nathlon.sim.physics.chassis import GRAVITY
from nathlon.sim.physics.tyre import worn_grip

ACTUATION_S = 0.06
"""From the observation to the middle of the time in which its action works."""
SIDESTEP_M_S = 2.0
SIDESTEP_M_S2 = 3.0
"""Speed and acceleration with which the driver moves aside at most."""
SIDESTEP_S = 1.0
"""In which a small move would be made at its first speed."""
TURNING_IN_S = 0.35
"""From the steering to the move that it makes: so far ahead who does not remember means to be."""
SWERVE = 0.15
"""Greatest speed of a move that leads back onto the road, as a share of the car's."""
FORESIGHT_S = (0.7, 1.5, 2.5)
"""The line itself may cross the road: so far ahead the move off it has to end on the road."""
LOST_LINE_M = 1.4
"""Further off the line than this the driver goes back to it as after a move aside."""
OFF_LINE_CARE = 0.03
"""Share of the speed given up for each metre off the line, whose speeds hold only on it."""
LEAST_OFF_LINE = 0.4
"""Share of it that is left however far off: with none, a driver would stand in the gravel."""
ON_LINE_M, OFF_LINE_M = 0.2, 0.7
"""Up to here off the line a driver still drives as alone, and from there with all care."""
MOST_USED = 0.9
"""Share of the lateral grip beyond which the pedals get no less: who is too fast for a bend has to brake."""
ALL_BRAKES = 0.55
NO_BRAKES = 0.85
"""Rear slip angle over that of the peak up to which the brakes may do all, and from which they do
nothing: braking unloads the rear axle, and in a turn that begins then its slip quadruples in 0.4 s."""
SPIN_RAD = 0.5
"""Beyond this angle to the line, or of sideslip, the driver slows down to turn round."""
SLIDING_M_S = 8.0
"""Beyond this speed it only brakes."""
TURNING_SPEED = 4.5
TURNING_PEDAL = 0.35


@inlined
def steer(
    distance: float,
    velocity: float,
    aside: float,
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
        aside: how far off the line it wants to be, m, + is left.
        error: how far off that it is.
        course: direction of travel relative to the line, rad.
        sideslip: direction of travel relative to the car, rad.
        yaw_rate: rad/s.
        knows: circuit and car.
    """
    plan = knows.steering
    ratio = min(velocity / along(plan.speed, distance, knows.spacing), 1.1)
    slipping = ratio * ratio
    curvature = along(knows.path.curvature, distance, knows.spacing)
    curvature += aside * along(knows.bend, distance, knows.spacing)
    angle = (knows.a + knows.b) * curvature + slipping * along(plan.slip, distance, knows.spacing)
    slewing = sideslip - (knows.b * curvature - slipping * along(plan.rear_slip, distance, knows.spacing))
    turning = yaw_rate - curvature * velocity
    angle += along(plan.gains[:, 0], distance, knows.spacing) * error
    angle += along(plan.gains[:, 1], distance, knows.spacing) * course
    angle += along(plan.gains[:, 2], distance, knows.spacing) * slewing
    angle += along(plan.gains[:, 3], distance, knows.spacing) * turning
    straight = sideslip + knows.a * yaw_rate / max(velocity, 5.0)
    return clip(angle, straight - knows.peak_slip, straight + knows.peak_slip)


@inlined
def press(
    distance: float,
    velocity: float,
    yaw_rate: float,
    pace: float,
    care: float,
    limit: float,
    knows: Knowledge,
) -> float:
    """Throttle (+) or brake (-) that meets the profile's speed, or the limit, at the end of the action.

    Args:
        distance: along the centre line, m.
        velocity, yaw_rate: m/s and rad/s.
        pace: share of the profile's speed to drive.
        care: from 0, alone on the line, to 1, among others or off it.
        limit: greatest speed, m/s.
        knows: circuit and car.
    """
    limits = knows.limits
    there = distance + max(velocity, 3.0) * AGENT_DT
    target = (1.0 - care) * along(knows.speed, there, knows.spacing)
    target = pace * (target + care * along(knows.careful, there, knows.spacing))
    bend = along(knows.path.curvature, distance, knows.spacing)
    climb = along(knows.path.climb, distance, knows.spacing)
    camber = along(knows.path.camber, distance, knows.spacing)
    heave = along(knows.path.heave, distance, knows.spacing)
    used, weight, gravity = demand(velocity, bend, climb, camber, heave, limits)
    turning = velocity * yaw_rate / corner_limit(velocity, weight, limits)
    # Alone, the profile's speeds see to it that the pedals ask no more than the bend leaves.
    share = care * min(max(abs(used), abs(turning)), MOST_USED)
    wanted = (min(target, limit) - velocity) / AGENT_DT + at_speed(limits.drag, velocity, limits) + gravity
    wanted += look_up(limits.scrub, velocity, weight, abs(used), limits)
    coast = at_speed(limits.coast, velocity, limits)
    if wanted < coast:
        spare = look_up(limits.brake, velocity, weight, share, limits)
        return max(wanted - coast, -spare) / knows.most_brake
    wanted = min(wanted, look_up(limits.traction, velocity, weight, share, limits))
    return (wanted - coast) / (at_speed(limits.power, velocity, limits) - coast)


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
    values: np.ndarray,
    where: Layout,
    aside: float,
    drift: float,
    minds: bool,
    shift: float,
    pace: float,
    knows: Knowledge,
) -> tuple[float, float, float, float]:
    """Pedal and steering, and the move off the line and its speed after this tick.

    Args:
        values: the observation in its own units.
        where: its layout.
        aside, drift: the move off the line so far, m, + is left, and its speed, m/s.
        minds, shift, pace: as of `Ways`.
        knows: circuit and car.
    """
    velocity, sideways = values[where.velocity], values[where.velocity + 1]
    yaw_rate, heading = values[where.yaw_rate], values[where.heading]
    centre_x, centre_y = values[where.course + CENTRE], values[where.course + LINES + CENTRE]
    lateral = -(centre_x * math.sin(heading) + centre_y * math.cos(heading))
    lap_angle = math.atan2(values[where.progress], values[where.progress + 1])
    distance = lap_angle / (2.0 * math.pi) * knows.length
    sideslip = math.atan2(sideways, max(velocity, 1.0))

    line = along(knows.offset, distance, knows.spacing)
    left = along(knows.left, distance, knows.spacing)
    right = along(knows.right, distance, knows.spacing)
    course = heading + sideslip - along(knows.heading, distance, knows.spacing)
    if abs(lateral - line - aside) > LOST_LINE_M or not knows.remembers:
        aside, drift = lateral - line, clip(velocity * course, -SWERVE * velocity, SWERVE * velocity)
    if not knows.remembers:
        moved = clip((abs(aside) - ON_LINE_M) / (OFF_LINE_M - ON_LINE_M), 0.0, 1.0)
        aside, drift = moved * aside, moved * drift
    target, limit, care = clip(line + shift, min(-right, line), max(left, line)), math.inf, 0.0
    if minds:
        target, limit, care = mind_others(values, where, distance, lateral, line, left, right, knows)
    most = min(SIDESTEP_M_S, 0.1 * max(velocity, 1.0))
    wanted = clip((target - line - aside) / SIDESTEP_S, -most, most)
    for until in FORESIGHT_S:
        there = distance + until * velocity
        line_there = along(knows.offset, there, knows.spacing)
        least = min(-along(knows.right, there, knows.spacing) - line_there, 0.0)
        greatest = max(along(knows.left, there, knows.spacing) - line_there, 0.0)
        wanted = clip(wanted, (least - aside) / until, (greatest - aside) / until)
    wanted = clip(wanted, -SWERVE * max(velocity, 1.0), SWERVE * max(velocity, 1.0))
    change = SIDESTEP_M_S2 * (AGENT_DT if knows.remembers else TURNING_IN_S)
    drift += clip(wanted - drift, -change, change)
    course -= drift / max(velocity, 5.0)
    angle = steer(distance, velocity, aside, lateral - line - aside, course, sideslip, yaw_rate, knows)
    aside += drift * AGENT_DT
    careful = pace * max(1.0 - OFF_LINE_CARE * abs(aside), LEAST_OFF_LINE)
    careful *= math.sqrt(grip_left(values, where, velocity, knows))
    care = max(care, clip((abs(aside) - ON_LINE_M) / (OFF_LINE_M - ON_LINE_M), 0.0, 1.0))
    pedal = press(distance + velocity * ACTUATION_S, velocity, yaw_rate, careful, care, limit, knows)
    pedal = clip(pedal, -1.0, 1.0)
    rear_slip = 0.5 * (abs(values[where.slip_angle + 2]) + abs(values[where.slip_angle + 3]))
    sliding = rear_slip / knows.peak_slip
    if pedal < 0.0:
        pedal *= clip((NO_BRAKES - sliding) / (NO_BRAKES - ALL_BRAKES), 0.0, 1.0)
    else:
        pedal *= clip(2.0 - sliding, 0.1, 1.0)
    steering = clip(angle / knows.full_lock, -1.0, 1.0)
    if abs(sideslip) > SPIN_RAD or abs(course) > SPIN_RAD:
        pedal = -1.0
        if abs(velocity) < SLIDING_M_S:
            pedal = clip(TURNING_SPEED - abs(velocity), -1.0, 1.0) * TURNING_PEDAL
            turned = heading - along(knows.heading, distance, knows.spacing)
            turned = math.atan2(math.sin(turned), math.cos(turned))
            if abs(turned) > SPIN_RAD:
                room_left = along(knows.wall_left, distance, knows.spacing) - lateral - OVERHANG_M
                room_right = along(knows.wall_right, distance, knows.spacing) + lateral - OVERHANG_M
                steering = turn_round(turned, room_left, room_right, knows.turning_circle)
                if backs_out(velocity, turned, room_left, room_right):
                    pedal, steering = -1.0, math.copysign(1.0, turned)
    return pedal, steering, aside, drift


@kernel
def drive(
    observations: np.ndarray,
    mean: np.ndarray,
    deviation: np.ndarray,
    memory: np.ndarray,
    where: Layout,
    ways: Ways,
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
            values,
            where,
            memory[row, 0],
            memory[row, 1],
            ways.minds[row],
            ways.shift[row],
            ways.pace[row],
            knows,
        )
