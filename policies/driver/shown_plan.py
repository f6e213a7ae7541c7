"""The plan of a lap, as policies see it that are shown one: the built-in driver's, or one practised by them.

What a policy can hold differs from what the driver can: shown the driver's speeds in full, it spins in one
bend and has time to spare in the next. So who practises drives the driver's line, as the driver has done
before, until it knows how fast to be where.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache, partial

import numpy as np

from nathlon.policies.driver import practised
from nathlon.policies.driver.disk_cache import cached
from nathlon.policies.driver.envelope import envelope
from nathlon.policies.driver.practice import practise
from nathlon.policies.driver.speed_profile import Profile, profile
from nathlon.policies.driver.steering import plan
from nathlon.policies.policy import Policy
from nathlon.sim.car import Car, with_grip
from nathlon.sim.plan import (
    COLUMNS,
    CURVATURE,
    DIRECTION,
    OFFSET,
    SIDESLIP,
    SPEED,
    STEERING,
    Plan,
    X,
    Y,
)
from nathlon.sim.track import TANGENT_X, TANGENT_Y, Track
from nathlon.sim.world import World

FIRST_GRIP, ROUNDS = 1.1, 100
"""Share of the grip in steady motion with which a policy's practice begins: it may hold more than the driver
does. And how long it lasts, at most."""


def show_plans(world: World, *policies: Policy) -> None:
    """Show a world the plans for its circuit, cars and conditions that some policies see.

    Raises:
        InputError: if the driver cannot get round.
    """
    for policy in policies:
        spec = policy.observation_spec
        if spec.practised_by and spec.practised_by not in world.plans:
            practiser = Practiser(spec.practised_by, policy)
            own = (own_plan(world.track, _as_there(model, world), practiser) for model in world.models)
            world.show(*own, practised_by=practiser.id)
        elif spec.planned and not spec.practised_by:
            show_plan(world)


def show_plan(world: World) -> None:
    """Show a world the built-in driver's plans for its circuit, cars and conditions.

    Raises:
        InputError: if the driver cannot get round.
    """
    if "" not in world.plans:
        world.show(*(plan_of(world.track, _as_there(model, world)) for model in world.models))


def _as_there(car: Car, world: World) -> Car:
    """A car with the grip that it has in a world."""
    return with_grip(car, world.conditions.grip.tarmac * world.first_grip(car))


@lru_cache
def plan_of(track: Track, car: Car) -> Plan:
    """The driver's plan of a lap.

    Args:
        track: the circuit.
        car: the car, with the grip that it has there.

    Raises:
        InputError: if the driver cannot get round.
    """
    return _plan(track, car, practised(track, car))


@dataclass(frozen=True)
class Practiser:
    """A policy that practises, by its id.

    Attributes:
        id: what its spec says by whom its plan is practised.
        policy: drives, and sees a plan.
    """

    id: str
    policy: Policy = field(compare=False)


@lru_cache
def own_plan(track: Track, car: Car, practiser: Practiser) -> Plan:
    """The plan of a lap on the driver's line at speeds that a policy has practised.

    Args:
        track: the circuit.
        car: the car, with the grip that it has there.
        practiser: drives.

    Raises:
        InputError: if the driver cannot get round.
    """
    limits, offset = envelope(car), practised(track, car).offset

    def shown(world: World, line: Profile) -> Policy:
        world.show(_plan(track, car, line), practised_by=practiser.id)
        return practiser.policy

    key = track.table.tobytes(), repr((track.grid, track.length, car, practiser.id)).encode()
    practice = partial(practise, track, car, offset, limits, shown, FIRST_GRIP, ROUNDS)
    return _plan(track, car, profile(track, offset, limits, cached(practice, *key)))


def _plan(track: Track, car: Car, line: Profile) -> Plan:
    """The plan of a profile."""
    wheels = plan(line, car, envelope(car), 1.0)
    curvature, body = line.path.curvature, car.body
    centre = np.arctan2(track.table[:, TANGENT_Y], track.table[:, TANGENT_X])
    angle = (body.front_axle_m + body.rear_axle_m) * curvature + wheels.slip
    lap = np.empty((len(line.offset), COLUMNS))
    lap[:, [X, Y]] = track.offset_line(line.offset)[:, :2]
    lap[:, OFFSET], lap[:, DIRECTION] = line.offset, centre + line.heading
    lap[:, CURVATURE], lap[:, SPEED] = curvature, line.speed
    lap[:, STEERING] = angle / car.steering.full_lock_rad
    lap[:, SIDESLIP] = body.rear_axle_m * curvature - wheels.rear_slip
    return Plan.of_lap(lap)
