"""Scripted people: they see late what the screen shows, know the circuit, and use keys or a wheel.

They stand for people in tests and benchmarks of test drives. What they have done themselves they know at
once, so they reckon from what they last saw to where they must be now, as people do.
"""

from __future__ import annotations

import math
from collections import deque
from typing import NamedTuple

import numpy as np

from nathlon.driving.aids import AidedCar, Aids, Controls
from nathlon.policies.driver import Driver
from nathlon.policies.driver.knowledge import along, clip
from nathlon.sim.car import load_car
from nathlon.sim.track import load_track
from nathlon.sim.world import DYNAMICS_DT, DYNAMICS_HZ

KEY_PRESS = 5
"""Dynamics steps between two decisions on keys: nobody taps faster than some ten times a second."""
LAG_S = 0.14
"""From the command to the lateral acceleration."""
FORCE = 0.9
"""Share of the grip that the front tyres give at the most."""


class Style(NamedTuple):
    """How a scripted person drives.

    Attributes:
        keys: whether with keys.
        late_s: from what happens to when they see it.
        pace: share of the built-in driver's speed.
        stiffness: rad/s, how fast they correct what is off the line.
    """

    keys: bool
    late_s: float
    pace: float
    stiffness: float


KEYS = Style(True, 0.25, 0.875, 2.0)
WHEEL = Style(False, 0.2, 0.96, 1.6)


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
        self._car = AidedCar(load_car(car), Aids())
        late = round(style.late_s * DYNAMICS_HZ)
        self._seen: deque[_Sight] = deque(maxlen=late + 1)
        self._done: deque[float] = deque([0.0] * late, maxlen=late)
        self._held = Controls(style.keys, 0.0, 0.0, 0.0)
        self._position = 0.0
        self._step = 0

    def act(self, car: np.void) -> Controls:
        """What they do in the next dynamics step; `car` is what the screen shows."""
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
        if self._step % (KEY_PRESS if self._style.keys else 1) == 0:
            self._held = self._decide(self._reckon(self._seen[0]))
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

    def _decide(self, now: _Sight) -> Controls:
        line, stiffness = self._line, self._style.stiffness
        speed = max(now.speed, 5.0)
        ahead = now.distance + speed * LAG_S
        bend = along(line.path.curvature, ahead, self._spacing)
        error = now.lateral - along(line.offset, now.distance, self._spacing)
        slant = now.course - along(line.heading, now.distance, self._spacing)
        wanted = bend * speed * speed - stiffness**2 * error - 1.6 * stiffness * speed * slant
        command = self._command(wanted, speed)
        target = self._style.pace * along(line.speed, now.distance + 0.25 * speed, self._spacing)
        too_fast = now.speed - target
        if self._style.keys:
            return self._keys(command, too_fast)
        throttle, brake = clip(-0.35 * too_fast, 0.0, 1.0), clip(0.3 * too_fast, 0.0, 1.0)
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
        from nathlon.driving.aids import RETURN_S, STEER_S, _towards

        if self._style.keys:
            self._position = _towards(self._position, self._held.steering, STEER_S, RETURN_S)
            self._done.append(self._position)
        else:
            self._done.append(self._held.steering)

    def _force(self, command: float, speed: float) -> float:
        """Lateral acceleration, m/s^2, that a command gives in the end."""
        return FORCE * self._car.grip_m_s2(speed) * command

    def _command(self, turning: float, speed: float) -> float:
        """The command that gives a lateral acceleration."""
        return clip(turning / (FORCE * self._car.grip_m_s2(speed)), -1.0, 1.0)
