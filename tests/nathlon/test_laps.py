"""Laps that reports show are those of the results, and the course is the circuit's."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest

from benchmarks.result import RESULTS, read_result
from nathlon.arena.entrant import enter, entrants_table
from nathlon.arena.match import Match
from nathlon.arena.pool import Pool
from nathlon.arena.recorder import record_races
from nathlon.arena.results import BATTERY, LAPS
from nathlon.arena.runner import run_match
from nathlon.arena.store import Store
from nathlon.policies.driver import Driver
from nathlon.policies.load import load_policy
from nathlon.selection.publish.lap_limits import SHIPPED, keep_limit, known_limit, place_digests
from nathlon.selection.publish.laps import (
    STEP_M,
    describe_course,
    keep_laps,
    lap_limit,
    lap_of,
)
from nathlon.selection.trials import against
from nathlon.sim.data_file import DATA
from nathlon.sim.track import load_track

DRIVER = "driver:pace=0.9"
PLACE = "lindenring", "gt3"


@pytest.fixture(scope="module")
def match() -> Match:
    return against("pareto", "time_trial", "time_trial", enter(DRIVER, *PLACE), [], [1], [5, 6])


@pytest.fixture(scope="module")
def results(match: Match) -> pl.DataFrame:
    return run_match(match, [load_policy(DRIVER, *PLACE)])


def test_the_lap_is_the_one_that_was_timed(match: Match, results: pl.DataFrame) -> None:
    recorded = record_races(match, [load_policy(DRIVER, *PLACE)], [1], [DRIVER])
    [timed] = results.filter(pl.col("race") == 1)["best_lap_s"]
    lap = lap_of(recorded.logs[0], timed)
    assert lap["time_s"][-1] == pytest.approx(timed, abs=0.001)
    assert lap["time_s"].is_sorted()
    # From place to place at its speed takes as long as it says.
    way = np.hypot(np.diff(lap["x_m"]), np.diff(lap["y_m"]))
    speed = lap["speed_m_s"].to_numpy()
    seconds = 2 * way / (speed[1:] + speed[:-1])
    assert seconds.sum() == pytest.approx(timed, rel=0.003)
    assert lap["pedals"].is_between(-1.0, 1.0).all()


def test_the_course_is_the_circuit_with_the_drivers_line() -> None:
    course, track = describe_course(*PLACE), load_track(PLACE[0])
    at = course["distance_m"].to_numpy()
    assert at[-1] == pytest.approx(track.length, abs=0.01)
    assert np.diff(at) == pytest.approx(STEP_M, rel=0.01)
    line = course.select("x_m", "y_m").to_numpy()
    assert line[0] == pytest.approx(line[-1])
    assert course["time_s"][-1] == pytest.approx(Driver(*PLACE).line.lap_s, abs=0.002)
    assert course["section"][0] == "Startgerade"
    # Between the edges: what is left of the one is right of the other.
    left, right = (course.select(f"{side}_x_m", f"{side}_y_m").to_numpy() for side in ("left", "right"))
    across = left - right
    share = ((line - right) * across).sum(axis=1) / (across**2).sum(axis=1)
    assert -0.2 < share.min() < 0.2
    assert 0.8 < share.max() < 1.2


def test_laps_are_driven_once(tmp_path: Path, match: Match, results: pl.DataFrame) -> None:
    finalist = {"entrant": DRIVER, "shortlisted": True}
    with Store(tmp_path / "store.sqlite") as store, Pool(1) as pool:
        store.begin_run("night-0001", {})
        store.add_match(match.key, "pareto", match.spec(), results)
        store.use("night-0001", [match.key])
        store.put_table("night-0001", "entrants", entrants_table([enter(DRIVER, *PLACE)]))
        store.put_table("night-0001", "battery", pl.DataFrame([finalist], schema=BATTERY))
        keep_laps(store, "night-0001", pool)
        laps = store.table("night-0001", "laps")
        assert laps.schema == LAPS
        assert laps["time_s"][-1] == pytest.approx(results["best_lap_s"].min(), abs=0.001)
        marked = laps.with_columns(pedals=pl.lit(0.5))
        store.put_table("night-0001", "laps", marked)
        keep_laps(store, "night-0001", pool)
        assert store.table("night-0001", "laps").equals(marked)


def test_a_match_of_another_program_gives_no_lap(tmp_path: Path, match: Match, results: pl.DataFrame) -> None:
    spec = match.spec() | {"code": "0" * 64}
    with Store(tmp_path / "store.sqlite") as store, Pool(1) as pool:
        store.begin_run("night-0001", {})
        store.add_match("f" * 64, "pareto", spec, results.with_columns(match=pl.lit("f" * 64)))
        store.use("night-0001", ["f" * 64])
        store.put_table("night-0001", "entrants", entrants_table([enter(DRIVER, *PLACE)]))
        shortlisted = pl.DataFrame([{"entrant": DRIVER, "shortlisted": True}], schema=BATTERY)
        store.put_table("night-0001", "battery", shortlisted)
        keep_laps(store, "night-0001", pool)
        assert store.table("night-0001", "laps").is_empty()
        assert store.table("night-0001", "course").is_empty()


def test_a_run_that_has_just_begun_has_no_laps(tmp_path: Path) -> None:
    with Store(tmp_path / "store.sqlite") as store, Pool(1) as pool:
        store.begin_run("night-0001", {})
        keep_laps(store, "night-0001", pool)
        assert store.table("night-0001", "laps").is_empty()


def test_shipped_limits_are_the_benchmarks() -> None:
    """A circuit or a car that changes needs `python -m benchmarks.lap_limit` again, then `.ship`."""
    solved = read_result(RESULTS / "lap_limit.json").figures["laps"]
    shipped = json.loads(SHIPPED.read_text("utf-8"))["laps"]
    assert [lap["limit_s"] for lap in shipped] == [lap["limit_s"] for lap in solved]
    assert all(lap["solved"] for lap in solved)
    assert len(shipped) == 9
    for limit, lap in zip(shipped, solved, strict=True):
        named = {"circuit": lap["circuit"], "car": lap["car"]}
        assert limit == {**named, "limit_s": lap["limit_s"], **place_digests(**named)._asdict()}


def limit_of(folder: Path, results: pl.DataFrame, spec: dict[str, Any]) -> float | None:
    """The limit of a run with these time trials."""
    with Store(folder / "store.sqlite") as store:
        key = results["match"][0]
        store.begin_run("night-0001", {})
        store.add_match(key, "pareto", spec, results)
        store.use("night-0001", [key])
        return lap_limit(store, "night-0001")


def test_the_limit_is_that_of_circuit_and_car(tmp_path: Path, match: Match, results: pl.DataFrame) -> None:
    assert limit_of(tmp_path, results, match.spec()) == 103.287


@pytest.mark.parametrize("field", ["track", "car_file"])
def test_raced_otherwise_than_today_there_is_no_limit(
    tmp_path: Path, match: Match, results: pl.DataFrame, field: str
) -> None:
    assert limit_of(tmp_path, results, match.spec() | {field: "another"}) is None


@pytest.mark.parametrize("faster", [{"compound": "soft"}, {"fuel_rate": 1.0}])
def test_other_tyres_or_less_fuel_have_no_limit(
    tmp_path: Path, match: Match, results: pl.DataFrame, faster: dict[str, Any]
) -> None:
    spec = match.spec()
    assert limit_of(tmp_path, results, spec | {"scenario_file": spec["scenario_file"] | faster}) is None


def test_a_changed_car_has_no_limit(tmp_path: Path, results: pl.DataFrame) -> None:
    car = tmp_path / "gt3.toml"
    text = (DATA / "cars" / "gt3.toml").read_text("utf-8")
    changed = re.sub(r"(?m)^mass_kg = .*$", "mass_kg = 1000.0", text, count=1)
    assert changed != text
    car.write_text(changed, "utf-8")
    match = against("pareto", "time_trial", "time_trial", enter(DRIVER, PLACE[0], str(car)), [], [1], [5, 6])
    assert limit_of(tmp_path, results, match.spec()) is None
    car.unlink()
    assert limit_of(tmp_path, results, match.spec()) is None


def test_a_computed_limit_is_kept_for_its_circuit_and_car(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    car = tmp_path / "heavy.toml"
    text = (DATA / "cars" / "gt3.toml").read_text("utf-8")
    car.write_text(re.sub(r"(?m)^mass_kg = .*$", "mass_kg = 1500.0", text, count=1), "utf-8")
    assert known_limit("lindenring", str(car)) is None
    keep_limit("lindenring", str(car), 109.0)
    keep_limit("lindenring", str(car), 108.5)
    assert known_limit("lindenring", str(car)) == 108.5
    assert known_limit("porto-sereno", str(car)) is None
    assert known_limit("lindenring", "gt3") == 103.287
    (tmp_path / "nathlon" / "lap_limits.json").write_text("{")
    assert known_limit("lindenring", str(car)) is None


def test_a_run_without_time_trials_has_no_limit(tmp_path: Path) -> None:
    with Store(tmp_path / "store.sqlite") as store:
        store.begin_run("night-0001", {})
        assert lap_limit(store, "night-0001") is None
