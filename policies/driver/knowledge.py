"""What the built-in driver knows of circuit and car, and where it finds what it sees."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from nathlon.policies.driver.envelope import Envelope
from nathlon.policies.driver.speed_profile import Path
from nathlon.policies.driver.steering import Steering
from nathlon.policies.temper import Temper
from nathlon.sim.kernel import inlined
from nathlon.sim.observation import ObservationSpec


class Layout(NamedTuple):
    """Where the fields that the driver reads stand in its observation."""

    velocity: int
    yaw_rate: int
    slip_angle: int
    slipstream: int
    wear: int
    progress: int
    heading: int
    course: int
    ahead: int
    behind: int
    cars_ahead: int
    cars_behind: int


def layout(spec: ObservationSpec) -> Layout:
    """The layout of a spec with cars ahead and behind."""
    fields = (
        "velocity",
        "yaw_rate",
        "slip_angle",
        "slipstream",
        "tyre_wear",
        "progress",
        "heading_error",
        "course",
    )
    starts = [spec.start(name) for name in (*fields, "cars_ahead", "cars_behind")]
    return Layout._make((*starts, spec.cars_ahead, spec.cars_behind))


class Ways(NamedTuple):
    """How drivers go on, (n,) each.

    Attributes:
        minds: whether they mind others and drive where those leave them room.
        shift: m to the left of the line, where they drive otherwise.
        pace: share of the profile's speed to drive.
    """

    minds: NDArray[np.bool_]
    shift: NDArray[np.float64]
    pace: NDArray[np.float64]


def minding(n: int, pace: float) -> Ways:
    """The way of n drivers who mind others."""
    return Ways(np.ones(n, np.bool_), np.zeros(n), np.full(n, pace))


class Knowledge(NamedTuple):
    """What the driver knows of circuit and car; the arrays are (rows of the track table,)."""

    offset: NDArray[np.float64]
    heading: NDArray[np.float64]
    speed: NDArray[np.float64]  # alone on the line
    careful: NDArray[np.float64]  # among others, or off the line
    bend: NDArray[np.float64]  # curvature that a metre to the left of the line adds, 1/m^2
    x: NDArray[np.float64]  # of the centre line, m, and its direction, rad
    y: NDArray[np.float64]
    direction: NDArray[np.float64]
    left: NDArray[np.float64]  # room beside it for a move off the line
    right: NDArray[np.float64]
    wall_left: NDArray[np.float64]  # from the centre line to the walls
    wall_right: NDArray[np.float64]
    path: Path
    steering: Steering
    limits: Envelope
    most_brake: float  # m/s^2 at full pedal, by the brakes alone
    length: float
    spacing: float
    a: float  # centre of mass to the axles
    b: float
    full_lock: float
    turning_circle: float  # radius of the way round at walking pace
    peak_slip: float
    downforce: float  # m/s^2 for each (m/s)^2
    draught_loss: float  # share of it lost in full slipstream
    car_length: float
    car_width: float
    temper: Temper
    remembers: bool  # how far it has moved off its line, and how fast; else it goes by where it is


@inlined
def along(table: np.ndarray, distance: float, spacing: float) -> float:
    """A table of the lap at a distance, m, from the line."""
    at = distance / spacing
    low = math.floor(at)
    share = at - low
    rows = len(table)
    return table[int(low) % rows] * (1.0 - share) + table[(int(low) + 1) % rows] * share


@inlined
def clip(value: float, low: float, high: float) -> float:
    """The nearest number in [low, high]."""
    return min(max(value, low), high)
