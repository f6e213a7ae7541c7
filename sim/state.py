"""The state of one car as a record; a world holds an array of them, (races, cars)."""

from typing import Any, TypeAlias

import numpy as np

CarRecord: TypeAlias = Any
"""One record of CAR_STATE: kernels read and write its fields as attributes, which types cannot say."""

CAR_STATE = np.dtype(
    [
        # Motion of the centre of mass on the map, world frame (x east, y north), m, rad, s.
        ("x", "f8"),
        ("y", "f8"),
        ("yaw", "f8"),
        ("world_velocity_x", "f8"),
        ("world_velocity_y", "f8"),
        ("yaw_rate", "f8"),
        ("cos_yaw", "f8"),  # kept beside the yaw, which is needed many times a step
        ("sin_yaw", "f8"),
        # The same in the car's frame, x forward, y left.
        ("velocity_x", "f8"),
        ("velocity_y", "f8"),
        ("acceleration_x", "f8"),
        ("acceleration_y", "f8"),
        # The road under the car: height, m; gradient in the car's frame; m/s^2 by which following
        # the road's shape lifts the car that goes straight on.
        ("z", "f8"),
        ("slope_x", "f8"),
        ("slope_y", "f8"),
        ("heave", "f8"),
        # Tyre forces over mass as the springs have carried them, m/s^2, for the load transfer.
        ("carried_x", "f8"),
        ("carried_y", "f8"),
        # Wheels: front left, front right, rear left, rear right.
        ("spin", "f8", 4),  # rad/s
        ("load", "f8", 4),  # N
        ("slip_ratio", "f8", 4),
        ("slip_angle", "f8", 4),  # rad
        ("wear", "f8", 4),  # 1 is worn out
        # Controls as applied.
        ("steering", "f8"),  # rad at the road wheels
        ("throttle", "f8"),
        ("brake", "f8"),
        ("gear", "i8"),  # 0 is first
        ("shifting", "f8"),  # s left of the torque cut
        ("draught", "f8"),  # share of full slipstream
        ("fuel", "f8"),  # kg
        ("mass", "f8"),  # kg, with fuel
        # Place on the circuit.
        ("row", "i8"),  # of the track table
        ("along", "f8"),  # m from there
        ("wraps", "i8"),  # times the row went over the line
        ("progress", "f8"),  # m along the centre line, not wrapped; 0 is the line
        ("lateral", "f8"),  # m left of the centre line
        ("heading_error", "f8"),  # rad, yaw minus the direction of the centre line
        # Flags of the last step, and what has gathered since the start.
        ("off_course", "?"),
        ("wall_contact", "?"),
        ("car_contact", "?"),
        ("off_course_s", "f8"),
        ("wall_s", "f8"),
        ("contacts", "i8"),
        ("contacts_faster_behind", "i8"),
        ("contacts_at_fault", "i8"),
        ("contact_s", "f8"),  # time of the last touch
        ("stationary_s", "f8"),  # since the car last moved
        # Before the stewards.
        ("out_s", "f8"),  # of the present excursion: time, way, progress at its start
        ("out_path", "f8"),
        ("out_from", "f8"),
        ("out_excused", "?"),
        ("warnings", "i8"),
        ("penalties", "i8"),
        ("penalty_s", "f8"),  # still to serve
        # Laps and sectors, timed by interpolating the crossing of their lines.
        ("start", "f8"),  # progress at the start, m
        ("laps", "i8"),
        ("line", "i8"),  # next timing line, counted from the line of lap 0
        ("line_s", "f8", 3),  # time of the last crossing of each line; nan before the first
        ("sector_s", "f8", 3),  # last time of each sector; nan before
        ("last_lap_s", "f8"),  # nan before a full lap
        ("best_lap_s", "f8"),
        ("finish", "f8"),  # progress at which the run is over, m
        ("finish_s", "f8"),  # nan until then; with the penalties not served
        ("driving", "?"),
    ],
    align=True,
)

REAR_END, SIDE_SWIPE, OTHER = range(3)
GEOMETRIES = ("rear_end", "side_swipe", "other")

CONTACT = np.dtype(
    [
        ("time", "f8"),  # s since the start of the race
        ("behind", "i8"),  # indices of the two cars by progress
        ("ahead", "i8"),
        ("x", "f8"),  # of the point of contact, world frame, m
        ("y", "f8"),
        ("closing", "f8"),  # m/s, along the normal of the contact
        ("relative_x", "f8"),  # velocity of the car behind less that of the car ahead, m/s,
        ("relative_y", "f8"),  # in the frame of the car ahead
        ("geometry", "i8"),  # index of GEOMETRIES
        ("faster", "i8"),  # index of the car that was
        ("fault", "i8"),  # index of the car whose fault the stewards find it, or -1
        ("section_behind", "i8"),  # sections of the circuit, or -1
        ("section_ahead", "i8"),
        ("penalty_s", "f8"),  # given for it
    ],
    align=True,
)
"""A contact of two cars at its beginning."""
