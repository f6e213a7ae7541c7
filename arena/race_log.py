"""One race as it happened, at the agent's rate: what recordings hold and replays show."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

CAR_SAMPLE = np.dtype(
    [
        ("x_m", "f8"),  # world frame, x east, y north
        ("y_m", "f8"),
        ("yaw_rad", "f8"),  # counter-clockwise from x
        ("velocity_x_m_s", "f4"),  # car frame, x forward, y left
        ("velocity_y_m_s", "f4"),
        ("yaw_rate_rad_s", "f4"),
        ("acceleration_x_m_s2", "f4"),
        ("acceleration_y_m_s2", "f4"),
        ("steering", "f4"),  # share of full lock, + is left
        ("throttle", "f4"),
        ("brake", "f4"),
        ("gear", "i4"),
        ("distance_m", "f8"),  # along the centre line since the start
        ("lateral_m", "f4"),  # from the centre line, + is left
        ("lap", "i4"),  # laps completed
        ("place", "i4"),
        ("off_course", "?"),
        ("wall_contact", "?"),
        ("car_contact", "?"),
        ("slipstream", "f4"),  # share of full draught
        ("driving", "?"),  # false after the car's ending
    ]
)


@dataclass(frozen=True)
class Incident:
    """Something that a steward would look at."""

    time_s: float
    kind: str  # contact, wall, off_course, ending
    cars: tuple[int, ...]  # indices of the cars concerned
    text: str  # one sentence for a person


@dataclass(frozen=True)
class Outline:
    """The circuit as closed polylines in the world frame, each (n, 2) float64, metres."""

    left: NDArray[np.float64]
    centre: NDArray[np.float64]
    right: NDArray[np.float64]
    wall_left: NDArray[np.float64]
    wall_right: NDArray[np.float64]


@dataclass(frozen=True)
class RaceLog:
    """A race with T samples of C cars."""

    circuit: str
    car: str
    scenario: str
    seed: int
    match: str
    race: int
    version: str
    names: tuple[str, ...]  # of the C cars' entrants
    teams: tuple[int, ...]  # 0, 1 or -1
    car_length_m: float
    car_width_m: float
    outline: Outline
    time_s: NDArray[np.float64]  # (T,)
    samples: NDArray[np.void]  # (T, C) CAR_SAMPLE
    incidents: tuple[Incident, ...]
