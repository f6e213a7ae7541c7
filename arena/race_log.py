"""One race as it happened, at 10 Hz or more: what recordings hold and replays show."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from nathlon.sim.camera_spec import CameraSpec

CAR_SAMPLE = np.dtype(
    [
        ("x_m", "f8"),  # world frame, x east, y north, z up
        ("y_m", "f8"),
        ("z_m", "f8"),  # of the road under the car
        ("yaw_rad", "f8"),  # counter-clockwise from x
        ("pitch_rad", "f4"),  # of the road under the car, + is nose down
        ("roll_rad", "f4"),  # likewise, + is left side up
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
        ("penalty_s", "f4"),  # still to serve
        ("off_course", "?"),  # these three at any time since the last sample
        ("wall_contact", "?"),
        ("car_contact", "?"),
        ("slipstream", "f4"),  # share of full draught
        ("driving", "?"),  # false after the car's ending
    ]
)

RESOLUTION: dict[str, float] = {
    **dict.fromkeys(("x_m", "y_m", "z_m", "lateral_m"), 2.0**-10),
    **dict.fromkeys(("yaw_rad", "pitch_rad", "roll_rad"), 2.0**-16),
    **dict.fromkeys(("velocity_x_m_s", "velocity_y_m_s"), 2.0**-10),
    **dict.fromkeys(("acceleration_x_m_s2", "acceleration_y_m_s2"), 2.0**-8),
    **dict.fromkeys(("throttle", "brake", "slipstream"), 2.0**-10),
    "yaw_rate_rad_s": 2.0**-14,
    "steering": 2.0**-14,
}
"""To what fields of CAR_SAMPLE are rounded where a race is recorded: beyond it there is nothing to see, and
files are twice as large. The steps are powers of two, so that what is rounded is exact."""

KINDS = ("contact", "wall", "off_course", "penalty", "served", "ending")
"""Of incidents."""
NOTICES = ("served", "ending")
"""Kinds of incidents that are news, not offences."""


def start_number(car: int) -> int:
    """What is painted on a car: people count from 1, files and code from 0."""
    return car + 1


def numbered(names: Iterable[str]) -> list[str]:
    """Start number and name of each car, in the order of the cars."""
    return [f"{start_number(car)} {name}" for car, name in enumerate(names)]


@dataclass(frozen=True)
class Incident:
    """Something that a steward would look at."""

    time_s: float
    kind: str  # one of KINDS
    cars: tuple[int, ...]  # indices of the cars concerned
    text: str  # one sentence for a person
    fault: int = -1  # index of the car to blame for a contact; -1 for nobody
    closing_m_s: float = 0.0  # at which two cars met
    penalty_s: float = 0.0  # given for it


@dataclass(frozen=True)
class NamedStretch:
    """A part of the lap that has a name, in metres along the centre line."""

    name: str
    kind: str  # corner, chicane, straight
    start_m: float
    end_m: float


@dataclass(frozen=True, eq=False)
class Outline:
    """The circuit as closed polylines in the world frame, row beside row, each (n, 3) float64, metres.

    The kerb lines are the outer edges of the kerbs; where there is no kerb they run on the road's edges.
    The run-off between there and the walls is (n,) int64, indices of `nathlon.sim.track.SURFACES`; `zone` is
    (n,) bool, true where penalties are served; `lane` is (n,) int64, 1 where the pit lane lies left of the
    road, -1 where it lies right of it, and 0 elsewhere.
    """

    left: NDArray[np.float64]
    centre: NDArray[np.float64]
    right: NDArray[np.float64]
    kerb_left: NDArray[np.float64]
    kerb_right: NDArray[np.float64]
    wall_left: NDArray[np.float64]
    wall_right: NDArray[np.float64]
    runoff_left: NDArray[np.int64]
    runoff_right: NDArray[np.int64]
    zone: NDArray[np.bool_]
    lane: NDArray[np.int64]


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
    sections: tuple[NamedStretch, ...]
    time_s: NDArray[np.float64]  # (T,)
    samples: NDArray[np.void]  # (T, C) CAR_SAMPLE
    incidents: tuple[Incident, ...]
    cameras: tuple[CameraSpec | None, ...] = ()  # by which the C cars' drivers saw; empty where nobody did


def orientation(
    yaw: NDArray[np.floating], pitch: NDArray[np.floating], roll: NDArray[np.floating]
) -> NDArray[np.float64]:
    """Quaternions x, y, z, w, (..., 4), that turn the world's axes into those of cars with these angles, rad.

    Yaw first, then pitch, then roll, each about the axes as turned so far (Diebel, Representing attitude,
    2006).
    """
    halves = [np.asarray(angle, np.float64) / 2 for angle in (yaw, pitch, roll)]
    (cos_yaw, cos_pitch, cos_roll), (sin_yaw, sin_pitch, sin_roll) = map(np.cos, halves), map(np.sin, halves)
    return np.stack(
        [
            sin_roll * cos_pitch * cos_yaw - cos_roll * sin_pitch * sin_yaw,
            cos_roll * sin_pitch * cos_yaw + sin_roll * cos_pitch * sin_yaw,
            cos_roll * cos_pitch * sin_yaw - sin_roll * sin_pitch * cos_yaw,
            cos_roll * cos_pitch * cos_yaw + sin_roll * sin_pitch * sin_yaw,
        ],
        axis=-1,
    )


def lap_length(outline: Outline) -> float:
    """Length of the centre line on the map, m."""
    return float(_along(outline)[-1])


def origin(log: RaceLog) -> float:
    """Where on the lap `progress` starts from 0: m beyond the line, negative before it.

    It is where the car stood that was first in the first sample.
    """
    starts, lap_m = _starts(log), lap_length(log.outline)
    first = float(starts[np.argmin(log.samples[0]["place"])]) if len(starts) else 0.0
    return first - lap_m * round(first / lap_m)


def progress(log: RaceLog) -> NDArray[np.float64]:
    """How far each car has come along the centre line, (T, C), metres, so that any two can be compared.

    The car that is first in the first sample starts from 0, the others from behind or ahead of it.
    """
    distance = log.samples["distance_m"]
    if not len(distance):
        return distance
    lap_m = lap_length(log.outline)
    start = _starts(log) - origin(log)
    start -= lap_m * np.round(start / lap_m)
    return np.asarray(distance - distance[0] + start)


def _along(outline: Outline) -> NDArray[np.float64]:
    """From the first row of the outline to the row after each, m."""
    centre = outline.centre[:, :2]
    return np.cumsum(np.linalg.norm(np.diff(centre, axis=0, append=centre[:1]), axis=1))


def _starts(log: RaceLog) -> NDArray[np.float64]:
    """Where on the lap each car stands in the first sample, (C,) metres; empty without samples."""
    if not len(log.samples):
        return np.zeros(0)
    centre, first, along = log.outline.centre[:, :2], log.samples[0], _along(log.outline)
    ahead = np.roll(centre, -1, axis=0) - centre
    offset = np.stack([first["x_m"], first["y_m"]], axis=1)[:, None] - centre
    row = np.argmin((offset**2).sum(axis=2), axis=1)
    beyond = (offset[np.arange(len(row)), row] * ahead[row]).sum(axis=1)
    return np.asarray(along[row - 1] * (row > 0) + beyond / np.linalg.norm(ahead[row], axis=1))
