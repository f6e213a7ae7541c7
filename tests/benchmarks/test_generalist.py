"""Kinds of circuits and grounds on which one policy is measured."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from benchmarks.generalist import Row, brakes_hard, summary
from benchmarks.loose_ground import GROUNDS, car_on, scenario_on
from nathlon.sim.car import load_car
from nathlon.sim.scenario import load_scenario
from nathlon.sim.track import CURVATURE, TABLE_WIDTH, Track

SPACING_M = 2.0


def lap(straight_m: float, radius_m: float, shift: int = 0) -> Track:
    """A lap of a straight, a bend of 60 m and gentle bends, which begins anywhere."""
    rows, straight, bend = 1000, round(straight_m / SPACING_M), round(60.0 / SPACING_M)
    table = np.zeros((rows, TABLE_WIDTH))
    table[straight : straight + bend, CURVATURE] = -1.0 / radius_m
    table[straight + bend :, CURVATURE] = 1.0 / 200.0
    return cast(Track, SimpleNamespace(table=np.roll(table, shift, axis=0), spacing=SPACING_M))


@pytest.mark.parametrize("shift", [0, 40, 930])
@pytest.mark.parametrize(
    ("straight_m", "radius_m", "hard"), [(320, 20, True), (280, 20, False), (320, 45, False)]
)
def test_who_brakes_hard_has_a_long_straight_before_a_tight_bend(
    straight_m: float, radius_m: float, hard: bool, shift: int
) -> None:
    assert brakes_hard(lap(straight_m, radius_m, shift)) is hard


def test_on_loose_ground_tyres_peak_later_and_no_lower(tmp_path: Path) -> None:
    gravel = next(ground for ground in GROUNDS if ground.name == "gravel")
    car, parent = load_car(car_on(gravel, "gt3", tmp_path)), load_car("gt3")
    assert car.tyre.peak_slip_ratio == pytest.approx([2 * slip for slip in parent.tyre.peak_slip_ratio])
    assert car.tyre.friction_lateral == parent.tyre.friction_lateral
    assert car.brakes.abs_slip == pytest.approx(2 * parent.brakes.abs_slip)
    assert load_scenario(scenario_on(gravel, tmp_path)).grip.tarmac == gravel.grip


def test_pairs_together_count_by_races() -> None:
    row: Row = {"at_fault_per_km": 0.0, "off_course_share": 0.0, "driver_ratio": 1.0, "wins_from_back": 1}
    rows = [
        row | {"races": 1, "finished": 1, "mean_place": 2.0},
        row | {"races": 3, "finished": 2, "mean_place": 6.0, "driver_ratio": None},
    ]
    whole = summary(rows)
    assert (whole["mean_place"], whole["finished_share"], whole["wins_share"]) == (5.0, 0.75, 0.5)
    assert (whole["no_lap"], whole["driver_ratio_worst"]) == (1, None)
