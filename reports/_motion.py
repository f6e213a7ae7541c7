"""Where cars are between two samples of a race's log."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from arena.race_log import RaceLog

POSE = ("x_m", "y_m", "z_m", "yaw_rad", "pitch_rad", "roll_rad")


def poses(log: RaceLog, time_s: NDArray[np.float64]) -> dict[str, NDArray[np.float64]]:
    """The fields of POSE at these times, (n, C) each; a yaw does not jump by whole turns."""
    found = {}
    for name in POSE:
        columns = np.unwrap(log.samples[name], axis=0) if name == "yaw_rad" else log.samples[name]
        found[name] = np.stack([np.interp(time_s, log.time_s, column) for column in columns.T], axis=1)
    return found
