"""A strategist of your own, which answers when somebody behind tries to get past by an earlier stop.

A composite beside this file has it stop the cars of any policy:

    name = "champion that covers"
    strategist = "strategist.py:Cover"

    [[part]]
    policy = "lindenring-mend-059k.safetensors"
"""

from __future__ import annotations

import numpy as np

from nathlon.policies.strategy import PitWall
from nathlon.sim.service import Service

WORN = 0.8
"""It stops at this wear in any case; 1 is worn out."""
USED = 0.3
"""It covers a stop of others from this wear on."""
NEAR_S = 45.0
"""Who has stopped and is behind by no more than a stop takes is a threat."""


class Cover:
    """Starts with a full tank, and fills up when it stops."""

    def __init__(self, circuit: str, car: str) -> None:
        """Any circuit, any car."""

    def start(self, wall: PitWall) -> Service:
        """The harder tyres last until others have stopped."""
        return Service("racing-hard", wall.tank_kg)

    def decide(self, wall: PitWall) -> Service | None:
        """Asked whenever the car begins a lap; None drives on."""
        worn = float(wall.wear.max())
        behind_s = wall.gap_s - wall.gap_s[wall.car]
        stopped = wall.stops > wall.stops[wall.car]
        threatened = bool(np.any(stopped & (behind_s > 0.0) & (behind_s < NEAR_S)))
        if wall.last_lap or not (worn > WORN or (threatened and worn > USED)):
            return None
        return Service("racing-medium", wall.tank_kg)
