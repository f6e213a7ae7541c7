"""Two races from one start: the recorded one to the bit, and one in which another policy drives a car."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader
from playwright.sync_api import Browser, Page
from rerun.chunk import RrdReader

import nathlon
from nathlon.api.twin import TwinResult
from nathlon.arena.entrant import enter, entrants_table
from nathlon.arena.match import Match, Race, Seat
from nathlon.arena.match_policies import match_policies
from nathlon.arena.race_log import RaceLog
from nathlon.arena.recording import read_recording, write_recording
from nathlon.arena.runner import run_match
from nathlon.arena.store import Store
from nathlon.judge.twin.rebuild import same_race
from nathlon.reports.replay import FRAMES_PER_TICK
from nathlon.results.twin import outcome
from nathlon.selection.publish.replays import record_stored_race
from nathlon.sim.errors import InputError
from tests.support.checkpoints import BUNDLED
from tests.support.command_line import nathlon as command
from tests.support.command_line import refused
from tests.support.opened_page import faults, overhear, picture, shown
from tests.support.race_logs import oval_race

AT_S, CAR = 3.0, 2
NUMBER = CAR + 1
RACER = next(path for path in BUNDLED if path.stem == "lindenring-again-056k")
ELSEWHERE = sorted((RACER.parent.parent / "porto-sereno").glob("*.safetensors"))[0]
SCENARIO = """
name = "dash"
description = ""
cars = 4
rules = "sporting"
time_s = 9.0
start = {kind = "grid"}
"""


@pytest.fixture(scope="module")
def scenario(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("scenario") / "dash.toml"
    path.write_text(SCENARIO)
    return path


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory, scenario: Path) -> Path:
    """A policy that fights and a driver, two cars each; car 2 is the policy's."""
    folder = tmp_path_factory.mktemp("race")
    path = nathlon.race([RACER, "driver:pace=0.9"], scenario=str(scenario), record=folder, seed=4).recording
    assert path is not None
    return path


@pytest.fixture(scope="module")
def result(recording: Path, tmp_path_factory: pytest.TempPathFactory) -> TwinResult:
    out = tmp_path_factory.mktemp("twin")
    known = {RACER.stem: RACER}
    return nathlon.twin(
        recording, car=NUMBER, policy="driver:pace=0.6", at_s=AT_S, out=out, entrants=known, progress=False
    )


@pytest.fixture(scope="module")
def logs(result: TwinResult) -> tuple[RaceLog, RaceLog]:
    return read_recording(result.original), read_recording(result.twin)


def test_both_races_are_the_same_until_the_other_policy_drives(
    result: TwinResult, recording: Path, logs: tuple[RaceLog, RaceLog]
) -> None:
    assert sorted(path.name for path in result.folder.iterdir()) == [
        "index.html", "original.mcap", "twin.mcap", "twin.rrd",
    ]  # fmt: skip
    assert result.original.read_bytes() == recording.read_bytes()
    original, twin = logs
    before = int(np.flatnonzero(original.time_s <= AT_S + 1e-6)[-1])
    for name in original.samples.dtype.names or ():
        np.testing.assert_array_equal(original.samples[name][: before + 1], twin.samples[name][: before + 1])
    after = original.samples["throttle"][before + 1] != twin.samples["throttle"][before + 1]
    assert after.tolist() == [False, False, True, False], "only the car that is swapped does something else"
    assert result.parted_s == pytest.approx(AT_S)
    assert twin.names[CAR] == "driver:pace=0.6 from 3 s"
    assert twin.samples["distance_m"][-1, CAR] < original.samples["distance_m"][-1, CAR] - 5.0
    assert result.outcomes["place"].to_list() == [log.samples["place"][-1, CAR] for log in logs]


def test_the_same_policy_from_the_start_drives_the_same_race(recording: Path, tmp_path: Path) -> None:
    done = command(
        "twin", recording, "--car", str(NUMBER), "--policy", RACER, "--out", tmp_path / "out",
        "--entrant", f"{RACER.stem}={RACER}", "--json", cwd=tmp_path,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    told: dict[str, Any] = json.loads(done.stdout)
    assert told["parted_s"] is None
    assert same_race(read_recording(Path(told["original"])), read_recording(Path(told["twin"])))


def test_another_plan_is_raced_from_its_start(recording: Path, tmp_path: Path) -> None:
    """The same driver with hardly any fuel: it is lighter, and gets further."""
    light = tmp_path / "light.toml"
    light.write_text(
        'name = "light"\n[[part]]\npolicy = "driver:pace=0.9"\n[[stint]]\nlaps = 9\nfuel_kg = 5\n'
    )
    known = {RACER.stem: RACER}
    result = nathlon.twin(
        recording, car=2, policy=light, out=tmp_path / "out", entrants=known, progress=False
    )
    original, twin = (
        read_recording(path).samples["distance_m"][-1, 1] for path in (result.original, result.twin)
    )
    assert twin > original + 1.0


def test_a_race_of_a_store_is_run_again_from_it(scenario: Path, tmp_path: Path) -> None:
    drivers = ("driver:pace=0.9", "driver:pace=0.8")
    seats = [tuple(Seat((car + first) % 2, (car + first) % 2) for car in range(4)) for first in (0, 1)]
    races = tuple(Race(7, places) for places in seats)
    match = Match("tournament", "2v2", str(scenario), "lindenring", "gt3", drivers, drivers, races)
    with Store(tmp_path / "store.sqlite") as store:
        store.begin_run("one", {})
        store.put_table("one", "entrants", entrants_table([enter(d, "lindenring", "gt3") for d in drivers]))
        store.add_match(match.key, "tournament", match.spec(), run_match(match, match_policies(match)))
        path = record_stored_race(store, f"{match.key}:1", tmp_path / "races")
    result = nathlon.twin(
        path, car="1", policy="driver:pace=0.5", at_s=2.0, out=tmp_path / "out", progress=False
    )
    assert result.original.read_bytes() == path.read_bytes()
    assert result.parted_s == pytest.approx(2.0)


def test_two_recordings_from_one_start_are_shown_together(scenario: Path, tmp_path: Path) -> None:
    paths = [
        nathlon.race(
            [f"driver:pace={pace}", "driver"], scenario=str(scenario), record=tmp_path / pace
        ).recording
        for pace in ("0.9", "0.8")
    ]
    assert paths[0] is not None
    assert paths[1] is not None
    result = nathlon.twin(paths[0], paths[1], car=2, out=tmp_path / "out", progress=False)
    assert 0.0 <= (result.parted_s or 0.0) < 5.0
    assert "It is not known" not in result.page.read_text()
    assert result.twin.read_bytes() == paths[1].read_bytes()


def test_races_that_cannot_be_run_again_are_shown_without_what_was_seen(
    result: TwinResult, tmp_path: Path
) -> None:
    again = nathlon.twin(result.original, result.twin, car=NUMBER, out=tmp_path / "out", progress=False)
    assert f"It is not known: car 1 is &#39;{RACER.stem}&#39;: expected" in again.page.read_text()
    assert again.parted_s == result.parted_s
    assert again.twin.read_bytes() == result.twin.read_bytes()


def opened(browser: Browser, page: Path, complaints: list[list[str]], address: str = "") -> Page:
    shown = browser.new_page(viewport={"width": 1440, "height": 1340})
    requests, said = overhear(shown)
    complaints += [said, requests]
    shown.goto(page.as_uri() + address)
    shown.wait_for_selector("body[data-ready]")
    return shown


def settle(page: Page) -> None:
    page.evaluate("new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")


def scrub(page: Page, seconds: float) -> list[str]:
    """Pictures of both races at a moment."""
    page.locator("#scrub").evaluate(
        "(bar, at) => { bar.value = at; bar.dispatchEvent(new Event('input')); }", seconds
    )
    settle(page)
    return [
        page.evaluate(f"document.getElementById('{name}').toDataURL()") for name in ("scene", "scene-beside")
    ]


def numbers(page: Page, name: str) -> list[str]:
    """What both drivers see of a field, first the original's."""
    row = page.locator("#numbers tbody tr").filter(has=page.get_by_role("rowheader", name=name))
    return row.locator("td i").all_inner_texts()


def test_the_page_moves_both_races_together(
    browser: Browser, result: TwinResult, logs: tuple[RaceLog, ...]
) -> None:
    heard: list[list[str]] = []
    page = opened(browser, result.page, heard)
    # A second before they part, which may be later than the other policy's start.
    parted_s = result.parted_s
    assert parted_s is not None
    assert float(page.locator("#scrub").input_value()) == pytest.approx(parted_s - 1.0, abs=0.006)
    early, late = scrub(page, 2.0), scrub(page, 7.0)
    assert all(before != after for before, after in zip(early, late, strict=True))
    assert scrub(page, 2.0) == early
    assert page.locator("#numbers .unlike").count() == 0, "until then both see the same"
    assert len(set(numbers(page, "velocity")[::2])) == 1
    assert page.locator("#parted").get_attribute("x1") == "3"

    scrub(page, 7.0)
    assert page.locator("#numbers .unlike").count() > 5
    tick = int(np.searchsorted(logs[0].time_s, 7.0))
    seen = [float(text.replace("−", "-")) for text in numbers(page, "velocity")]
    for log, value in zip(logs, (seen[0], seen[2]), strict=True):
        assert value == pytest.approx(log.samples["velocity_x_m_s"][tick, CAR], abs=0.06)
    lead = page.locator(".chart output.twin").last.inner_text()
    assert lead.startswith("−"), "the slow one falls behind"
    page.keyboard.press("ArrowRight")
    settle(page)
    assert float(page.locator("#scrub").input_value()) == pytest.approx(8.0)
    page.locator(".chart canvas").first.click(position={"x": 8, "y": 20})
    settle(page)
    assert float(page.locator("#scrub").input_value()) == pytest.approx(0.0, abs=0.05)
    scrub(page, 7.0)
    picture(page, "twin", whole=True)
    page.close()
    complaints, requests = heard
    assert complaints == []
    assert set(requests) <= {result.page.as_uri(), "data:,"}


def test_both_races_are_seen_in_three_dimensions(browser: Browser, result: TwinResult) -> None:
    heard: list[list[str]] = []
    page = opened(browser, result.page, heard, "#at=2")
    page.get_by_role("button", name="3-D").click()
    settle(page)
    for name in ("#space", "#space-beside"):
        assert len(np.unique(shown(page, name).reshape(-1, 3), axis=0)) > 100
    assert faults(heard[0]) == []
    page.close()


def test_rerun_reads_both_races_on_one_timeline(result: TwinResult, logs: tuple[RaceLog, ...]) -> None:
    found: dict[str, dict[str, Any]] = {}
    for chunk in RrdReader(result.replay).stream():
        batch = chunk.to_record_batch()
        found.setdefault(chunk.entity_path, {}).update(zip(batch.schema.names, batch.columns, strict=True))
    for name, log in zip(("original", "twin"), logs, strict=True):
        columns = found[f"/{name}/world/cars/{CAR}"]
        at = np.array([row[0] for row in columns["Transform3D:translation"].to_pylist()])[::FRAMES_PER_TICK]
        time_s = columns["race_time"].to_numpy() / np.timedelta64(1, "s")
        np.testing.assert_allclose(time_s[::FRAMES_PER_TICK], log.time_s, atol=1e-8)
        np.testing.assert_allclose(at[:, 0], log.samples["x_m"][:, CAR], atol=1e-3)
        speed = found[f"/seen/velocity/forward/{name}"]["Scalars:scalars"].to_pylist()
        assert speed[-1][0] == pytest.approx(log.samples["velocity_x_m_s"][-2, CAR], abs=0.5)
        edges = found[f"/{name}/world/cars/{CAR}/seen/course"]["LineStrips3D:strips"].to_pylist()
        assert {len(strips) for strips in edges} == {2}
        left, right = np.array(edges[-1][0]), np.array(edges[-1][1])
        assert left[0, 1] > right[0, 1], "the left edge is on the left"


def test_an_independent_reader_finds_both_races(result: TwinResult, logs: tuple[RaceLog, ...]) -> None:
    for path, log in zip((result.original, result.twin), logs, strict=True):
        with path.open("rb") as file:
            times = [message.log_time for _, _, message in make_reader(file).iter_messages(topics=["/cars"])]
        np.testing.assert_allclose(np.array(times) / 1e9, log.time_s, atol=1e-8)


def test_how_a_race_ended_is_told_of_one_car() -> None:
    log = oval_race(cars=3)
    assert outcome(log, 1)[2:] == (1, 1, 0, 1)
    assert outcome(log, 0)[2:] == (1, 0, 0, 0)


def test_wrong_input_is_one_sentence(recording: Path, scenario: Path, tmp_path: Path) -> None:
    known = ("--entrant", f"{RACER.stem}={RACER}")

    def wrong(*arguments: str | Path, said: tuple[str, ...]) -> None:
        refused(command("twin", recording, *arguments, "--out", "out", cwd=tmp_path), *said)

    driver = ("--policy", "driver")
    wrong("--car", "5", *driver, said=("there is no car '5'", "from 1 to 4"))
    wrong("--car", "3", *driver, "--at", "60", said=("at is 60 s", "car 3 drives, 0 to 8.9 s"))
    wrong("--car", "3", *driver, "--at", "-1", said=("at is -1 s",))
    wrong("--car", "3", *driver, "--at", "nan", said=("at is nan s",))
    wrong("--car", "3", said=("either a policy in the car's place or another recording",))
    wrong("--car", "3", "--policy", ELSEWHERE, said=("circuit is 'porto-sereno', expected 'lindenring'",))
    wrong("--car", "3", "--policy", "gone.onnx", said=("gone.onnx: no such file",))
    wrong("--car", "3", "--policy", RACER.parent, said=("expected one policy",))
    wrong("--car", "3", *driver, said=(f"expected --entrant {RACER.stem}=FILE",))
    wrong("--car", "3", *driver, "--entrant", str(RACER), said=("--entrant is", "expected NAME=FILE"))
    other = next(path for path in BUNDLED if path != RACER)
    wrong("--car", "3", *driver, "--entrant", f"{RACER.stem}={other}", said=("cannot be raced again",))
    (tmp_path / "full").write_text("")
    refused(
        command("twin", recording, "--car", "3", *driver, *known, "--out", "full/out", cwd=tmp_path),
        "full/out: cannot be written",
    )
    assert not (tmp_path / "out").exists(), "nothing half-written"
    refused(command("replay", recording, recording, cwd=tmp_path), "nathlon twin", "shows both")


def test_races_that_did_not_begin_alike_are_refused(recording: Path, scenario: Path, tmp_path: Path) -> None:
    elsewhere = tmp_path / "elsewhere.mcap"
    write_recording(elsewhere, oval_race(cars=4))
    with pytest.raises(InputError, match="circuit is 'lindenring' and 'oval', expected the same"):
        nathlon.twin(recording, elsewhere, car=1, out=tmp_path / "out")
    moved = read_recording(recording)
    moved.samples["x_m"][0, 1] += 1.0
    write_recording(elsewhere, moved)
    with pytest.raises(InputError, match="expected one start"):
        nathlon.twin(recording, elsewhere, car=1, out=tmp_path / "out")
    assert os.listdir(tmp_path) == ["elsewhere.mcap"]
