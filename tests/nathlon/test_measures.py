"""Measures: what a run comes to, from the rows of one race."""

from __future__ import annotations

from typing import Any

import pytest

from nathlon.selection.battery.measures import MEASURES
from tests.support.race_results import DEFAULTS


def row(**columns: Any) -> dict[str, Any]:
    return DEFAULTS | columns


def mark(measure: str, own: dict[str, Any], *others: dict[str, Any]) -> float | None:
    return MEASURES[measure].mark(own, others)


def test_measures_of_the_own_row() -> None:
    own = row(race_time_s=405.0, best_lap_s=100.5, laps=4, distance_m=23_000.0, place=3)
    assert mark("time", own) == 405.0
    assert mark("best_lap", own) == 100.5
    assert mark("lap_loss", own) == pytest.approx(0.75)
    assert mark("distance", own) == 23_000.0
    assert mark("place", own) == 3.0


def test_the_lead_is_over_the_best_opponent() -> None:
    own = row(race_time_s=20.0)
    assert mark("lead", own, row(race_time_s=21.5), row(race_time_s=24.0)) == pytest.approx(1.5)
    assert mark("lead", own, row(race_time_s=19.0), row(race_time_s=24.0)) == pytest.approx(-1.0)


def test_an_opponent_that_did_not_finish_counts_as_finishing_when_its_run_ended() -> None:
    own = row(race_time_s=20.0)
    assert mark("lead", own, row(race_time_s=None, driven_s=40.0)) == pytest.approx(20.0)
    assert mark("lead", own, row(race_time_s=None, driven_s=40.0), row(race_time_s=22.0)) == pytest.approx(
        2.0
    )


def test_who_did_not_finish_has_set_no_time_but_may_have_set_a_lap() -> None:
    own = row(race_time_s=None, best_lap_s=100.0)
    assert [mark(name, own, row()) for name in ("time", "lap_loss", "lead")] == [None] * 3
    assert mark("best_lap", own) == 100.0
    assert mark("best_lap", row(best_lap_s=None)) is None


def test_pace_is_over_the_time_driven_and_with_penalties_where_there_is_a_finish() -> None:
    assert mark("pace", row(distance_m=4000.0, driven_s=100.0, race_time_s=None)) == pytest.approx(40.0)
    assert mark("pace", row(distance_m=4000.0, driven_s=100.0, race_time_s=125.0)) == pytest.approx(32.0)
    assert mark("pace", row(distance_m=0.0, driven_s=0.0, race_time_s=None)) is None


def test_who_stopped_is_stuck_or_at_fault() -> None:
    endings = {"finished": 0.0, "time_up": 0.0, "stuck": 1.0, "policy_raised": 1.0, "timed_out": 1.0}
    assert {ending: mark("stopped", row(ending=ending)) for ending in endings} == endings


def test_less_is_better_in_times_and_places() -> None:
    kinds = {name: measure.kind for name, measure in MEASURES.items()}
    assert {name for name, kind in kinds.items() if kind == "distance"} == {
        "lead",
        "distance",
        "pace",
        "score",
    }
