"""How to turn a car round that hardly moves and faces away from its way."""

from __future__ import annotations

import math

from nathlon.sim.kernel import inlined

OVERHANG_M = 2.5
"""How much nearer the walls a car's corners are than its middle."""
SLACK_M, LACKING_M = 1.0, 3.0
"""By how much the room may fall short of what the long way round needs, and the short way: a turn that has
begun goes on."""
AHEAD_M, BEHIND_M = 1.0, 1.0
"""Room ahead below which a driver backs out, and room behind that it needs for that."""
AGAIN_M, LEAST_M = 8.0, 0.5
"""Room ahead at which it has backed enough, and room behind at which it must have."""
BACKING_M_S = -0.5


@inlined
def backs_out(velocity: float, turned: float, left: float, right: float) -> bool:
    """Whether to drive back, away from the wall that the car faces.

    Args:
        velocity: forward, m/s.
        turned: angle of the car to the line, rad, in -pi..pi.
        left, right: room that its corners have there, m.
    """
    slope = max(abs(math.sin(turned)), 0.1)
    ahead, behind = (left, right) if turned > 0.0 else (right, left)
    if velocity < BACKING_M_S:
        return ahead < AGAIN_M * slope and behind > LEAST_M * slope
    return ahead < AHEAD_M * slope and behind > BEHIND_M * slope


@inlined
def turn_round(turned: float, left: float, right: float, radius: float) -> float:
    """How to steer to face the way of the race again, at walking pace: 1 is full lock to the left.

    A turn to the right leads to the left by radius (1 - cos(turned)), and by as much as radius
    (1 + cos(turned)) to the right on its way if the car faces right. Where neither way round has the room, it
    is the short one, with a wall on the way to back away from.

    Args:
        turned: angle of the car to the line, rad, in -pi..pi.
        left, right: room that its corners have there, m.
        radius: of the turn, m.
    """
    across, back = radius * (1.0 - math.cos(turned)), radius * (1.0 + math.cos(turned))
    if turned > 0.0:
        short, long = left - across, min(right - across, left - back)
    else:
        short, long = right - across, min(left - across, right - back)
    way = -math.copysign(1.0, turned)
    return -way if short < -LACKING_M and long > -SLACK_M else way
