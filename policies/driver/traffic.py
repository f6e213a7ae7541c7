"""How the built-in driver minds other cars: where they leave it room, and how fast it may go."""

from __future__ import annotations

import math

import numpy as np

from nathlon.policies.driver.knowledge import Knowledge, Layout, along, clip
from nathlon.sim.kernel import inlined
from nathlon.sim.observation import OPPONENT_SIZE, PRESENT, VELOCITY_X, VELOCITY_Y, X, Y

CLOSE_M = 10.0
"""A car ahead is passed when it is closer than this, or will be reached soon."""
BESIDE_M = 3.0
"""Cars whose gap along the road is less are beside each other, or soon will be."""
ALONE_M = 40.0
FADE_M = 20.0
BEHIND = 3.0
"""Care for others ends at the first distance, and is whole nearer by the second. A car behind counts as so
many times as far away."""


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
) -> tuple[float, float, float]:
    """Where to drive (m left of the centre line), how fast at most (m/s) and with what care (0 to 1).

    A car alongside is given room. A slower car ahead is passed on the nearer side that has room;
    until the cars are out of each other's paths the driver keeps a speed from which it can still
    slow down.

    Args:
        values: the observation in its own units.
        where: its layout.
        distance, lateral: of the car, m.
        line: lateral offset where it would be alone, m.
        left, right: room beside the centre line for a move off the line, m.
        knows: circuit and car.
    """
    velocity, sideways = values[where.velocity], values[where.velocity + 1]
    heading = values[where.heading]
    limit = math.inf
    low, high = min(-right, line), max(left, line)
    blocked_by, blocked_at, care = math.inf, 0.0, 0.0
    for place in range(where.cars_ahead + where.cars_behind):
        if place < where.cars_ahead:
            k = where.ahead + OPPONENT_SIZE * place
        else:
            k = where.behind + OPPONENT_SIZE * (place - where.cars_ahead)
        if values[k + PRESENT] < 0.5:
            continue
        ahead, there, turned = find(values[k + X], values[k + Y], distance, lateral, heading, knows)
        # Both follow the same line: what counts is how far each is off it.
        there += line - along(knows.offset, distance + ahead, knows.spacing)
        speed = (velocity + values[k + VELOCITY_X]) * math.cos(turned)
        speed += (sideways + values[k + VELOCITY_Y]) * math.sin(turned)
        gap = ahead - knows.car_length
        far = gap if ahead > 0.0 else -BEHIND * ahead
        care = max(care, clip((ALONE_M - far) / FADE_M, 0.0, 1.0))
        apart = there - lateral
        if abs(ahead) < knows.car_length + BESIDE_M and abs(apart) > 0.5 * knows.car_width:
            if apart > 0.0:
                high = min(high, there - knows.car_width - knows.temper.room_m)
            else:
                low = max(low, there + knows.car_width + knows.temper.room_m)
        elif (
            ahead > 0.0
            and gap < min(blocked_by, max(CLOSE_M, knows.temper.notice_s * (velocity - speed)))
            and (abs(there - line) < knows.temper.passing_m or abs(apart) < knows.temper.passing_m)
        ):
            blocked_by, blocked_at = gap, there
        if ahead > 0.0 and abs(apart) < knows.car_width + 0.3:
            safe = speed + math.sqrt(2.0 * knows.temper.braking * max(gap - knows.temper.least_m, 0.0)) - 0.5
            limit = min(limit, max(safe, 3.0))
    wish = line
    if blocked_by < math.inf:
        by_left, by_right = blocked_at + knows.temper.passing_m, blocked_at - knows.temper.passing_m
        if by_left > high and by_right < low:
            wish = lateral
        elif by_right < low or (by_left <= high and abs(by_left - lateral) < abs(by_right - lateral)):
            wish = max(line, by_left)
        else:
            wish = min(line, by_right)
    if low > high:
        return 0.5 * (low + high), limit, care
    return clip(wish, low, high), limit, care
