"""Incidents as tests: the frozen moment is that of the recording, and a folder of them is driven and told."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import polars as pl
import pytest

import nathlon
from nathlon.arena.race_log import RaceLog
from nathlon.arena.recording import read_recording
from nathlon.arena.store import Store
from nathlon.selection.battery.skill import read_skill
from nathlon.selection.incident.folder import SCENARIO, incident_files
from nathlon.selection.incident.freeze import freeze
from nathlon.selection.incident.history import incident_history
from nathlon.selection.incident.hold import load_incidents
from nathlon.sim.car import load_car
from nathlon.sim.errors import InputError
from nathlon.sim.scenario import load_scenario
from nathlon.sim.track import load_track
from tests.support.checkpoints import BUNDLED
from tests.support.command_line import nathlon as command
from tests.support.command_line import refused

AGAIN = next(path for path in BUNDLED if path.stem == "lindenring-again-056k")
SMALL = """
recordings = "notable"
[pareto]
scenario = "slipstream_pass"
races = 1
most_races = 1
opponents = ["driver:pace=0.9"]
[battery]
tests = ["pass_left"]
runs = 1
incidents = "incidents"
[tournament]
format = "1v1"
pairs = 2
"""


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A lap of a policy that fights, four times, among slow drivers."""
    folder = tmp_path_factory.mktemp("race")
    path = nathlon.race([AGAIN, "driver:pace=0.9"], scenario="sprint", record=folder, seed=4).recording
    assert path is not None
    return path


@pytest.fixture(scope="module")
def log(recording: Path) -> RaceLog:
    return read_recording(recording)


def blamed(log: RaceLog) -> tuple[float, int]:
    """When the first contact was that is laid to somebody, after 5 s, and to whom."""
    return next((one.time_s, one.fault) for one in log.incidents if one.fault >= 0 and one.time_s > 5)


def test_the_cars_are_where_they_were_and_move_as_they_did(log: RaceLog, tmp_path: Path) -> None:
    at_s, car = blamed(log)
    frozen = freeze(log, at_s, car, "as it was", 4.0, 6.0, 8)
    start = frozen.scenario.start.model_copy(update={"jitter_m": 0.0, "jitter_m_s": 0.0})
    scenario = frozen.scenario.model_copy(update={"start": start})
    track = load_track(log.circuit)
    world = scenario.world(track, load_car(log.car), 1)
    world.reset(0, scenario.place(track, np.random.default_rng(0)))
    sample = log.samples[np.searchsorted(log.time_s, at_s - 4.0)]
    cars = world.state[0]
    assert np.hypot(cars["x"] - sample["x_m"], cars["y"] - sample["y_m"]).max() < 0.05
    turned = cars["yaw"] - sample["yaw_rad"]
    assert np.abs(np.arctan2(np.sin(turned), np.cos(turned))).max() < 0.01
    along = np.hypot(cars["world_velocity_x"], cars["world_velocity_y"])
    assert along == pytest.approx(np.hypot(sample["velocity_x_m_s"], sample["velocity_y_m_s"]), abs=0.01)
    assert cars["yaw_rate"] == pytest.approx(sample["yaw_rate_rad_s"], abs=0.001)
    order = np.argsort(-cars["progress"])
    assert np.array_equal(order, np.argsort(sample["place"]))


def test_what_counts_as_passed_is_what_happened(log: RaceLog) -> None:
    at_s, car = blamed(log)
    assert freeze(log, at_s, car, "a", 4.0, 6.0, 8).skill.measure == "at_fault"
    hit = next(one for one in log.incidents if one.kind == "contact" and one.fault >= 0 and one.time_s > 5)
    [victim] = [each for each in hit.cars if each != hit.fault]
    assert freeze(log, hit.time_s, victim, "b", 4.0, 6.0, 8).skill.measure == "contacts"
    with pytest.raises(InputError, match="nothing happened to car"):
        freeze(log, 1e4, car, "c", 4.0, 6.0, 8)


def test_a_folder_is_driven_every_time_and_its_history_told(recording: Path, tmp_path: Path) -> None:
    at_s, car = blamed(read_recording(recording))
    made = ("--at", f"{at_s:.1f}", "--car", str(car + 1), "--name", "shut-the-door", "--runs", "4")
    given = ("incident", recording, *made)
    refused(command(*given, cwd=tmp_path), "expected --policy lindenring-again-056k=FILE")
    policy = ("--policy", f"{AGAIN.stem}={AGAIN}")
    assert command(*given, *policy, cwd=tmp_path).returncode == 0
    refused(command(*given, *policy, cwd=tmp_path), "shut-the-door.toml", "exists already")
    folder = tmp_path / "incidents"
    assert [path.name for path in incident_files(folder)] == ["shut-the-door.toml"]
    skill = read_skill(folder / "shut-the-door.toml")
    assert len(skill.opponents) == 7
    assert load_scenario(str(folder / f"shut-the-door{SCENARIO}")).cars == 8
    assert load_incidents(str(folder), "porto-sereno", "coupe") == [], "it happened elsewhere"

    (tmp_path / "small.toml").write_text(SMALL)
    drivers = ["driver", "driver:pace=0.95"]
    for pairs in (2, 3):
        result = nathlon.select(
            drivers, tmp_path / "out", config=tmp_path / "small.toml", pairs=pairs, progress=False
        )
    held = result.selection.tables["incidents"] if result.selection else pl.DataFrame()
    assert set(held["test"]) == {"shut-the-door"}
    assert (held["runs"] == 4).all()
    assert held["passed"].to_list() == (held["clean"] >= 0.9 * held["runs"]).to_list()
    with Store.open(result.store) as store:
        names = [record.name for record in store.runs()]
        told = incident_history(store, names[1])
    assert told.select("run", "test", "entrants").rows() == [(names[0], "shut-the-door", held.height)]
    assert told["passed"].item() == held["passed"].sum()
    assert "shut-the-door" in result.report.read_text()


def test_a_policy_that_had_the_incident_has_it_again(recording: Path, tmp_path: Path) -> None:
    """Otherwise the frozen moment would not be what led to it."""
    at_s, car = blamed(read_recording(recording))
    made = ("--at", f"{at_s:.1f}", "--car", str(car + 1), "--name", "again", "--runs", "8")
    policy = ("--policy", f"{AGAIN.stem}={AGAIN}")
    assert command("incident", recording, *made, *policy, cwd=tmp_path).returncode == 0
    path = tmp_path / "incidents" / "again.toml"
    nothing_else = {"points": None, "at_fault_per_km": None, "lap": None}
    gate = nothing_else | {"tests": [str(path)], "runs": 8, "block": 8}
    config = nathlon.Config.model_validate({"gate": gate})
    result = nathlon.gate("driver", str(AGAIN), tmp_path / "gate", config=config, progress=False)
    [finding] = result.findings.filter(measure="again").to_dicts()
    assert finding["units"] == 8
    assert finding["difference"] > 100, "the built-in driver keeps its distance"
