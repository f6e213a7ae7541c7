"""What is told of strategists, and when an even plan stops."""

from __future__ import annotations

import pytest

from benchmarks.strategy_env import LAPS, Raced, even, figures


def test_an_even_plan_stops_at_the_ends_of_its_stints() -> None:
    plan = even(2, 3)
    assert [step for step in range(LAPS + 1) if plan(None, step)] == [0, 4, 8]
    assert {plan(None, step) for step in (0, 4, 8)} == {3}


def test_places_are_gained_on_the_planner_in_the_same_race() -> None:
    planner = [Raced(-50.0, True, 1350.0, place, 2) for place in (3, 4, 5)]
    one = [Raced(-40.0, True, 1340.0, place, 1) for place in (2, 3, 4)]
    told = figures(one, planner)
    assert told["gained"] == [1.0, 1.0, 1.0]
    assert told["place"] == pytest.approx(3.0)


def test_the_time_is_that_of_races_that_were_finished() -> None:
    races = [Raced(-40.0, True, 1340.0, 2, 1), Raced(-640.0, False, 900.0, 8, 0)]
    told = figures(races, races)
    assert told["time_s"] == 1340.0
    assert told["finished"] == 0.5
    assert figures(races[1:] * 2, races)["time_s"] is None
