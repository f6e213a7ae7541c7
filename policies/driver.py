"""The built-in driver: follows a line at the speeds that the car's own limits allow.

It sees what every policy sees, through an observation spec of its own with few course points; its
map of the circuit and its knowledge of the car come with it.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from policies.driving import EDGE_MARGIN_M, Knowledge, drive, layout
from policies.policy import Batch
from policies.racing_line import Profile, envelope, minimum_curvature, profile, understeer
from sim.car import load_car
from sim.observation import ObservationSpec
from sim.track import LEFT, RIGHT, load_track

GRIP = 0.97
"""Share of the quasi-steady envelope that the driver can hold at ten decisions a second."""


@lru_cache
def _profile(circuit: str, car: str, lane_m: float | None) -> Profile:
    track, model = load_track(circuit), load_car(car)
    if lane_m is None:
        line = minimum_curvature(track, EDGE_MARGIN_M)
    else:
        line = np.clip(lane_m, EDGE_MARGIN_M - track.table[:, RIGHT], track.table[:, LEFT] - EDGE_MARGIN_M)
    return profile(track, model, line, GRIP)


def _knowledge(circuit: str, car: str, line: Profile) -> Knowledge:
    track, model = load_track(circuit), load_car(car)
    limits = envelope(model)
    return Knowledge(
        offset=line.offset,
        heading=line.heading,
        curvature=line.curvature,
        speed=line.speed,
        left=track.table[:, LEFT].copy(),
        right=track.table[:, RIGHT].copy(),
        corner=limits.corner,
        power=limits.power,
        brake=limits.brake[:, 0].copy(),
        drag=limits.drag,
        understeer=understeer(model),
        length=track.length,
        spacing=track.spacing,
        wheelbase=model.body.front_axle_m + model.body.rear_axle_m,
        full_lock=model.steering.full_lock_rad,
        peak_slip=model.tyre.peak_slip_angle_rad[1],
        car_length=model.body.length_m,
        car_width=model.body.width_m,
    )


class Driver:
    """A policy with a map.

    Args:
        circuit: name of the circuit.
        car: name of the car.
        pace: share of the speed that the car allows; 1 is all of it.
        lane_m: hold this lateral offset (m, + is left) instead of the racing line.

    Its memory is one number a car: how far (m, + is left) it has moved off its line for others.
    """

    def __init__(self, circuit: str, car: str, pace: float = 1.0, lane_m: float | None = None) -> None:
        self.observation_spec = ObservationSpec(course_points=1)
        self.pace = pace
        self._line = _profile(circuit, car, lane_m)
        self._knowledge = _knowledge(circuit, car, self._line)
        self._layout = layout(self.observation_spec)
        self._mean, self._deviation = (part.astype(np.float64) for part in self.observation_spec.scaling)

    @property
    def lap_s(self) -> float:
        """Lap time of the speed profile, s, at the driver's pace."""
        return self._line.lap_s / self.pace

    def initial_memory(self, n: int) -> Batch:
        """See `Policy.initial_memory`."""
        return np.zeros((n, 1), np.float32)

    def act(self, observations: Batch, memory: Batch) -> tuple[Batch, Batch]:
        """See `Policy.act`."""
        actions = np.empty((len(observations), 2), np.float32)
        remembered = np.empty((len(observations), 1), np.float32)
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
