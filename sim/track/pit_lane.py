"""Where the pit lane of a circuit lies."""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from nathlon.sim.data_file import Section

Place = Annotated[float, Field(ge=0, le=1e6)]

LONGEST_M, LONGEST_SHARE = 500.0, 0.2
"""Length of a pit lane that is laid out, and share of the lap, at most."""
BEFORE_SHARE = 0.25
"""Share of the lap before the line in which one that is laid out may end."""


class PitLane(Section):
    """A lane beside the road, left and entered at lines across it.

    Attributes:
        side: of the road, seen in driving direction.
        entry_m: of the entry line along the lap, m.
        exit_m: of the exit line; before the entry where the lane passes the start and finish line.
        speed_m_s: limit between them.
    """

    side: Literal["left", "right"]
    entry_m: Place
    exit_m: Place
    speed_m_s: Annotated[float, Field(ge=5, le=60)] = 22.22

    def length(self, lap_m: float) -> float:
        """Length of the lane, m, on a lap of `lap_m`."""
        return float((self.exit_m - self.entry_m) % lap_m)


def laid_out(
    curvature: NDArray[np.float64], left: NDArray[np.float64], right: NDArray[np.float64], spacing: float
) -> PitLane:
    """A pit lane where a circuit's file has none: the straightest stretch at the line or before it.

    Args:
        curvature: (n,) of the centre line, 1/m.
        left, right: (n,) room between centre line and walls, m.
        spacing: of the rows, m.
    """
    rows = len(curvature)
    window = max(int(min(LONGEST_M / spacing, LONGEST_SHARE * rows)), 1)
    bends = np.abs(np.concatenate([curvature, curvature[:window]]))
    gathered = np.concatenate([[0.0], np.cumsum(bends)])
    bent = gathered[window : window + rows] - gathered[:rows]
    begins = np.arange(-int(BEFORE_SHARE * rows) - window, 0) % rows
    begin = int(begins[np.argmin(bent[begins])])
    inside = (begin + np.arange(window)) % rows
    return PitLane(
        side="left" if left[inside].sum() > right[inside].sum() else "right",
        entry_m=begin * spacing,
        exit_m=((begin + window) % rows) * spacing,
    )
