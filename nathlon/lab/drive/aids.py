"""Driving aids: from what a person does with keys, pad or wheel to throttle, brake and steering.

They know the car and feel what its sensors would. With all aids the steering command is the share of the
front tyres' side force: the wheels roll freely when it is let go, and never slip beyond the peak. The pedals
are eased while the rear tyres slide, and the brakes by as much of the grip as the bend takes. The car's own
slip control of drive and brakes always works.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from pydantic import BaseModel, ConfigDict

from nathlon.sim.car import Car
from nathlon.sim.clock import DYNAMICS_DT
from nathlon.sim.physics.chassis import AIR_DENSITY, GRAVITY

STEER_S, RETURN_S = 0.22, 0.14
"""In which a key moves the steering from the middle to its end, and back when it is let go."""
THROTTLE_S, BRAKE_S, RELEASE_S = 0.25, 0.15, 0.08
"""In which a key presses a pedal down, and in which it comes up."""
MOST_FORCE = 0.985
"""Share of the front tyres' side force that the steering aid allows."""
ROLLING_M_S = 6.0
"""Below this speed the wheels hardly roll: slip says little, and the steering is geometric."""
STEADY = 0.9
"""Share of the grip at which a car turns steadily with all the side force of its front tyres."""
YAW_DAMPING_S = 1.2
"""Side force for each rad/s that the car turns too little, as a share of the most there is."""
SLIDING = 0.55, 0.85
"""Rear slip over that of the peak at which the brakes begin to be eased, and at which they are let go."""
SPINNING = 0.75, 1.2
"""Rear slip over that of the peak at which steering into the bend begins to be taken back, and has been."""
LEAST_PEDAL = 0.15
"""Share of the throttle that is left however the car slides."""


class Aids(BaseModel):
    """Which aids are on.

    Attributes:
        steering: limits the slip of the front tyres, and turns them to where the car goes.
        pedals: eases the pedals while the tyres are needed for the bend.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)

    steering: bool = True
    pedals: bool = True


class Controls(NamedTuple):
    """What a person does.

    Attributes:
        keys: whether with keys, which are down or up, so that the steering and the pedals take time.
        steering: from -1 to 1, + is left.
        throttle, brake: from 0 to 1.
    """

    keys: bool
    steering: float
    throttle: float
    brake: float


IDLE = Controls(False, 0.0, 0.0, 0.0)


class AidedCar:
    """A car with driving aids, through one race.

    Args:
        car: the model.
        aids: which are on.
    """

    def __init__(self, car: Car, aids: Aids) -> None:
        body, tyre = car.body, car.tyre
        self.aids = aids
        self._full_lock = car.steering.full_lock_rad
        self._front_m = body.front_axle_m
        self._peak = tyre.peak_slip_angle_rad
        self._loads = tyre.load_n
        self._shape = tyre.shape
        self._friction = sum(tyre.friction_lateral) / 2.0
        self._downforce = 0.5 * AIR_DENSITY * car.aero.downforce_area_m2 / body.mass_kg
        self._steering = self._throttle = self._brake = 0.0

    def act(self, controls: Controls, car: np.void) -> tuple[float, float]:
        """Pedals and steering of the next dynamics step, as of `Policy.act`.

        Args:
            controls: what the person does.
            car: the car's state.
        """
        steering, throttle, brake = controls[1:]
        if controls.keys:
            steering = self._steering = pressed(self._steering, steering, STEER_S, RETURN_S)
            throttle = self._throttle = pressed(self._throttle, throttle, THROTTLE_S, RELEASE_S)
            brake = self._brake = pressed(self._brake, brake, BRAKE_S, RELEASE_S)
        else:
            self._steering, self._throttle, self._brake = steering, throttle, brake
        if self.aids.pedals:
            throttle, brake = self._eased(throttle, brake, car)
        if self.aids.steering:
            steering = self._aided(steering, car)
        return throttle - brake, min(max(steering, -1.0), 1.0)

    def grip_m_s2(self, speed: float) -> float:
        """Lateral acceleration that the tyres hold on a level road."""
        return self._friction * (GRAVITY + self._downforce * speed * speed)

    def _aided(self, steering: float, car: np.void) -> float:
        """Steering as a share of full lock, of a command that is a share of the front side force."""
        rolling = min(max(car["velocity_x"] / ROLLING_M_S - 1.0, 0.0), 1.0)
        ahead = max(car["velocity_x"], ROLLING_M_S)
        straight = math.atan2(car["velocity_y"] + self._front_m * car["yaw_rate"], ahead)
        wanted = steering * STEADY * self.grip_m_s2(ahead) / ahead
        steering += rolling * YAW_DAMPING_S * (wanted - car["yaw_rate"])
        if steering * car["yaw_rate"] > 0.0:
            steering *= _left(self._sliding(car), SPINNING)
        slip = self._slip(MOST_FORCE * steering) * self._peak_at(0.5 * (car["load"][0] + car["load"][1]))
        return (rolling * (straight + slip) + (1.0 - rolling) * steering * self._full_lock) / self._full_lock

    def _sliding(self, car: np.void) -> float:
        """Slip of the rear tyres over that of their peak."""
        slip, load = car["slip_angle"], car["load"]
        return 0.5 * (abs(slip[2]) + abs(slip[3])) / self._peak_at(0.5 * (load[2] + load[3]))

    def _slip(self, force: float) -> float:
        """Slip over that of the peak at which a tyre gives this share of its most force."""
        force = min(max(force, -MOST_FORCE), MOST_FORCE)
        return math.tan(math.asin(force) / self._shape) / math.tan(math.pi / 2.0 / self._shape)

    def _peak_at(self, load: float) -> float:
        """Slip angle of the peak at a tyre's load, rad."""
        (low, high), (light, heavy) = self._loads, self._peak
        return max(light + (heavy - light) * (load - low) / (high - low), 0.02)

    def _eased(self, throttle: float, brake: float, car: np.void) -> tuple[float, float]:
        sliding = self._sliding(car)
        speed = car["velocity_x"]
        used = min(abs(car["yaw_rate"] * speed) / self.grip_m_s2(speed), 0.95)
        throttle *= min(max(2.0 - 1.5 * sliding, LEAST_PEDAL), 1.0)
        return throttle, brake * _left(sliding, SLIDING) * math.sqrt(1.0 - used * used)


def _left(sliding: float, span: tuple[float, float]) -> float:
    """What is left of a command: all before the span of rear slip, nothing beyond it."""
    least, most = span
    return min(max((most - sliding) / (most - least), 0.0), 1.0)


def pressed(now: float, wanted: float, there_s: float, back_s: float) -> float:
    """A command a step later, on its way to what a key wants: out in `there_s`, back in `back_s`."""
    away = wanted * now >= 0.0 and abs(wanted) > abs(now)
    step = DYNAMICS_DT / (there_s if away else back_s)
    return now + min(max(wanted - now, -step), step)
