"""The state of a world: cars and contacts as records, races as arrays of them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, NamedTuple, Protocol, TypeAlias, get_args, get_type_hints

import numpy as np
from numpy.typing import NDArray

FourWheels: TypeAlias = Annotated[NDArray[np.float64], 4]
"""Front left, front right, rear left, rear right."""
ThreeSectors: TypeAlias = Annotated[NDArray[np.float64], 3]
"""Of each sector, or of the timing line at which it begins."""


def record_dtype(fields: type) -> np.dtype[np.void]:
    """The record whose fields are the annotated attributes of a class, in their order.

    Kernels see the record, mypy the class.

    Args:
        fields: attributes are float, int, bool, or float64 arrays of as many numbers as `Annotated` says.
    """
    kinds = {float: "f8", int: "i8", bool: "?"}
    columns: list[tuple[str, str, int] | tuple[str, str]] = []
    for name, kind in get_type_hints(fields, include_extras=True).items():
        columns.append((name, kinds[kind]) if kind in kinds else (name, "f8", get_args(kind)[1]))
    return np.dtype(columns, align=True)


class CarRecord(Protocol):
    """One record of CAR_STATE, as kernels read and write it."""

    # Motion of the centre of mass on the map, world frame (x east, y north), m, rad, s.
    x: float
    y: float
    yaw: float
    world_velocity_x: float
    world_velocity_y: float
    yaw_rate: float
    cos_yaw: float  # kept beside the yaw, which is needed many times a step
    sin_yaw: float
    # The same in the car's frame, x forward, y left.
    velocity_x: float
    velocity_y: float
    acceleration_x: float
    acceleration_y: float
    # The road under the car: height, m; gradient in the car's frame; m/s^2 by which following
    # the road's shape lifts the car that goes straight on.
    z: float
    slope_x: float
    slope_y: float
    heave: float
    # Tyre forces over mass as the springs have carried them, m/s^2, for the load transfer.
    carried_x: float
    carried_y: float
    # Wheels: front left, front right, rear left, rear right.
    spin: FourWheels  # rad/s
    load: FourWheels  # N
    slip_ratio: FourWheels
    slip_angle: FourWheels  # rad
    wear: FourWheels  # 1 is worn out
    # Controls as applied.
    steering: float  # rad at the road wheels
    throttle: float
    brake: float
    asked_pedal: float  # the last action: throttle (+) or brake (-), steering, in [-1, 1]
    asked_steering: float
    gear: int  # 0 is first, -1 is reverse
    has_reverse: bool  # whether the box may go there
    held_s: float  # at rest with the brake held
    shifting: float  # s left of the torque cut
    draught: float  # share of full slipstream
    fuel: float  # kg
    mass: float  # kg, with fuel
    # Place on the circuit.
    row: int  # of the track table
    along: float  # m from there
    wraps: int  # times the row went over the line
    progress: float  # m along the centre line, not wrapped; 0 is the line
    lateral: float  # m left of the centre line
    heading_error: float  # rad, yaw minus the direction of the centre line
    # Flags of the last step, and what has gathered since the start.
    off_course: bool
    wall_contact: bool
    car_contact: bool
    off_course_s: float
    wall_s: float
    contacts: int
    contacts_faster_behind: int
    contacts_at_fault: int
    contact_s: float  # time of the last touch
    stationary_s: float  # since the car last moved
    # Before the stewards.
    out_s: float  # of the present excursion: time, way, progress at its start
    out_path: float
    out_from: float
    out_excused: bool
    warnings: int
    penalties: int
    penalty_s: float  # still to serve
    # Laps and sectors, timed by interpolating the crossing of their lines.
    start: float  # progress at the start, m
    laps: int
    line: int  # next timing line, counted from the line of lap 0
    line_s: ThreeSectors  # time of the last crossing of each line; nan before the first
    sector_s: ThreeSectors  # last time of each sector; nan before
    last_lap_s: float  # nan before a full lap
    best_lap_s: float
    finish: float  # progress at which the run is over, m
    finish_s: float  # nan until then; with the penalties not served
    driving: bool
    # Tyres as fitted, against those of the world's compound.
    tyre_grip: float
    tyre_wear: float
    tyre_film: float  # mm of water that they displace
    tyre_peak: float  # multiple of the slip at which they peak
    # Weather, see `nathlon.sim.weather`; set only in a world that has any.
    sky: int  # which of the weathers that may come has come
    film: float  # mm of water on the road
    wet_grip: float  # shares of the grip, and of the slip at its peak, that are left there
    wet_peak: float
    # In the pit lane, see `nathlon.sim.physics.pit_lane`.
    stage: int  # of a stop
    lane_m: float  # from the entry line
    lane_s: float  # in the lane since the start, s
    stood_s: float  # of this in the box
    service_s: float  # still to stand in the box
    clear_s: float  # since it came back to the road
    stops: int
    missed: int  # stops that were asked for, but the entry line crossed too fast
    # What was asked for, to be done at the next stop.
    asked: bool
    asked_tyres: bool
    asked_grip: float
    asked_wear: float
    asked_film: float
    asked_peak: float
    asked_fuel: float  # kg in the tank afterwards; no more than there is where it is less
    model: int  # of the car, among those of its world
    # Blue flags, see `nathlon.sim.blue_flags`.
    flagged_for: int  # index of the car that is about to lap it, or -1
    held_up_s: float  # for which it has held that one up
    hold_ups: int  # for which it was penalised
    pace: float  # share of its own speed at which it is to drive


Cars: TypeAlias = Sequence[CarRecord]
"""The cars of one race, as kernels see a row of a world's state."""

CAR_STATE = record_dtype(CarRecord)

REAR_END, SIDE_SWIPE, OTHER = range(3)
GEOMETRIES = ("rear_end", "side_swipe", "other")


class ContactRecord(Protocol):
    """One record of CONTACT, as kernels write it."""

    time: float  # s since the start of the race
    behind: int  # indices of the two cars by progress
    ahead: int
    x: float  # of the point of contact, world frame, m
    y: float
    closing: float  # m/s, along the normal of the contact
    relative_x: float  # velocity of the car behind less that of the car ahead, m/s,
    relative_y: float  # in the frame of the car ahead
    geometry: int  # index of GEOMETRIES
    faster: int  # index of the car that was
    fault: int  # index of the car whose fault the stewards find it, or -1
    section_behind: int  # sections of the circuit, or -1
    section_ahead: int
    penalty_s: float  # given for it


CONTACT = record_dtype(ContactRecord)
"""A contact of two cars at its beginning."""


class Races(NamedTuple):
    """All that changes in a step.

    Attributes:
        cars: (races, cars) CAR_STATE.
        ticks: (races,) int64, dynamics steps since each race's start.
        touched: (races, cars, cars) float64, when two cars touched last, s since the start; -inf for never.
        contacts: (races, pairs) CONTACT, those that began in the last step, oldest first.
        contact_count: (races,) int64, how many of them there are.
    """

    cars: np.ndarray
    ticks: np.ndarray
    touched: np.ndarray
    contacts: np.ndarray
    contact_count: np.ndarray


class RaceRows(NamedTuple):
    """Rows of the arrays of one of the races, whose own `ticks` and `contact_count` come first."""

    cars: Cars
    ticks: np.ndarray
    touched: np.ndarray
    contacts: Sequence[ContactRecord]
    contact_count: np.ndarray
