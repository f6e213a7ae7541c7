"""How cars move: where they are between two samples of a race's log, and how far apart in time."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from nathlon.arena.race_log import RaceLog, progress

POSE = ("x_m", "y_m", "z_m", "yaw_rad", "pitch_rad", "roll_rad")


def poses(log: RaceLog, time_s: NDArray[np.float64]) -> dict[str, NDArray[np.float64]]:
    """The fields of POSE at these times, (n, C) each; a yaw does not jump by whole turns."""
    found = {}
    for name in POSE:
        columns = np.unwrap(log.samples[name], axis=0) if name == "yaw_rad" else log.samples[name]
        found[name] = np.stack([np.interp(time_s, log.time_s, column) for column in columns.T], axis=1)
    return found


def gaps(log: RaceLog) -> NDArray[np.float64]:
    """Seconds since the first car was where each car is now, (T, C).

    NaN before a car has come to where the first one started, and once it no longer drives.
    """
    along_m = progress(log)
    if not len(along_m):
        return along_m
    first_m = np.maximum.accumulate(along_m.max(axis=1))
    gap_s = log.time_s[:, None] - np.interp(along_m, first_m, log.time_s)
    gap_s[along_m >= first_m[:, None]] = 0.0
    gap_s[(along_m < first_m[0]) | ~log.samples["driving"]] = np.nan
    return gap_s
