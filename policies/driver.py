"""The built-in driver: follows a line at the speeds that the car's own limits allow.

It sees what every policy sees, through an observation spec of its own with few course points; its
map of the circuit and its knowledge of the car come with it.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from policies.policy import Batch
from policies.racing_line import SPEEDS, Profile, envelope, minimum_curvature, profile, understeer
from sim.car import Car, load_car
from sim.observation import OPPONENT, ObservationSpec
from sim.track import LEFT, RIGHT, Track, load_track
from sim.world import AGENT_DT

EDGE_MARGIN_M = 1.15
"""From the edge to the racing line: half a car."""
GRIP = 0.97
"""Share of the quasi-steady envelope that the driver can hold at ten decisions a second."""
ACTUATION_S = 0.06
"""From the observation to the middle of the time in which its action works."""
YAW_DAMPING = 2.5
"""Steering against the yaw rate that the line does not ask for, m: gain times speed."""
PASSING_GAP_M = 2.6
"""Lateral distance between centres at which two cars pass each other safely."""


@lru_cache
def _racing_profile(circuit: str, car: str, grip: float) -> Profile:
    track, model = load_track(circuit), load_car(car)
    return profile(track, model, minimum_curvature(track, EDGE_MARGIN_M), grip)


@lru_cache
def _lane_profile(circuit: str, car: str, grip: float, lane_m: float) -> Profile:
    track, model = load_track(circuit), load_car(car)
    lane = np.clip(lane_m, EDGE_MARGIN_M - track.table[:, RIGHT], track.table[:, LEFT] - EDGE_MARGIN_M)
    return profile(track, model, lane, grip)


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
        self.lane_m = lane_m
        self._track: Track = load_track(circuit)
        self._car: Car = load_car(car)
        if lane_m is None:
            self._profile = _racing_profile(circuit, car, GRIP)
        else:
            self._profile = _lane_profile(circuit, car, GRIP, lane_m)

    @property
    def lap_s(self) -> float:
        """Lap time of the speed profile, s, before the driver's pace."""
        return self._profile.lap_s / self.pace

    def initial_memory(self, n: int) -> Batch:
        """See `Policy.initial_memory`."""
        return np.zeros((n, 1), np.float32)

    def act(self, observations: Batch, memory: Batch) -> tuple[Batch, Batch]:
        """See `Policy.act`."""
        spec = self.observation_spec
        mean, deviation = spec.scaling
        raw = observations.astype(np.float64) * deviation + mean

        def field(name: str) -> NDArray[np.float64]:
            return raw[:, spec.slice(name)]

        velocity, sideways = field("velocity").T
        heading = field("heading_error")[:, 0]
        foot = field("course_centre")
        lateral = -(foot[:, 0] * np.sin(heading) + foot[:, 1] * np.cos(heading))
        sine, cosine = field("progress").T
        distance = np.arctan2(sine, cosine) / (2 * np.pi) * self._track.length

        course = (
            heading + np.arctan2(sideways, np.maximum(velocity, 1.0)) + ACTUATION_S * field("yaw_rate")[:, 0]
        )
        aside, limit = self._mind_others(field("cars_ahead"), field("cars_behind"), velocity)
        here = distance + velocity * ACTUATION_S
        aside = self._keep_in(here, memory[:, 0] + np.clip(aside - memory[:, 0], -0.35, 0.35))
        actions = np.empty((len(raw), 2), np.float32)
        rear_slip = np.abs(field("slip_angle")[:, 2:]).mean(axis=1)
        ease = np.clip(2.0 - rear_slip / self._car.tyre.peak_slip_angle_rad[1], 0.1, 1.0)
        actions[:, 0] = self._pedals(here, velocity, limit) * ease
        actions[:, 1] = self._steering(
            here,
            velocity,
            lateral + velocity * ACTUATION_S * np.sin(course) - aside,
            course,
            field("yaw_rate")[:, 0],
        )
        return np.clip(actions, -1.0, 1.0), aside[:, None].astype(np.float32)

    def _at(self, table: NDArray[np.float64], distance: NDArray[np.float64]) -> NDArray[np.float64]:
        rows = distance / self._track.spacing
        low = np.floor(rows).astype(np.int64)
        share = rows - low
        return table[low % len(table)] * (1.0 - share) + table[(low + 1) % len(table)] * share

    def _keep_in(self, distance: NDArray[np.float64], aside: NDArray[np.float64]) -> NDArray[np.float64]:
        """Limit a move off the line so that the car stays between the edges."""
        line = self._at(self._profile.offset, distance)
        left = self._at(self._track.table[:, LEFT], distance) - EDGE_MARGIN_M
        right = self._at(self._track.table[:, RIGHT], distance) - EDGE_MARGIN_M
        return np.clip(line + aside, -right, left) - line

    def _steering(
        self,
        distance: NDArray[np.float64],
        velocity: NDArray[np.float64],
        error: NDArray[np.float64],
        course: NDArray[np.float64],
        yaw_rate: NDArray[np.float64],
    ) -> NDArray[np.float64]:
        """Steering, share of full lock: feed-forward of the line's curvature and its understeer,
        feedback of lateral and heading error with the dynamics of a damped spring over distance."""
        reach = np.maximum(8.0, 0.5 * velocity)
        error = error - self._at(self._profile.offset, distance)
        turned = course - self._at(self._profile.heading, distance)
        ahead = distance + np.maximum(velocity, 5.0) * 0.05
        curvature = self._at(self._profile.curvature, ahead) - error / reach**2 - 1.6 * turned / reach
        most = np.interp(velocity, SPEEDS, envelope(self._car).corner) / np.maximum(velocity, 5.0) ** 2
        curvature = np.clip(curvature, -most, most)
        body = self._car.body
        angle = (body.front_axle_m + body.rear_axle_m) * curvature
        angle += understeer(self._car, velocity, curvature)
        angle += YAW_DAMPING / np.maximum(velocity, 10.0) * (curvature * velocity - yaw_rate)
        return angle / self._car.steering.full_lock_rad

    def _pedals(
        self, distance: NDArray[np.float64], velocity: NDArray[np.float64], limit: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Throttle (+) or brake (-) that meets the profile's speed at the end of the action."""
        moved = distance + np.maximum(velocity, 3.0) * AGENT_DT
        target = np.minimum(self._at(self._profile.speed, moved) * self.pace, limit)
        wanted = (target - velocity) / AGENT_DT
        limits = envelope(self._car)
        drag = np.interp(velocity, SPEEDS, limits.drag)
        throttle = (wanted + drag) / np.interp(velocity, SPEEDS, limits.power)
        brake = (wanted + drag) / np.interp(velocity, SPEEDS, limits.brake[:, 0])
        return np.where(throttle >= 0.0, throttle, brake)

    def _mind_others(
        self, ahead: NDArray[np.float64], behind: NDArray[np.float64], velocity: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Where to move (m, + is left) and how fast to go at most (m/s) because of other cars.

        A slower car ahead is passed on the side that has more room; until the cars are beside each
        other's paths the driver keeps a speed from which it can still slow down. A car alongside is
        given room.
        """
        length, width = self._car.body.length_m, self._car.body.width_m
        aside = np.zeros(len(velocity))
        limit = np.full(len(velocity), np.inf)
        size = len(OPPONENT)
        for group in (ahead, behind):
            for k in range(group.shape[1] // size - 1, -1, -1):
                present, x, y, closing = group[:, k * size : k * size + 4].T
                gap = x - length
                beside = (present > 0.5) & (np.abs(x) < length + 1.0) & (np.abs(y) < PASSING_GAP_M + 0.4)
                aside = np.where(beside, aside - np.sign(y) * (PASSING_GAP_M + 0.4 - np.abs(y)), aside)
                if group is behind:
                    continue
                near = (present > 0.5) & (x > 0) & (gap < np.maximum(8.0, -closing * 2.5))
                move = np.where(y > 0, y - PASSING_GAP_M, y + PASSING_GAP_M)
                aside = np.where(near & ~beside & (np.abs(y) < PASSING_GAP_M), move, aside)
                blocked = (present > 0.5) & (gap > -1.0) & (np.abs(y) < width + 0.25)
                safe = velocity + closing + np.sqrt(2 * 4.0 * np.maximum(gap - 1.0, 0.0)) - 0.5
                limit = np.where(blocked, np.minimum(limit, np.maximum(safe, 3.0)), limit)
        return aside, limit
