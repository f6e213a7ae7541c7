"""Scripted people: they see late what the screen shows, know the circuit, and use keys or a wheel.

They stand for people in tests and benchmarks of test drives. What they have done themselves they know at
once, so they reckon from what they last saw to where they must be now, as people do.
"""

from __future__ import annotations

import math
from collections import deque
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks.scripted_traffic import ScriptedTraffic
from nathlon.arena.match import Match, Race, Seat
from nathlon.arena.runner import Observer, run_match
from nathlon.lab.drive.aids import RETURN_S, STEER_S, AidedCar, Aids, Controls, pressed
from nathlon.policies.driver import Driver
from nathlon.policies.driver.knowledge import along, clip
from nathlon.policies.policy import Policy
from nathlon.policies.sources.human import Person
from nathlon.sim.car import load_car
from nathlon.sim.clock import DYNAMICS_DT, DYNAMICS_HZ
from nathlon.sim.track import load_track
from nathlon.sim.world import World

KEY_PRESS = 5
"""Dynamics steps between two decisions on keys: nobody taps faster than some ten times a second."""
LAG_S = 0.14
"""From the command to the lateral acceleration."""
UNDERSTEER_RAD = 0.01
"""Steering beyond that of the bend's geometry, at the most side force."""
FORCE = 0.9
"""Share of the grip that the front tyres give at the most."""


class Style(NamedTuple):
    """How a scripted person drives.

    Attributes:
        keys: whether with keys.
        late_s: from what happens to when they see it.
        pace: share of the built-in driver's speed.
        stiffness: rad/s, how fast they correct what is off the line.
        aids: whether they have the steering aid; without it, they turn the wheels themselves.
    """

    keys: bool
    late_s: float
    pace: float
    stiffness: float
    aids: bool = True


KEYS = Style(True, 0.25, 0.875, 2.0)
WHEEL = Style(False, 0.2, 0.97, 1.8)
UNAIDED = Style(False, 0.2, 0.8, 1.8, aids=False)


def drive_alone(circuit: str, car: str, style: Style, laps: int = 1) -> dict[str, Any]:
    """A scripted person alone from a standing start: the row of RESULTS."""
    driver = ScriptedDriver(circuit, car, style)
    aided = AidedCar(load_car(car), Aids(steering=style.aids, pedals=style.aids))
    worlds: list[World] = []

    def hands(step: int) -> tuple[float, float]:
        own = worlds[0].state[0, 0]
        return aided.act(driver.act(own), own)

    def look(world: World) -> None:
        worlds[:] = [world]

    return _alone(Person(hands, "scripted"), circuit, car, laps, look)


def built_in_driver_alone(circuit: str, car: str, laps: int = 1) -> dict[str, Any]:
    """The built-in driver in the same race: the row of RESULTS."""
    return _alone(Driver(circuit, car), circuit, car, laps, lambda world: None)


def _alone(policy: Policy, circuit: str, car: str, laps: int, observer: Observer) -> dict[str, Any]:
    scenario = f"drive:laps={laps},cars=1,person=1"
    match = Match("race", "drive", scenario, circuit, car, ("alone",), ("",), (Race(1, (Seat(0),)),))
    return run_match(match, [policy], observer).row(0, named=True)


class _Sight(NamedTuple):
    distance: float
    lateral: float
    course: float  # direction of travel relative to the centre line, rad
    speed: float
    turning: float  # lateral acceleration, m/s^2


class ScriptedDriver:
    """A person with one car, through one race.

    Args:
        circuit, car: what they drive.
        style: how.
    """

    def __init__(self, circuit: str, car: str, style: Style) -> None:
        self._style = style
        self._line = Driver(circuit, car).line
        self._spacing = load_track(circuit).spacing
        model = load_car(car)
        self._car = AidedCar(model, Aids())
        self._wheelbase_m = model.body.front_axle_m + model.body.rear_axle_m
        self._full_lock = model.steering.full_lock_rad
        late = round(style.late_s * DYNAMICS_HZ)
        self._seen: deque[_Sight] = deque(maxlen=late + 1)
        self._done: deque[float] = deque([0.0] * late, maxlen=late)
        self._held = Controls(style.keys, 0.0, 0.0, 0.0)
        self._traffic = ScriptedTraffic(circuit, style.late_s, self._line.offset)
        self._position = self._meant = 0.0
        self._step = 0

    def act(self, car: np.void, others: NDArray[np.void] | None = None) -> Controls:
        """What they do in the next dynamics step; `car` and the `others` are what the screen shows."""
        drift = math.atan2(car["velocity_y"], max(car["velocity_x"], 1.0))
        speed = math.hypot(car["velocity_x"], car["velocity_y"])
        self._seen.append(
            _Sight(
                float(car["progress"]),
                float(car["lateral"]),
                float(car["heading_error"]) + drift,
                speed,
                float(car["yaw_rate"]) * speed,
            )
        )
        now = None
        aside, limit = 0.0, math.inf
        if others is not None:
            now = self._reckon(self._seen[0])
            aside, limit = self._traffic.advise(others, now.distance, now.speed)
        if self._step % (KEY_PRESS if self._style.keys else 1) == 0:
            self._held = self._decide(now or self._reckon(self._seen[0]), aside, limit)
        self._step += 1
        self._remember()
        return self._held

    def _reckon(self, seen: _Sight) -> _Sight:
        """Where the car must be now, by what they have done since they saw it there."""
        distance, lateral, course, speed, turning = seen
        for command in self._done:
            turning += (self._force(command, speed) - turning) * DYNAMICS_DT / LAG_S
            bend = along(self._line.path.curvature, distance, self._spacing)
            slant = along(self._line.heading, distance, self._spacing)
            course += (turning / max(speed, 5.0) - bend * speed) * DYNAMICS_DT
            course += along(self._line.heading, distance + speed * DYNAMICS_DT, self._spacing) - slant
            lateral += speed * math.sin(course) * DYNAMICS_DT
            distance += speed * DYNAMICS_DT
        return _Sight(distance, lateral, course, speed, turning)

    def _decide(self, now: _Sight, aside: float, limit: float) -> Controls:
        line, stiffness = self._line, self._style.stiffness
        speed = max(now.speed, 5.0)
        ahead = now.distance + speed * LAG_S
        bend = along(line.path.curvature, ahead, self._spacing)
        error = now.lateral - along(line.offset, now.distance, self._spacing) - aside
        slant = now.course - along(line.heading, now.distance, self._spacing)
        wanted = bend * speed * speed - stiffness**2 * error - 1.6 * stiffness * speed * slant
        command = self._command(wanted, speed)
        target = self._style.pace * along(line.speed, now.distance + 0.25 * speed, self._spacing)
        too_fast = now.speed - min(target, limit)
        if self._style.keys:
            return self._keys(command, too_fast)
        throttle, brake = clip(-0.35 * too_fast, 0.0, 1.0), clip(0.3 * too_fast, 0.0, 1.0)
        if not self._style.aids:
            self._meant = command
            bend = command * FORCE * self._car.grip_m_s2(speed) / speed**2
            command = clip((self._wheelbase_m * bend + UNDERSTEER_RAD * command) / self._full_lock, -1.0, 1.0)
        return Controls(False, command, throttle, brake)

    def _keys(self, command: float, too_fast: float) -> Controls:
        off = command - self._position
        steering = 0.0
        if abs(command) > 0.06:
            toward = math.copysign(1.0, command)
            # Up to the wanted place, and let go beyond it.
            steering = toward if toward * off > -0.08 else 0.0
        return Controls(True, steering, float(too_fast < 0.0), float(too_fast > 1.5))

    def _remember(self) -> None:
        if self._style.keys:
            self._position = pressed(self._position, self._held.steering, STEER_S, RETURN_S)
            self._done.append(self._position)
        else:
            self._done.append(self._held.steering if self._style.aids else self._meant)

    def _force(self, command: float, speed: float) -> float:
        """Lateral acceleration, m/s^2, that a command gives in the end."""
        return FORCE * self._car.grip_m_s2(speed) * command

    def _command(self, turning: float, speed: float) -> float:
        """The command that gives a lateral acceleration."""
        return clip(turning / (FORCE * self._car.grip_m_s2(speed)), -1.0, 1.0)
