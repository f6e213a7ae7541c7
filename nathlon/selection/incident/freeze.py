"""From a moment of a recorded race to a scenario with the same cars, and what counts as passed in it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from nathlon.arena.race_log import Incident, RaceLog, origin, progress, start_number
from nathlon.selection.battery.skill import Gains, Passed, Skill
from nathlon.sim.errors import InputError
from nathlon.sim.scenario import Scenario, load_scenario
from nathlon.sim.scenario_start import FrozenCar, FrozenStart
from nathlon.sim.track import TANGENT_X, TANGENT_Y, Track, X, Y, load_track

NEAR_S = 2.0
"""How far from the moment that is named an incident may lie."""
WINDOW_M = 60.0
"""Where a car is looked for on the circuit, about the place that its recording tells: bridges cross roads."""
CLEAN = 0.0
"""Contacts, and seconds off course, of a run that is passed."""
MEASURES = {"contact": "contacts", "wall": "off_course", "off_course": "off_course"}
"""What is counted against a car, by the kind of incident that it was in."""
GAIN = Gains(base=1.0, reference_gain=1.0, limit_gain=1.0, exponent=1.0)
"""A clean run is worth 1,000 points, one with one contact or second off course 500."""


@dataclass(frozen=True)
class Frozen:
    """An incident as a test.

    Attributes:
        scenario: that begins some seconds before it.
        skill: how it is tested; its `scenario` and `opponents` are still to be named.
        others: indices of the opponents' cars in the recording, in the order of their places.
        happened: the incident.
    """

    scenario: Scenario
    skill: Skill
    others: tuple[int, ...]
    happened: Incident


def freeze(
    log: RaceLog, at_s: float, car: int, name: str, before_s: float, after_s: float, runs: int
) -> Frozen:
    """Freeze the cars of a race some seconds before an incident of one of them.

    The wear of tyres, fuel and the gear that was in are not recorded: cars begin on new tyres with a full
    tank, in the gear for their speed.

    Args:
        log: the race.
        at_s: when it happened, s since the start, within `NEAR_S`.
        car: index of the car to be tested.
        name: of the test.
        before_s, after_s: how long before the incident the scenario begins and after it ends, s.
        runs: of an entrant.

    Raises:
        InputError: if nothing happened to the car then, or it did not drive at the beginning.
    """
    happened = _incident(log, at_s, car)
    begin = int(np.searchsorted(log.time_s, max(happened.time_s - before_s, log.time_s[0])))
    sample = log.samples[begin]
    if not sample["driving"][car]:
        raise InputError(
            f"car {start_number(car)} does not drive {before_s:g} s before the incident, "
            f"expected one that does"
        )
    driving = np.flatnonzero(sample["driving"]).tolist()
    places = _places(log, begin)
    cars = tuple(places[each] for each in driving)
    place = 1 + driving.index(car)
    original = load_scenario(log.scenario)
    scenario = Scenario(
        name=name,
        description=f"{before_s:g} s before: {happened.text}.",
        cars=len(cars),
        start=FrozenStart(kind="frozen", car=cars),
        time_s=round(float(happened.time_s - log.time_s[begin]) + after_s, 2),
        rules=original.rules,
        compound=original.compound,
        action_hz=_of_those(original.action_hz, driving),
        perception_delay_s=_of_those(original.perception_delay_s, driving),
    )
    measure = MEASURES[happened.kind]
    if measure == "contacts" and happened.fault == car:
        measure = "at_fault"
    skill = Skill(
        name=name,
        description=f"From the race {log.match[:6]}/{log.race}: {happened.text}.",
        scenario=name,
        slots=(place,),
        runs=runs,
        measure=measure,
        in_order=True,
        circuit=log.circuit,
        car=log.car,
        passed=Passed(at_most=CLEAN),
        scoring=GAIN,
    )
    return Frozen(scenario, skill, tuple(each for each in driving if each != car), happened)


def _incident(log: RaceLog, at_s: float, car: int) -> Incident:
    """The incident of a car that is nearest to a moment."""
    own = [one for one in log.incidents if car in one.cars and one.kind in MEASURES]
    near = [one for one in own if abs(one.time_s - at_s) <= NEAR_S]
    if not near:
        known = ", ".join(f"{one.time_s:.1f}" for one in own) or "none"
        raise InputError(
            f"nothing happened to car {start_number(car)} within {NEAR_S:g} s of {at_s:g} s, "
            f"expected one of its contacts or excursions, at {known}"
        )
    # Of several at one time, one that is laid to the car tells more than one that is not.
    return min(near, key=lambda one: (abs(one.time_s - at_s), one.fault != car))


def _places(log: RaceLog, index: int) -> list[FrozenCar]:
    """Where all cars are in a sample, and how they move."""
    track, sample = load_track(log.circuit), log.samples[index]
    about = progress(log)[index] + origin(log)
    along, lateral, heading = _located(track, sample["x_m"], sample["y_m"], sample["yaw_rad"], about)
    return [
        FrozenCar(
            progress_m=round(float(along[each]), 3),
            lateral_m=round(float(lateral[each]), 3),
            heading_rad=round(float(heading[each]), 4),
            speed_m_s=round(float(sample["velocity_x_m_s"][each]), 3),
            side_speed_m_s=round(float(sample["velocity_y_m_s"][each]), 3),
            yaw_rate_rad_s=round(float(sample["yaw_rate_rad_s"][each]), 4),
        )
        for each in range(len(log.names))
    ]


def _located(
    track: Track,
    x: NDArray[np.float64],
    y: NDArray[np.float64],
    yaw: NDArray[np.float64],
    about: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Progress, place left of the centre line and heading of cars (C,), near `about` (C,); m, rad."""
    reach = np.arange(-round(WINDOW_M / track.spacing), round(WINDOW_M / track.spacing) + 1)
    rows = (np.round(about / track.spacing).astype(np.int64)[:, None] + reach) % len(track.table)
    away = (track.table[rows, X] - x[:, None]) ** 2 + (track.table[rows, Y] - y[:, None]) ** 2
    row = rows[np.arange(len(x)), away.argmin(axis=1)]
    tangent = track.table[row][:, [TANGENT_X, TANGENT_Y]]
    apart = np.stack([x, y], axis=1) - track.table[row][:, [X, Y]]
    lapped = row * track.spacing + (apart * tangent).sum(axis=1)
    along = lapped + track.length * np.round((about - lapped) / track.length)
    _, _, direction = track.pose(along, np.zeros(len(x)))
    lateral = tangent[:, 0] * apart[:, 1] - tangent[:, 1] * apart[:, 0]
    return along, lateral, np.arctan2(np.sin(yaw - direction), np.cos(yaw - direction))


def _of_those(values: float | tuple[float, ...], cars: Sequence[int]) -> float | tuple[float, ...]:
    return tuple(values[car] for car in cars) if isinstance(values, tuple) else values
