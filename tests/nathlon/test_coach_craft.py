"""What the coach tells of a car among others, in a race whose every number is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from nathlon.arena.race_log import RaceLog
from nathlon.lab.coach.craft import craft_of, traffic
from nathlon.lab.coach.words import told_mishaps
from nathlon.results.coach import Mishap
from tests.support.race_logs import oval_race


@pytest.fixture(scope="module")
def log() -> RaceLog:
    return oval_race(cars=3)


def test_a_contact_is_told_from_the_side_of_each_car(log: RaceLog) -> None:
    [hit], [hitting] = craft_of(log, 0).contacts, craft_of(log, 1).contacts
    assert (hit.fault, hit.car) == ("other", f"2 {log.names[1]}")
    assert (hitting.fault, hitting.car) == ("own", f"1 {log.names[0]}")
    assert hit.at_s == hitting.at_s == pytest.approx(10.0)
    assert hit.closing_m_s == pytest.approx(4.2, abs=0.1)
    assert craft_of(log, 2).contacts == ()


def test_who_is_close_behind_for_long_presses(log: RaceLog) -> None:
    # The cars start 9 m apart, and each is slower than the one before it.
    pressed = craft_of(log, 0).defences
    assert [one.car for one in pressed] == [f"2 {log.names[1]}"]
    [one] = pressed
    assert one.held
    assert one.closest_m == pytest.approx(9.0, abs=0.1)
    behind = log.samples["distance_m"][:, 0] - log.samples["distance_m"][:, 1]
    assert one.until_s == pytest.approx(log.time_s[np.flatnonzero(behind < 15.0)[-1]], abs=0.11)
    assert craft_of(log, 2).defences == ()


def test_traffic_is_the_nearest_car_ahead(log: RaceLog) -> None:
    near = traffic(log, 1, 0.0, 1.0)
    assert near is not None
    assert near[0] == pytest.approx(9.0, abs=0.1)
    assert near[1] == f"1 {log.names[0]}"
    assert traffic(log, 0, 0.0, 1.0) is None


def test_a_car_that_is_out_is_no_traffic(log: RaceLog) -> None:
    samples = log.samples.copy()
    samples["driving"][:, 0] = False
    assert traffic(replace(log, samples=samples), 1, 0.0, 1.0) is None


def test_of_many_mishaps_only_the_number_is_told() -> None:
    some = [Mishap(at_s=10.0 * i, kind="wall", penalty_s=0.0, text=f"hits it, {i}") for i in range(4)]
    few = told_mishaps(some)
    assert few[3] == "at 30.0 s: hits it, 3"
    given = [Mishap(at_s=15.0 + i, kind="penalty", penalty_s=1.5, text="cuts") for i in range(4)]
    assert told_mishaps([*some, *given]) == [
        "hits the wall 4 times, first at 0.0 s",
        "is given a penalty 4 times, first at 15.0 s, 6 s in all",
    ]
