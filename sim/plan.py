"""A driver's plan of a lap: the line and the speeds that a policy may see ahead of it.

The simulator makes no plans, it shows those that it is given; see `nathlon.policies.driver.shown_plan`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

COLUMNS = 8
X, Y, OFFSET, DIRECTION, CURVATURE, SPEED, STEERING, SIDESLIP = range(COLUMNS)
"""Of the table: the line's place on the map, m; its lateral offset, m, + is left; its direction on the map,
rad, without jumps; its curvature, 1/m; and at each place the speed, m/s, the angle of the front wheels as a
share of full lock, and the sideslip, rad, with which a driver is there."""

UNPLANNED: NDArray[np.float64] = np.zeros((0, COLUMNS))
"""The table of nobody's plan."""


@dataclass(frozen=True, eq=False)
class Plan:
    """What a driver means to do on a circuit, in one car under some conditions.

    Attributes:
        table: (rows + 1, COLUMNS) float64, a row for each of the track's table, and the first one again a lap
            later, with the direction that it has then.
    """

    table: NDArray[np.float64]

    @classmethod
    def of_lap(cls, lap: NDArray[np.float64]) -> Plan:
        """The plan of a lap's rows, (rows, COLUMNS), whose directions may jump by whole turns."""
        table = np.concatenate([lap, lap[:1]])
        table[:, DIRECTION] = np.unwrap(table[:, DIRECTION])
        return cls(table)
