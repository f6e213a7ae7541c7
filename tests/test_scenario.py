"""Scenarios: where cars are put, and what is said about faulty files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim.errors import InputError
from sim.scenario import SAFE_LATERAL, SCENARIOS, load_scenario, read_scenario
from sim.track import CURVATURE, load_track

TRACK = load_track("lindenring")
NAMES = sorted(path.stem for path in SCENARIOS.glob("*.toml"))
seeds = st.integers(0, 2**63 - 1)


@pytest.mark.parametrize("name", NAMES)
def test_shipped_scenario_puts_all_its_cars_on_free_places(name: str) -> None:
    scenario = load_scenario(name)
    assert scenario.name == name
    for seed in range(20):
        start = scenario.place(TRACK, np.random.default_rng(seed))
        again = scenario.place(TRACK, np.random.default_rng(seed))
        for array, same in zip(vars(start).values(), vars(again).values(), strict=True):
            assert array.shape == (scenario.cars,)
            assert np.isfinite(array).all() or array is start.finish
            np.testing.assert_array_equal(array, same)
        # In starting order, and no car inside another: they are 4.65 m long.
        assert (np.diff(start.distance) < -4.65).all()
        assert (start.finish > start.distance).all()


@given(seeds)
def test_grid_is_staggered_behind_the_line(seed: int) -> None:
    scenario = load_scenario("race")
    start = scenario.place(TRACK, np.random.default_rng(seed))
    grid = TRACK.grid
    np.testing.assert_allclose(start.distance, grid.pole_m - grid.spacing_m * np.arange(8), atol=0.3)
    np.testing.assert_allclose(start.lateral, grid.lateral_m * (-1.0) ** np.arange(8), atol=0.3)
    assert (start.distance < 0).all()
    assert (start.speed == 0).all()
    assert (start.finish == 2 * TRACK.length).all()


@given(seeds)
def test_rolling_start_is_drawn_from_its_spans(seed: int) -> None:
    start = load_scenario("chicane_in_traffic").place(TRACK, np.random.default_rng(seed))
    assert 4085.0 <= start.distance[0] <= 4095.0
    gaps = -np.diff(start.distance)
    assert ((gaps >= 11.0) & (gaps <= 15.0)).all()
    assert (np.abs(start.lateral) <= 2.5).all()
    assert len(set(start.speed)) == 1
    assert 42.0 <= start.speed[0] <= 44.0
    assert (start.finish == 4800.0).all()


@given(seeds)
def test_start_anywhere_is_no_faster_than_the_next_bend_allows(seed: int) -> None:
    start = load_scenario("1v3").place(TRACK, np.random.default_rng(seed))
    assert (start.finish == np.inf).all()
    along = np.arange(len(TRACK.table)) * TRACK.spacing
    for distance, speed in zip(start.distance[1:], start.speed[1:], strict=True):
        ahead = np.mod(along - distance, TRACK.length) < 100.0
        assert speed**2 * np.abs(TRACK.table[ahead, CURVATURE]).max() <= SAFE_LATERAL * 1.001


def test_start_anywhere_covers_the_lap() -> None:
    scenario, rng = load_scenario("1v0"), np.random.default_rng(0)
    distance = np.array([scenario.place(TRACK, rng).distance[0] for _ in range(400)])
    # Of 400 even draws, a tenth of the lap gets 40 with a deviation of 6.
    counts, _ = np.histogram(distance, 10, (0.0, TRACK.length))
    assert counts.sum() == 400
    assert counts.min() > 40 - 4 * 6
    assert counts.max() < 40 + 4 * 6


GOOD = """
name = "test"
description = ""
cars = 2
laps = 1
time_s = 60.0
[start]
kind = "grid"
"""


@pytest.mark.parametrize(
    ("old", "new", "complaint"),
    [
        ("cars = 2", "cars = 0", "field cars is 0: .*greater than or equal to 1"),
        ("cars = 2", "cars = 2.5", "field cars is 2.5: .*integer"),
        ("cars = 2", "", "field cars: Field required"),
        ("cars = 2", "cars = 2\nboats = 1", "field boats: Extra"),
        ("laps = 1", "laps = 1\nfinish_m = 100.0", "laps and finish_m exclude each other"),
        ("time_s = 60.0", "time_s = -1.0", "field time_s is -1.0"),
        ("time_s = 60.0", "time_s = inf", "field time_s is inf"),
        ('kind = "grid"', 'kind = "flying"', "field start .*'grid', 'rolling', 'anywhere'"),
        ('kind = "grid"', 'kind = "rolling"', "field start.rolling.leader_m: Field required"),
        ("[start]", "[start", "not a TOML file"),
    ],
)
def test_faulty_field_is_named(tmp_path: Path, old: str, new: str, complaint: str) -> None:
    path = tmp_path / "scenario.toml"
    path.write_text(GOOD)
    assert load_scenario(str(path)).cars == 2
    path.write_text(GOOD.replace(old, new))
    with pytest.raises(InputError, match=complaint) as caught:
        read_scenario(path)
    assert str(caught.value).startswith(f"{path}: ")


def test_unknown_scenario_lists_the_known() -> None:
    with pytest.raises(InputError, match="scenario '1v99' is unknown; expected one of 1v0, 1v1"):
        load_scenario("1v99")
    with pytest.raises(InputError, match=r"nowhere\.toml: cannot read the scenario file"):
        load_scenario("nowhere.toml")
