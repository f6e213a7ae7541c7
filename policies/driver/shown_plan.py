"""The built-in driver's plan of a lap, as policies see it that are shown one."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from nathlon.policies.driver import practised
from nathlon.policies.driver.envelope import envelope
from nathlon.policies.driver.steering import plan
from nathlon.sim.car import Car, with_grip
from nathlon.sim.observation import ObservationSpec
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


def show_plan(world: World, *specs: ObservationSpec) -> None:
    """Show a world the plans for its circuit, cars and conditions, if one of some specs sees them.

    Raises:
        InputError: if the driver cannot get round.
    """
    if not world.plans and any(spec.planned for spec in specs):
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
    line = practised(track, car)
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
