"""After a test drive the coach's page of it opens."""

from __future__ import annotations

import webbrowser
from pathlib import Path
from urllib.parse import urlparse

import numpy as np
import polars as pl
import pytest

import nathlon
from nathlon.lab.drive.coached import CoachAfterwards
from nathlon.lab.drive.keeping import Kept
from nathlon.policies.driver import Driver
from nathlon.policies.sources.human import write_inputs
from nathlon.results.coach import CoachFacts
from nathlon.sim.car import load_car
from nathlon.sim.clock import SUBSTEPS
from nathlon.sim.scenario import load_scenario
from nathlon.sim.track import load_track

PLACE = "lindenring", "gt3"
ALONE = "drive:laps=1,cars=1,person=1"


@pytest.fixture(scope="module")
def drive(tmp_path_factory: pytest.TempPathFactory) -> Kept:
    """A lap from a standing start by inputs, 60 times a second, that the built-in driver has made."""
    folder, driver, first = tmp_path_factory.mktemp("drive"), Driver(*PLACE, pace=0.93), np.zeros(1, np.int64)
    scenario, track = load_scenario(ALONE), load_track(PLACE[0])
    world = scenario.world(track, load_car(PLACE[1]), 1)
    world.reset(0, scenario.place(track, np.random.default_rng(1)))
    memory, controls = driver.initial_memory(1), []
    while world.state["driving"].all():
        actions, memory = driver.act(world.observe(driver.observation_spec, first, first), memory)
        world.step(actions[:, None], SUBSTEPS)
        controls += [actions[0]] * SUBSTEPS
    write_inputs(folder / "ann-1.json", "ann", *PLACE, np.array(controls, np.float32))
    recording = nathlon.race([f"human:{folder / 'ann-1.json'}"], scenario=ALONE, record=folder).recording
    assert recording is not None
    return Kept(recording, folder / "ann-1.json", pl.DataFrame())


def test_a_person_s_drive_is_coached(drive: Kept, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    shown: list[str] = []
    monkeypatch.setattr(webbrowser, "open", shown.append)
    afterwards = CoachAfterwards(tmp_path)
    afterwards(drive, 0)
    afterwards.threads[0].join()
    [address] = shown
    page = Path(urlparse(address).path)
    assert "human:ann" in page.read_text("utf-8")
    facts = CoachFacts.model_validate_json((page.parent / "coach.json").read_text("utf-8"))
    assert not facts.lap.flying
    assert [cause.kind for cause in facts.sections[0].causes] == ["standing_start"]
    # Who drives at 93 % of the pace can gain in most bends.
    assert len(facts.advice) >= 5


def test_a_drive_without_a_lap_is_said_so(
    drive: Kept, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    shown: list[str] = []
    monkeypatch.setattr(webbrowser, "open", shown.append)
    afterwards = CoachAfterwards(tmp_path)
    afterwards(drive._replace(recording=tmp_path / "gone.mcap"), 0)
    afterwards.threads[0].join()
    assert shown == []
    assert "Not coached: nathlon:" in capfd.readouterr().err
