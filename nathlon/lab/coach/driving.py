"""Driving parts of a lap again in the simulator: the same inputs at the same places, edited or not.

A rider repeats what was done at each place, and steers and brakes against what it is off by. Without an edit
it repeats a recorded part of a lap to some hundredths of a second; whoever proves something by it compares
with that.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from nathlon.arena.race_log import RaceLog
from nathlon.lab.coach.lap import STEP_M, Lap, Trace
from nathlon.sim.car import Car, load_car
from nathlon.sim.clock import DYNAMICS_DT
from nathlon.sim.conditions import Conditions, Start
from nathlon.sim.scenario import load_scenario
from nathlon.sim.track import load_track
from nathlon.sim.world import World

LATERAL_MOST = 0.02
"""Steering, rad at the wheels, that is given for the place across the road at most."""
SLOWEST_M_S = 5.0
"""A slip angle is reckoned with no less speed."""
SPEED_GAIN = 0.3
"""Pedal for each m/s off the speed, unless the throttle is full."""
FULL_THROTTLE = 0.97
LONGEST = 1.3
"""A part is given up after so many times the time that it took."""


class Hands(NamedTuple):
    """How a rider steers against what it is off by.

    Attributes:
        lateral: rad at the wheels for each metre off the place across the road.
        heading: and for each rad off the direction.
        yaw_rate: and for each rad/s off the rate of turning.
        slip: angle of the front tyres over that of their peak that is asked for at most.
    """

    lateral: float
    heading: float
    yaw_rate: float
    slip: float


HANDS = (
    Hands(0.03, 0.7, 0.2, 1.3),
    Hands(0.03, 0.7, 0.3, 1.3),
    Hands(0.03, 0.5, 0.15, 1.6),
    Hands(0.02, 0.4, 0.1, 1.3),
    Hands(0.03, 1.0, 0.3, 1.6),
    Hands(0.05, 1.0, 0.2, 2.5),
)
"""Cars and drivers differ: of these a part is driven with those that repeat it best."""


@dataclass(frozen=True, eq=False)
class TrialPlan:
    """What a rider wants at each place of a lap; arrays as those of a `Lap`."""

    pedal: Trace
    steering: Trace
    speed: Trace
    lateral: Trace
    heading: Trace
    yaw_rate: Trace

    @classmethod
    def of(cls, lap: Lap) -> TrialPlan:
        """What was done in a lap."""
        return cls(lap.pedal, lap.steering, lap.speed, lap.lateral, lap.heading, lap.yaw_rate)

    def with_traces(self, **traces: Trace) -> TrialPlan:
        """The same with some traces replaced."""
        return replace(self, **traces)

    def with_changes(self, others: Sequence[TrialPlan]) -> TrialPlan:
        """The same with what other plans have otherwise, all of it added up."""
        return TrialPlan(
            **{
                name: getattr(self, name)
                + sum(getattr(other, name) - getattr(self, name) for other in others)
                for name in self.__dataclass_fields__
            }
        )


class Jolt(NamedTuple):
    """By what a start is off from the recorded one: m/s, and m to the left."""

    speed: float = 0.0
    lateral: float = 0.0


class DrivenTrial(NamedTuple):
    """A part of a lap that was driven again.

    Attributes:
        places: (ticks,) m from the line.
        time_s: (ticks,) since the start of the part.
        speed, lateral, pedal: (ticks,) of the car.
        off_course_s, wall_s: in all.
    """

    places: Trace
    time_s: Trace
    speed: Trace
    lateral: Trace
    pedal: Trace
    off_course_s: float
    wall_s: float

    def until(self, place_m: float) -> float:
        """Time from the start of the part to a place, s; inf if the car does not get there."""
        if self.places[-1] < place_m:
            return np.inf
        return float(np.interp(place_m, self.places, self.time_s))

    @property
    def clean(self) -> bool:
        """Whether the car stayed on course and off the walls."""
        return self.off_course_s == 0.0 and self.wall_s == 0.0


class Rider:
    """Drives parts of a lap of a race again, with the same circuit, car, tyres and road.

    Args:
        log: the race.
        lap: the lap.

    Raises:
        InputError: if circuit, car or scenario are not known here.
    """

    def __init__(self, log: RaceLog, lap: Lap) -> None:
        scenario = load_scenario(log.scenario)
        self._track, self._car, self._lap = load_track(log.circuit), load_car(log.car), lap
        self._conditions = Conditions(
            scenario.compound, scenario.wear_rate, scenario.fuel_rate, scenario.grip
        )

    def drive(
        self, runs: Sequence[tuple[TrialPlan, Jolt]], start_m: float, end_m: float, hands: Hands = HANDS[0]
    ) -> list[DrivenTrial]:
        """Drive a part of the lap, each run by itself, from how the car was recorded at its start.

        Args:
            runs: what is wanted, and by what the start is off.
            start_m, end_m: of the part, m from the line.
            hands: of the rider.
        """
        world = World(self._track, self._car, len(runs), 1, self._conditions)
        for race, (_, jolt) in enumerate(runs):
            self._place(world, race, self._lap.at(start_m), jolt)
        wanted = {
            name: np.stack([getattr(plan, name) for plan, _ in runs])
            for name in TrialPlan.__dataclass_fields__
        }
        cars, grip = world.state[:, 0], _Grip(self._car, hands)
        ticks = round(LONGEST * self._lap.between(start_m, end_m) / DYNAMICS_DT)
        seen: dict[str, list[Trace]] = {name: [] for name in ("progress", "velocity_x", "lateral", "pedal")}
        for _ in range(ticks):
            actions = grip.act(cars, wanted)
            for name in ("progress", "velocity_x", "lateral"):
                seen[name].append(cars[name].copy())
            seen["pedal"].append(actions[:, 0])
            # Who has left the course proves nothing any more.
            if ((cars["progress"] > end_m) | (cars["off_course_s"] > 0.0) | (cars["wall_s"] > 0.0)).all():
                break
            world.step(actions[:, None], 1)
        columns = {name: np.array(values) for name, values in seen.items()}
        time: Trace = np.arange(len(columns["progress"])).astype(np.float64) * DYNAMICS_DT
        return [self._driven(columns, time, cars, race) for race in range(len(runs))]

    def _place(self, world: World, race: int, index: int, jolt: Jolt) -> None:
        lap = self._lap

        def one(value: float) -> NDArray[np.float64]:
            return np.array([float(value)])

        world.reset(
            race,
            Start(
                distance=one(index * STEP_M),
                lateral=one(lap.lateral[index] + jolt.lateral),
                heading=one(lap.heading[index]),
                speed=one(lap.speed[index] + jolt.speed),
                finish=one(np.inf),
                side_speed=one(lap.side_speed[index]),
                yaw_rate=one(lap.yaw_rate[index]),
            ),
        )
        car = world.state[race]
        car["gear"] = lap.gear[index] - 1
        car["steering"] = lap.steering[index] * world.parameters.car.full_lock
        car["carried_x"], car["carried_y"] = lap.acceleration[index], lap.side_acceleration[index]

    @staticmethod
    def _driven(columns: dict[str, Trace], time: Trace, cars: NDArray[np.void], race: int) -> DrivenTrial:
        return DrivenTrial(
            np.maximum.accumulate(columns["progress"][:, race]),
            time,
            columns["velocity_x"][:, race],
            columns["lateral"][:, race],
            columns["pedal"][:, race],
            float(cars["off_course_s"][race]),
            float(cars["wall_s"][race]),
        )


class _Grip:
    """Hands on the wheel of a car: what turns a plan into pedal and steering."""

    def __init__(self, car: Car, hands: Hands) -> None:
        self._lock, self._front_m = car.steering.full_lock_rad, car.body.front_axle_m
        self._hands, self._slip = hands, hands.slip * car.tyre.peak_slip_angle_rad[0]

    def act(self, cars: NDArray[np.void], wanted: dict[str, Trace]) -> NDArray[np.float64]:
        """Pedal and steering of each run's car, (runs, 2)."""
        runs, last = np.arange(len(cars)), wanted["pedal"].shape[1] - 1
        at = np.clip(cars["progress"] / STEP_M, 0.0, last - 1e-9)
        low = at.astype(np.int64)
        share = at - low

        def there(name: str) -> Trace:
            values = wanted[name]
            between: Trace = values[runs, low] * (1.0 - share) + values[runs, low + 1] * share
            return between

        pedal = wanted["pedal"][runs, low + 1]
        pedal = pedal + SPEED_GAIN * (there("speed") - cars["velocity_x"]) * (pedal < FULL_THROTTLE)
        aside = self._hands.lateral * (there("lateral") - cars["lateral"])
        turn = np.clip(aside, -LATERAL_MOST, LATERAL_MOST)
        turn += self._hands.heading * (there("heading") - cars["heading_error"])
        turn += self._hands.yaw_rate * (there("yaw_rate") - cars["yaw_rate"])
        speed = np.maximum(cars["velocity_x"], SLOWEST_M_S)
        straight = np.arctan2(cars["velocity_y"], speed) + self._front_m * cars["yaw_rate"] / speed
        angle = np.clip(there("steering") * self._lock + turn, straight - self._slip, straight + self._slip)
        return np.clip(np.stack([pedal, angle / self._lock], axis=1), -1.0, 1.0)
