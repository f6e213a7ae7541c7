"""How to turn a car round that hardly moves and faces away from its way."""

from __future__ import annotations

import math

from nathlon.policies.driver.knowledge import clip
from nathlon.sim.kernel import inlined

OVERHANG_M = 2.5
"""How much nearer the walls a car's corners are than its middle."""
FACING_BACK_RAD = 2.4
"""Beyond this angle to the line a driver without room to turn draws nearer to one side first."""
DRAWING_NEARER_RAD = 0.4
SLACK_M = 1.0
"""Spare room of a turn that begins. It goes on with as much too little, once half done with thrice."""


@inlined
def turn_round(turned: float, left: float, right: float, radius: float) -> float:
    """How to steer to face the way of the race again, at walking pace: 1 is full lock to the left.

    A turn to the right leads to the left by radius (1 - cos(turned)), and by as much as radius
    (1 + cos(turned)) to the right on its way if the car faces right.

    Args:
        turned: angle of the car to the line, rad, in -pi..pi.
        left, right: room that its corners have there, m.
        radius: of the turn, m.
    """
    across, back = radius * (1.0 - math.cos(turned)), radius * (1.0 + math.cos(turned))
    spare_left, spare_right = right - across, left - across  # of turns to the left and right
    if turned > 0.0:
        spare_left = min(spare_left, left - back)
    else:
        spare_right = min(spare_right, right - back)
    short, long = (spare_right, spare_left) if turned > 0.0 else (spare_left, spare_right)
    nearer = math.copysign(math.pi - DRAWING_NEARER_RAD, right - left)
    wanted = math.copysign(SLACK_M, nearer * turned)
    if max(short, long) < wanted and abs(turned) > FACING_BACK_RAD and min(left, right) > 0.0:
        return clip(2.0 * math.sin(nearer - turned), -1.0, 1.0)
    way = -math.copysign(1.0, turned)
    return way if short >= min(long, -3.0 * SLACK_M) else -way
