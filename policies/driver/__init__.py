"""The built-in driver: follows a line at the speeds that the car's own limits allow.

It sees what every policy sees, through an observation spec of its own with few course points; its
map of the circuit and its knowledge of the car come with it.
"""

from __future__ import annotations

from functools import lru_cache, partial

import numpy as np
from numpy.typing import NDArray

from nathlon.policies.driver.control import drive
from nathlon.policies.driver.disk_cache import cached
from nathlon.policies.driver.envelope import envelope
from nathlon.policies.driver.knowledge import Knowledge, Ways, layout, minding
from nathlon.policies.driver.margins import room, room_aside
from nathlon.policies.driver.practice import practise
from nathlon.policies.driver.racing_line import NoLine, minimum_time
from nathlon.policies.driver.speed_profile import Line, Profile, profile
from nathlon.policies.driver.steering import plan
from nathlon.policies.policy import Batch
from nathlon.policies.temper import FAIR, TEMPERS, Temper
from nathlon.sim.car import Car, load_car, with_grip
from nathlon.sim.errors import InputError
from nathlon.sim.observation import ObservationSpec
from nathlon.sim.physics.chassis import AIR_DENSITY
from nathlon.sim.track import TANGENT_X, TANGENT_Y, WALL_LEFT, WALL_RIGHT, Track, X, Y, load_track
from nathlon.sim.world import World

CARE = 0.9
"""Share of the grip found in practice that a driver uses among others and off its line."""
YIELDING = 0.85
"""Share of its pace at which it lets by who is about to lap it."""
ASIDE_M = 1.0
"""Its speeds there hold for a line moved so far to either side."""
TURNING_CIRCLE = 1.2
"""Radius of a turn at full lock, beside that of wheels that roll without slip."""
SLOWER = 0.8
"""Power of the grip with which speeds fall: 0.5 would do without downforce, which falls with the speed, and
if the driver knew beforehand how far to turn in on the tyres of the day."""


def _knowledge(
    track: Track, car: Car, pace: float, line: Profile, temper: Temper, care: float, remembers: bool
) -> Knowledge:
    left, right = room_aside(track)
    body, limits = car.body, envelope(car)
    wheelbase = body.front_axle_m + body.rear_axle_m
    asides = [
        profile(track, line.offset + aside, limits, care * line.grip) for aside in (-ASIDE_M, 0.0, ASIDE_M)
    ]
    return Knowledge(
        offset=line.offset,
        heading=line.heading,
        speed=line.speed,
        careful=np.min([aside.speed for aside in asides], axis=0),
        bend=(asides[2].path.curvature - asides[0].path.curvature) / (2.0 * ASIDE_M),
        x=track.table[:, X].copy(),
        y=track.table[:, Y].copy(),
        direction=np.unwrap(np.arctan2(track.table[:, TANGENT_Y], track.table[:, TANGENT_X])),
        left=left,
        right=right,
        wall_left=track.table[:, WALL_LEFT].copy(),
        wall_right=track.table[:, WALL_RIGHT].copy(),
        path=line.path,
        steering=plan(line, car, limits, pace),
        limits=limits,
        most_brake=car.brakes.torque_n_m / car.wheel.radius_m / body.mass_kg,
        length=track.length,
        spacing=track.spacing,
        a=body.front_axle_m,
        b=body.rear_axle_m,
        full_lock=car.steering.full_lock_rad,
        turning_circle=TURNING_CIRCLE * wheelbase / np.tan(car.steering.full_lock_rad),
        peak_slip=car.tyre.peak_slip_angle_rad[1],
        downforce=0.5 * AIR_DENSITY * car.aero.downforce_area_m2 / body.mass_kg,
        draught_loss=car.aero.draught_downforce_share,
        car_length=body.length_m,
        car_width=body.width_m,
        temper=temper,
        remembers=remembers,
    )


class Follower:
    """A policy that follows a speed profile, and minds others.

    Args:
        track: the circuit.
        car: the car.
        pace: share of the profile's speed to drive.
        line: the profile.
        temper: how near it comes to others.
        care: share of the grip found in practice that it uses among others and off its line.

    Its memory is two numbers a car: how far it has moved off its line (m, + is left), and how fast it
    moves (m/s).
    """

    def __init__(
        self,
        track: Track,
        car: Car,
        pace: float,
        line: Profile,
        temper: Temper = TEMPERS[FAIR],
        care: float = CARE,
        remembers: bool = True,
    ) -> None:
        self.observation_spec = ObservationSpec(course_points=1)
        self.reverse = self.paced = True
        self.pace = pace
        self.line = line
        self._knowledge = _knowledge(track, car, pace, line, temper, care, remembers)
        self._layout = layout(self.observation_spec)
        self._mean, self._deviation = (part.astype(np.float64) for part in self.observation_spec.scaling)

    @property
    def lap_s(self) -> float:
        """Lap time of the speed profile, s, at the driver's pace."""
        return self.line.lap_s / self.pace

    def initial_memory(self, n: int) -> Batch:
        """See `Policy.initial_memory`."""
        return np.zeros((n, 2), np.float32)

    def off_line(self, cars: NDArray[np.void]) -> NDArray[np.float64]:
        """How far to the left of the line some cars are, m; (n,) from (n,) CAR_STATE."""
        knows = self._knowledge
        along = np.arange(len(knows.offset)) * knows.spacing
        there = np.interp(cars["progress"] % knows.length, along, knows.offset, period=knows.length)
        return np.asarray(cars["lateral"] - there)

    def act(self, observations: Batch, memory: Batch) -> tuple[Batch, Batch]:
        """See `Policy.act`."""
        return self.follow(observations, memory, minding(len(observations), self.pace))

    def follow(self, observations: Batch, memory: Batch, ways: Ways) -> tuple[Batch, Batch]:
        """As `act`, in ways that the caller chooses."""
        return self._drive(observations, memory, ways, self._knowledge)

    def act_when_told(
        self,
        observations: Batch,
        memory: Batch,
        grip: NDArray[np.float64],
        peak: NDArray[np.float64],
        flagged: NDArray[np.bool_],
        told_pace: NDArray[np.float64],
    ) -> tuple[Batch, Batch]:
        """As `act`, knowing more.

        Args:
            observations, memory: as of `act`.
            grip, peak: (n,) of each car at present, and its slip at the peak, as multiples of its own.
            flagged: (n,) who is shown a blue flag.
            told_pace: (n,) share of its pace at which each is to drive.
        """
        actions, remembered = np.empty_like(memory), np.empty_like(memory)
        told = np.stack([grip, peak, np.where(flagged, YIELDING, 1.0) * told_pace], axis=1)
        for here in np.unique(told, axis=0):
            rows = (told == here).all(axis=1)
            pace = self.pace * float(here[0]) ** SLOWER * float(here[2])
            knows = self._knowledge._replace(peak_slip=self._knowledge.peak_slip * float(here[1]))
            ways = minding(int(rows.sum()), pace)
            actions[rows], remembered[rows] = self._drive(observations[rows], memory[rows], ways, knows)
        return actions, remembered

    def _drive(self, observations: Batch, memory: Batch, ways: Ways, knows: Knowledge) -> tuple[Batch, Batch]:
        actions = np.empty((len(observations), 2), np.float32)
        remembered = np.empty((len(observations), 2), np.float32)
        drive(
            observations,
            self._mean,
            self._deviation,
            memory,
            self._layout,
            ways,
            knows,
            actions,
            remembered,
        )
        return actions, remembered


def eased(grip: NDArray[np.float64], flagged: NDArray[np.bool_]) -> NDArray[np.float64]:
    """By what drivers multiply their pace where the grip is other than they know and a blue flag is shown.

    Args:
        grip, flagged: (n,) as of `Follower.act_when_told`.
    """
    return np.asarray(grip**SLOWER * np.where(flagged, YIELDING, 1.0))


def _practised(track: Track, car: Car, lane_m: float | None) -> Line:
    """Lateral offset of the line, m, and the share of the grip to use along it, (2, rows)."""
    limits = envelope(car)
    if lane_m is None:
        try:
            # That no speed can be held shows in numbers that are not finite.
            with np.errstate(all="ignore"):
                offset = minimum_time(track, limits, 1.0)
        except NoLine:
            raise InputError(
                f"car {car.name!r}: the built-in driver cannot drive {track.name!r} with it, "
                "expected one with the grip and power for all of the lap"
            ) from None
    else:
        left, right = room(track)
        offset = np.clip(lane_m, -right, left)

    def follower(_: World, line: Profile) -> Follower:
        return Follower(track, car, 1.0, line)

    return np.stack([offset, practise(track, car, offset, limits, follower)])


@lru_cache
def practised(track: Track, car: Car, lane_m: float | None = None) -> Profile:
    """What a driver follows on a circuit, found out in some seconds of practice, or known from before.

    Args:
        track: the circuit.
        car: the car, with the grip that it has there.
        lane_m: lateral offset to hold (m, + is left) instead of the racing line.

    Raises:
        InputError: if the car cannot get round.
    """
    key = track.table.tobytes(), repr((track.grid, track.length, car, lane_m)).encode()
    offset, used = cached(partial(_practised, track, car, lane_m), *key)
    return profile(track, offset, envelope(car), used)


class Driver(Follower):
    """A follower with a map of its own, practised.

    Args:
        circuit: name of the circuit.
        car: name of the car.
        pace: share of the speed that the car allows; 1 is all of it.
        lane_m: hold this lateral offset (m, + is left) instead of the racing line.
        grip: of the road for which it has practised, as a multiple of that of a dry one.
        temper: name of how near it comes to others.
        care: share of the grip found in practice that it uses among others and off its line.
    """

    def __init__(
        self,
        circuit: str,
        car: str,
        pace: float = 1.0,
        lane_m: float | None = None,
        grip: float = 1.0,
        temper: str = FAIR,
        care: float = CARE,
        remembers: bool = True,
    ) -> None:
        track, model = load_track(circuit), with_grip(load_car(car), grip)
        super().__init__(
            track, model, pace, practised(track, model, lane_m), TEMPERS[temper], care, remembers
        )
