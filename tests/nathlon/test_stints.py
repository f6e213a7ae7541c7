"""Plans of stops: the model of laps, the search, and what the command leaves."""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import nathlon
from nathlon.lab.stints.model import LapModel, fit, stint_model
from nathlon.lab.stints.planning import StopPlan, plans
from nathlon.lab.stints.practice import LAPS, Place, _Begin, _rows, with_settings
from nathlon.policies.sources.composite import CompositeSource
from nathlon.policies.stint_planner import StintPlanner
from nathlon.policies.stint_search import SPARE_KG
from nathlon.policies.strategy import PitWall
from nathlon.sim.errors import InputError
from nathlon.sim.rules import PitParameters
from nathlon.sim.scenario import load_scenario

COMPOUNDS = ("racing-soft", "racing-hard")
FRESH, WEAR, FUEL_S, START_S, STOP_S, USED = (100.0, 101.5), (1.5, 0.4), 0.03, 6.0, 14.0, 4.0
WORN = (0.12, 0.07)
PIT = PitParameters(tyres=8.0, fuel_rate=2.0, together=False)


def lap_s(compound: int, age: int, fuel_kg: float) -> float:
    return FRESH[compound] + WEAR[compound] * (age - 1) ** 2 + FUEL_S * fuel_kg


def practised(laps: int, noise: float, rng: np.random.Generator, runs: int = 4) -> pl.DataFrame:
    """LAPS of a car whose truth is known."""
    rows = []
    for compound, run in itertools.product(range(2), range(runs)):
        fuel, age = 80.0 - 20.0 * (run % 2), 1
        stop = laps // 2 if run % 2 else laps
        lap = 1
        while lap <= laps:
            stops = age == stop and stop < laps
            taken = lap_s(compound, age, fuel) + (START_S if lap == 1 else 0.0) + noise * rng.normal()
            weight = fuel
            if stops:
                taken += lap_s(compound, 1, fuel - USED) + STOP_S
                weight += fuel - USED
            rows.append(
                (COMPOUNDS[compound], run, lap == 1, age, stops, weight, USED, WORN[compound] * age, taken)
            )
            lap, age = (lap + 2, 2) if stops else (lap + 1, age + 1)
            fuel -= 2 * USED if stops else USED
    return pl.DataFrame(rows, schema=LAPS, orient="row")


def truth(stints: list[tuple[int, int]], fuels: list[float]) -> float:
    """What a race takes that is driven in stints of (compound, laps), each begun with so much fuel, s."""
    total, left = START_S, fuels[0]
    for number, ((compound, laps), fuel) in enumerate(zip(stints, fuels, strict=True)):
        if number:
            total += STOP_S + PIT.tyres + max(fuel - left, 0.0) / PIT.fuel_rate
        left = max(fuel, left)
        total += sum(lap_s(compound, lap + 1, left - lap * USED) for lap in range(laps))
        left -= laps * USED
    return total


def least(stints: list[tuple[int, int]]) -> float:
    """The same with the fuel with which it takes least: at the start up to some stop, then by stints."""
    needs = [laps * USED + SPARE_KG for _, laps in stints]
    carried = [
        sum(laps for _, laps in stints[: number + 1]) * USED + SPARE_KG for number in range(len(needs))
    ]
    return min(truth(stints, [start, *needs[1:]]) for start in carried)


def of(plan: StopPlan) -> list[tuple[int, int]]:
    return [(COMPOUNDS.index(str(stint.compound)), stint.laps) for stint in plan.stints]


def taken(plan: StopPlan) -> float:
    return truth(of(plan), [float(stint.fuel_kg or 0.0) for stint in plan.stints])


def test_races_take_what_the_model_says() -> None:
    model = fit(practised(8, 0.0, np.random.default_rng(1)))
    for plan in plans(model, 12, PIT, 80.0, 3):
        assert plan.seconds(model) == pytest.approx(taken(plan), abs=1e-6)


@settings(max_examples=15, deadline=None)
@given(laps=st.integers(4, 9), stops=st.integers(0, 2))
def test_no_other_stints_are_faster(laps: int, stops: int) -> None:
    model = fit(practised(6, 0.0, np.random.default_rng(1)))
    ways = [
        least(list(zip(compounds, lengths, strict=True)))
        for lengths in itertools.product(range(1, 7), repeat=stops + 1)
        if sum(lengths) == laps
        for compounds in itertools.product(range(2), repeat=stops + 1)
    ]
    found = [plan for plan in plans(model, laps, PIT, 80.0, 2) if plan.stops == stops]
    assert len(found) == bool(ways)
    for plan in found:
        assert plan.seconds(model) == pytest.approx(min(ways), abs=0.2)


def test_a_policy_may_be_slower_with_less_fuel() -> None:
    """As one that has learnt on full tanks: what a kilogram costs is what practice says."""
    laps = practised(8, 0.0, np.random.default_rng(1)).with_columns(
        lap_s=pl.col("lap_s") - 2.0 * FUEL_S * pl.col("fuel_kg")
    )
    assert stint_model(fit(laps)).fuel_s_kg == pytest.approx(-FUEL_S)


def test_intervals_hold_what_is_true() -> None:
    """Of the difference of two plans, in 95 % of practices."""
    inside = []
    for seed in range(60):
        model = fit(practised(8, 0.5, np.random.default_rng(seed)))
        first, second, *_ = plans(model, 12, PIT, 80.0, 3)
        gap, half = second.behind(first, model)
        inside.append(abs(gap - (taken(second) - taken(first))) <= half)
    assert np.mean(inside) >= 0.88


def test_a_stint_never_lasts_longer_than_was_practised() -> None:
    model = fit(practised(5, 0.0, np.random.default_rng(1)))
    assert all(stint.laps <= 5 for plan in plans(model, 12, PIT, 80.0, 4) for stint in plan.stints)
    with pytest.raises(InputError, match="12 laps: no plan of 1 stops or fewer, each stint at most 5 laps"):
        plans(model, 12, PIT, 80.0, 1)


def test_tyres_are_planned_for_as_long_as_the_policy_came_round_on_them() -> None:
    laps = practised(8, 0.0, np.random.default_rng(1)).filter(
        (pl.col("compound") == COMPOUNDS[1]) | (pl.col("age") <= 3)
    )
    model = fit(laps)
    assert [len(compound.lap_s) for compound in stint_model(model).compound] == [3, 8]
    found = plans(model, 8, PIT, 80.0, 3)
    soft = [laps for plan in found for compound, laps in of(plan) if compound == 0]
    assert soft
    assert max(soft) <= 3


def test_a_small_tank_makes_short_stints() -> None:
    model = fit(practised(8, 0.0, np.random.default_rng(1)))
    assert all(stint.laps <= 3 for plan in plans(model, 6, PIT, 15.0, 5) for stint in plan.stints)


def test_tyres_and_fuel_together_take_the_longer_time() -> None:
    model: LapModel = fit(practised(8, 0.0, np.random.default_rng(1)))
    together = PIT._replace(together=True)
    for one, other in zip(plans(model, 12, PIT, 80.0, 1), plans(model, 12, together, 80.0, 1), strict=True):
        assert other.service_s <= one.service_s


def test_one_run_on_each_compound_is_too_few() -> None:
    with pytest.raises(InputError, match="expected at least two runs"):
        fit(practised(6, 0.0, np.random.default_rng(1), runs=1).filter(pl.col("compound") == COMPOUNDS[0]))


def test_settings_of_a_scenario_are_kept() -> None:
    assert with_settings("grand_prix_stops:laps=9", cars=1) == "grand_prix_stops:laps=9,cars=1"
    assert Place.alone("grand_prix_stops", "lindenring", "gt3").scenario == "grand_prix_stops:cars=1,laps=12"


def test_practice_is_in_the_dry() -> None:
    """Whatever falls in the race: rain would pass for worn tyres."""
    practised = load_scenario(Place.alone("grand_prix_rain", "lindenring", "gt3").scenario)
    assert practised.wear_rate == load_scenario("grand_prix_rain").wear_rate
    assert not any(one.rain_mm_h(300.0, 3) for one in practised.weather)


@pytest.mark.parametrize("scenario", ["grand_prix", "standing_start"])
def test_nothing_is_planned_where_nothing_wears(scenario: str) -> None:
    with pytest.raises(InputError, match="expected a race of two laps or more on tyres that wear"):
        Place.alone(scenario, "lindenring", "gt3")


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"compounds": ["soft"]}, "compounds is 'soft', expected some of "),
        ({"compounds": []}, "compounds is '', expected some of "),
        ({"compounds": ["racing-soft"] * 2}, "compounds is 'racing-soft, racing-soft', expected each once"),
        ({"scenario": "grand_prix_stops:laps=1"}, "expected a race of two laps or more on tyres that wear"),
    ],
)
def test_what_cannot_be_practised_is_refused(given: dict[str, Any], said: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=said):
        nathlon.stints("driver:pace=0.9", out=tmp_path, progress=False, **given)


@pytest.mark.parametrize("after_line", [False, True])
def test_a_stop_is_in_the_lap_that_was_asked_for_or_refused(after_line: bool) -> None:
    """The box lies before the line or behind it: the stop is told with the one lap or the next."""

    def begun(missed: int) -> list[_Begin]:
        stop = 2 + after_line + missed
        return [_Begin(100.0 * lap, 50.0 - lap, 0.1 * lap, int(lap >= stop), missed) for lap in range(6)]

    rows = _rows("racing-soft", 2, begun(0), 8.0)
    assert [(age, stops) for _, _, _, age, stops, *_ in rows] == [
        (1, False),
        (2, True),
        (2, False),
        (3, False),
    ]
    with pytest.raises(InputError, match="on racing-soft came to the pit lane too fast"):
        _rows("racing-soft", 2, begun(1), 8.0)


def test_plans_are_entrants(tmp_path: Path) -> None:
    result = nathlon.stints(
        "driver:pace=0.9",
        scenario="grand_prix_stops:laps=3",
        compounds=COMPOUNDS,
        stops=1,
        workers=1,
        out=tmp_path / "not" / "there",
        progress=False,
    )
    assert sorted(file.name for file in result.files) == ["0-stops.toml", "1-stops.toml"]
    assert result.table["expected_s"].is_sorted()
    assert result.table["behind_s"][0] == 0.0
    for plan, file in zip(result.plans, result.files, strict=True):
        assert CompositeSource.read(file).file.stint == plan.stints
    assert sum(stint.laps for stint in result.plans[0].stints) == 3
    assert (result.folder / "laps.csv").is_file()
    kept = CompositeSource.read(result.planner).file
    assert kept.planner == stint_model(result.model)
    assert kept.strategy_label == "planner"


def test_a_planner_begins_as_the_fastest_plan() -> None:
    """Both come from the same practice, by dynamic programming of their own."""
    model = fit(practised(8, 0.2, np.random.default_rng(3)))
    best, *_ = plans(model, 12, PIT, 80.0, 3)
    nothing = np.zeros(1)
    wall = PitWall(
        car=0,
        laps=12,
        lap=0,
        ends_lap=1,
        wear=np.zeros(4),
        fuel_kg=80.0,
        last_lap_s=nothing,
        gap_s=nothing,
        compounds=("racing-medium",),
        laps_done=np.zeros(1, int),
        stops=np.zeros(1, int),
        pit=PIT,
        tank_kg=80.0,
        penalty_s=np.zeros(1),
    )
    assert StintPlanner(stint_model(model)).start(wall) == best.stints[0].service


def test_a_model_in_a_file_has_new_tyres_that_are_a_little_faster_than_old_ones() -> None:
    """Practice does not part them from start and stop; sums over races stay."""
    kept = stint_model(fit(practised(8, 0.0, np.random.default_rng(1))))
    assert kept.start_s + kept.compound[0].lap_s[0] == pytest.approx(START_S + lap_s(0, 1, 0.0), abs=1e-3)
    assert kept.stop_s + kept.compound[1].lap_s[0] == pytest.approx(STOP_S + lap_s(1, 1, 0.0), abs=1e-3)
    assert kept.stop_s == pytest.approx(STOP_S, abs=3.0)
