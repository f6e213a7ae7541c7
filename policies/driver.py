"""The built-in driver: follows a line at the speeds that the car's own limits allow.

It sees what every policy sees, through an observation spec of its own with few course points; its
map of the circuit and its knowledge of the car come with it.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from policies.driving import Knowledge, drive, layout
from policies.envelope import envelope
from policies.policy import Batch
from policies.racing_line import minimum_time, room
from policies.speed_profile import Profile, profile
from policies.steering import plan
from sim.car import load_car
from sim.observation import ObservationSpec
from sim.physics.chassis import AIR_DENSITY
from sim.track import TANGENT_X, TANGENT_Y, X, Y, load_track

GRIP = 0.97
"""Share of the quasi-steady envelope that the driver can hold at ten decisions a second."""


@lru_cache
def _profile(circuit: str, car: str, lane_m: float | None) -> Profile:
    track, limits = load_track(circuit), envelope(load_car(car))
    if lane_m is None:
        line = minimum_time(track, limits, GRIP)
    else:
        left, right = room(track)
        line = np.clip(lane_m, -right, left)
    return profile(track, line, limits, GRIP)


def _knowledge(circuit: str, car: str, line: Profile, pace: float) -> Knowledge:
    track, model = load_track(circuit), load_car(car)
    left, right = room(track)
    body = model.body
    return Knowledge(
        offset=line.offset,
        heading=line.heading,
        speed=line.speed,
        x=track.table[:, X].copy(),
        y=track.table[:, Y].copy(),
        direction=np.unwrap(np.arctan2(track.table[:, TANGENT_Y], track.table[:, TANGENT_X])),
        left=left,
        right=right,
        path=line.path,
        steering=plan(line, model, envelope(model), pace),
        limits=envelope(model),
        most_brake=model.brakes.torque_n_m / model.wheel.radius_m / body.mass_kg,
        length=track.length,
        spacing=track.spacing,
        a=body.front_axle_m,
        b=body.rear_axle_m,
        full_lock=model.steering.full_lock_rad,
        peak_slip=model.tyre.peak_slip_angle_rad[1],
        downforce=0.5 * AIR_DENSITY * model.aero.downforce_area_m2 / body.mass_kg,
        draught_loss=model.aero.draught_downforce_share,
        car_length=body.length_m,
        car_width=body.width_m,
    )


class Driver:
    """A policy with a map.

    Args:
        circuit: name of the circuit.
        car: name of the car.
        pace: share of the speed that the car allows; 1 is all of it.
        lane_m: hold this lateral offset (m, + is left) instead of the racing line.

    Its memory is two numbers a car: how far it has moved off its line (m, + is left), and how fast it
    moves (m/s).
    """

    def __init__(self, circuit: str, car: str, pace: float = 1.0, lane_m: float | None = None) -> None:
        self.observation_spec = ObservationSpec(course_points=1)
        self.pace = pace
        self._line = _profile(circuit, car, lane_m)
        self._knowledge = _knowledge(circuit, car, self._line, pace)
        self._layout = layout(self.observation_spec)
        self._mean, self._deviation = (part.astype(np.float64) for part in self.observation_spec.scaling)

    @property
    def lap_s(self) -> float:
        """Lap time of the speed profile, s, at the driver's pace."""
        return self._line.lap_s / self.pace

    def initial_memory(self, n: int) -> Batch:
        """See `Policy.initial_memory`."""
        return np.zeros((n, 2), np.float32)

    def act(self, observations: Batch, memory: Batch) -> tuple[Batch, Batch]:
        """See `Policy.act`."""
        actions = np.empty((len(observations), 2), np.float32)
        remembered = np.empty((len(observations), 2), np.float32)
        drive(
            observations,
            self._mean,
            self._deviation,
            memory,
            self._layout,
            self.pace,
            self._knowledge,
            actions,
            remembered,
        )
        return actions, remembered
