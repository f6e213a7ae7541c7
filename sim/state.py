"""The state of one car as a record; a world holds an array of them, (races, cars)."""

from typing import Any, TypeAlias

import numpy as np

CarRecord: TypeAlias = Any
"""One record of CAR_STATE: kernels read and write its fields as attributes, which types cannot say."""

CAR_STATE = np.dtype(
    [
        # Motion of the centre of mass, world frame (x east, y north), m, rad, s.
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
        # Accelerations as the springs have carried them, for the load transfer.
        ("carried_x", "f8"),
        ("carried_y", "f8"),
        # Wheels: front left, front right, rear left, rear right.
        ("spin", "f8", 4),  # rad/s
        ("load", "f8", 4),  # N
        ("slip_ratio", "f8", 4),
        ("slip_angle", "f8", 4),  # rad
        # Controls as applied.
        ("steering", "f8"),  # rad at the road wheels
        ("throttle", "f8"),
        ("brake", "f8"),
        ("gear", "i8"),  # 0 is first
        ("shifting", "f8"),  # s left of the torque cut
        ("draught", "f8"),  # share of full slipstream
        # Place on the circuit.
        ("row", "i8"),  # of the track table
        ("wraps", "i8"),  # times the row went over the line
        ("progress", "f8"),  # m along the centre line, not wrapped; 0 is the line
        ("lateral", "f8"),  # m left of the centre line
        ("heading_error", "f8"),  # rad, yaw minus the direction of the centre line
        # Flags of the last agent step, and what has gathered since the start.
        ("off_course", "?"),
        ("wall_contact", "?"),
        ("car_contact", "?"),
        ("off_course_s", "f8"),
        ("wall_s", "f8"),
        ("contacts", "i8"),
        ("contacts_faster_behind", "i8"),
        ("stationary_s", "f8"),  # since the car last moved
        # Laps, timed by interpolating the crossing of the line.
        ("start", "f8"),  # progress at the start, m
        ("laps", "i8"),
        ("line_s", "f8"),  # time of the last crossing; nan before the first
        ("last_lap_s", "f8"),  # nan before a full lap
        ("best_lap_s", "f8"),
        ("finish", "f8"),  # progress at which the run is over, m
        ("finish_s", "f8"),  # nan until then
        ("driving", "?"),
    ],
    align=True,
)
