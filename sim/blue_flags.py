"""Blue flags: who is about to be lapped, and what the stewards make of a car that holds another one up.

They are shown once an agent step, and only under rules that have them.
"""

from __future__ import annotations

import math

import numpy as np

from nathlon.sim.kernel import lean_kernel
from nathlon.sim.physics.pit_lane import on_road
from nathlon.sim.rules import BlueFlagParameters
from nathlon.sim.state import CarRecord, Cars
from nathlon.sim.steward import penalise

NOBODY = -1
SLOWEST = 10.0
"""m/s: a gap in seconds is that of a car that goes no slower."""


@lean_kernel
def show_blue_flags(state: np.ndarray, dt: float, length: float, rules: BlueFlagParameters) -> None:
    """Show every car of all races whom it is to let by, and penalise those that did not for too long.

    Args:
        state: (races, cars) CAR_STATE, changed in place.
        dt: since the last call, s.
        length: of a lap, m.
        rules: on blue flags.
    """
    for race in range(len(state)):
        cars = state[race]
        for i in range(len(cars)):
            flag(cars, i, dt, length, rules)


@lean_kernel
def flag(cars: Cars, index: int, dt: float, length: float, rules: BlueFlagParameters) -> None:
    """As `show_blue_flags`, one car of a race."""
    car = cars[index]
    lapping, gap = NOBODY, rules.shown
    for other in range(len(cars)):
        behind = gap_behind(car, cars[other], length)
        if behind < gap:
            lapping, gap = other, behind
    if lapping != car.flagged_for:
        car.flagged_for, car.held_up_s = lapping, 0.0
    if lapping == NOBODY or gap > rules.close:
        return
    car.held_up_s += dt
    if car.held_up_s >= rules.patience:
        car.held_up_s = 0.0
        car.hold_ups += 1
        penalise(car, rules.penalty)


@lean_kernel
def gap_behind(car: CarRecord, other: CarRecord, length: float) -> float:
    """How many seconds another car is behind that is about to lap this one; infinite for all others.

    Who is half a lap ahead in the race, or more, laps those that it comes up to.
    """
    lead = other.progress - car.progress
    if lead < 0.5 * length or not on_road(car) or not on_road(other):
        return math.inf
    gap = math.ceil(lead / length) * length - lead
    return gap / max(other.velocity_x, SLOWEST)
