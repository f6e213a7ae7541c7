"""What a planner's races against fixed plans come to over all circuits."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import polars as pl
import pytest

from benchmarks import strategy
from benchmarks.strategy import summary
from nathlon.arena.match import Match, Race, Seat

ALONE: dict[str, Any] = {
    "alone": {"planner": [1002.0, 1004.0], "1 stops": [1000.0, 1001.0], "2 stops": [1010.0, 1000.0]},
    "expected_s": {"1 stops": 1000.0, "2 stops": 1010.0},
    "fields": [{"strategies": ["planner", "1 stops"], "races": [], "lap_wise": 9.0}],
}


def raced(first: str, second: str, *places: tuple[float, float]) -> dict[str, Any]:
    races = [
        {"places": dict(zip((first, second), one, strict=True)), "hours": 0.5, "wall_s": 60.0}
        for one in places
    ]
    return {"strategies": [first, second], "races": races, "lap_wise": 12.0}


IN_FIELD = ALONE | {
    "fields": [
        raced("planner", "1 stops", (9.0, 12.0), (11.0, 10.0)),
        raced("1 stops", "2 stops", (8.0, 13.0)),
    ]
}


def test_the_best_plan_is_that_of_each_seed() -> None:
    told = summary({"one": ALONE})
    assert told["within_0.3_percent"] == 0.5
    assert (told["places_gained"], told["places_error"], told["hours_a_minute"]) == (None, None, None)


def test_a_plan_counts_in_the_races_whose_end_it_came_to() -> None:
    """Where no plan did, there is nothing to hold the planner against."""
    some = {"planner": [1002.0, 1004.0, None, 990.0], "1 stops": [1000.0, None, 1000.0, None]}
    told = summary({"one": {"alone": some, "expected_s": {"1 stops": 1010.0}, "fields": []}})
    assert (told["races"], told["near"], told["within_0.3_percent"]) == (2, 1, 0.5)
    assert told["model_error"] == 0.01
    none = {"alone": {"planner": [1002.0], "1 stops": [None]}, "expected_s": {}, "fields": []}
    told = summary({"one": none})
    assert (told["races"], told["within_0.3_percent"], told["model_error"]) == (0, None, None)


def test_places_are_those_of_the_fields_that_were_driven() -> None:
    """The planner gains on the best plan alone; the model is also tried on plans against each other."""
    told = summary({"one": ALONE, "other": IN_FIELD})
    assert told["places_gained"] == 1.0
    assert told["places_error"] == 3.0
    assert told["hours_a_minute"] == 0.5


def test_a_match_that_was_driven_is_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    driven = []

    def drive(match: Match, _: object) -> pl.DataFrame:
        driven.append(match.races[0].seed)
        return pl.DataFrame({"race_time_s": [100.0 + match.races[0].seed]})

    monkeypatch.setattr(strategy, "run_match", drive)
    monkeypatch.setattr(strategy, "match_policies", lambda match: [])

    def race_time_s(seed: int) -> float:
        races = [Race(seed, (Seat(0),))]
        results = strategy.run(["driver"], "grand_prix_stops:cars=1", "lindenring", races, tmp_path)
        return float(results["race_time_s"][0])

    assert [race_time_s(1), race_time_s(2), race_time_s(1)] == [101.0, 102.0, 101.0]
    assert driven == [1, 2]
