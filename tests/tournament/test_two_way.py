"""Policies crossed with strategies: effects are told apart, with intervals that hold what is true."""

from __future__ import annotations

import numpy as np
import polars as pl
import pytest

from nathlon.arena.results import STRATEGIES
from nathlon.tournament.records import records
from nathlon.tournament.two_way import CrossedEntrant, crossed, two_way
from tests.support.race_results import rows

POLICIES, PLANS = {"quick": 1.0, "calm": -1.0}, {"1 stop": 0.0, "2 stops": 1.5, "planner": -1.5}
CELLS = {f"{policy}/{plan}": CrossedEntrant(policy, plan) for policy in POLICIES for plan in PLANS}


def results(units: int, rng: np.random.Generator, together: float = 0.0) -> pl.DataFrame:
    """Races of six cars, a unit's luck the same for all; `together` is what one pair has beside."""
    races = units * len(CELLS)
    points = np.zeros((races, len(CELLS)))
    luck = np.repeat(3.0 * rng.standard_normal(units), len(CELLS))
    for number, cell in enumerate(CELLS.values()):
        points[:, number] = 5.0 + luck + POLICIES[cell.policy] + PLANS[cell.strategy]
    points[:, 0] += together
    points += 0.5 * rng.standard_normal(points.shape)
    race, car = np.indices(points.shape)
    columns = {
        "race": race.ravel(),
        "car": car.ravel(),
        "entrant": np.array(list(CELLS))[car.ravel()],
        "points": points.ravel(),
    }
    return rows(columns, points.size)


def test_effects_are_told_apart_whatever_a_unit_does_to_all() -> None:
    table = two_way(results(20, np.random.default_rng(1)), CELLS)
    assert table.schema == STRATEGIES
    assert table["units"].to_list() == [20] * 11
    for name, effect in {**POLICIES, **PLANS}.items():
        [row] = [row for row in table.iter_rows(named=True) if {row["policy"], row["strategy"]} == {name, ""}]
        assert row["effect"] == pytest.approx(effect, abs=0.15)
        assert row["effect_high"] - row["effect_low"] < 0.4
        assert row["points_high"] - row["points_low"] > 1.0
    assert table["entrant"].drop_nulls().to_list() == list(CELLS)


def test_what_two_have_only_together_is_no_effect_of_either() -> None:
    table = two_way(results(20, np.random.default_rng(2), together=3.0), CELLS)
    [row] = table.filter(pl.col("entrant") == "quick/1 stop").iter_rows(named=True)
    assert row["effect"] == pytest.approx(3.0 * (1 - 1 / 2) * (1 - 1 / 3), abs=0.15)
    assert row["effect_low"] > 0.5


def test_intervals_hold_the_truth_as_often_as_they_say() -> None:
    rng, inside = np.random.default_rng(3), 0
    for _ in range(100):
        table = two_way(results(6, rng), CELLS)
        [row] = table.filter(strategy="2 stops", policy="").iter_rows(named=True)
        inside += row["effect_low"] <= PLANS["2 stops"] <= row["effect_high"]
    assert inside >= 88


def test_points_are_those_of_one_car_as_in_the_ranking() -> None:
    rng = np.random.default_rng(6)
    alone = results(4, rng)
    second = alone.filter(pl.col("car") < 2).with_columns(
        car=pl.col("car") + 6, points=pl.col("points") + 1.0
    )
    raced = pl.concat([alone, second])  # the first two entrants have two cars each
    table = two_way(raced, CELLS).drop_nulls("entrant").sort("entrant")
    means = records(raced, rng).sort("entrant")
    assert table["points"].to_list() == pytest.approx(means["mean"].to_list())


def test_one_unit_has_no_interval() -> None:
    table = two_way(results(1, np.random.default_rng(4)), CELLS)
    assert table["effect"].is_not_null().all()
    assert table["effect_low"].null_count() == table.height


def test_only_policies_with_every_strategy_are_in_the_layout() -> None:
    with_alone = CELLS | {"alone": CrossedEntrant("slow", "1 stop")}
    assert crossed(with_alone) == CELLS
    assert crossed({"a": CrossedEntrant("a", "planner"), "b": CrossedEntrant("b", "planner")}) == {}
    assert two_way(results(2, np.random.default_rng(5)), {}).is_empty()
