"""The coach: facts that add up, known faults that are found, and advice that gains when it is driven."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import Browser, Page

import nathlon
from nathlon.api.coach import CoachResult
from nathlon.arena.race_log import RaceLog
from nathlon.arena.recording import read_recording, write_recording
from nathlon.lab.coach.coach import Coach
from nathlon.lab.coach.driving import Jolt, Rider, TrialPlan
from nathlon.lab.coach.edits import Edit
from nathlon.lab.coach.lap import laps_of
from nathlon.lab.coach.proof import ProofWindow, try_edits
from nathlon.lab.coach.reference import Reference
from nathlon.results.coach import CoachFacts
from tests.support.command_line import nathlon as command
from tests.support.command_line import refused
from tests.support.opened_page import faults, overhear, picture, until
from tests.support.race_logs import oval_race

EARLY_M = 30
"""By how much the coached driver brakes before it must."""


def _recorded(folder: Path, source: str) -> tuple[Path, float]:
    """A time trial, and its lap time as the simulator has timed it."""
    result = nathlon.race([source], scenario="time_trial", record=folder)
    assert result.recording is not None
    return result.recording, float(result.results["best_lap_s"][0])


@pytest.fixture(scope="module")
def early(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, float]:
    return _recorded(tmp_path_factory.mktemp("early"), f"driver:early={EARLY_M}")


@pytest.fixture(scope="module")
def usual(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, float]:
    return _recorded(tmp_path_factory.mktemp("usual"), "driver")


@pytest.fixture(scope="module")
def result(
    early: tuple[Path, float], usual: tuple[Path, float], tmp_path_factory: pytest.TempPathFactory
) -> CoachResult:
    out = tmp_path_factory.mktemp("coach")
    return nathlon.coach(early[0], car=1, against=usual[0], out=out, progress=False)


@pytest.fixture(scope="module")
def log(early: tuple[Path, float]) -> RaceLog:
    return read_recording(early[0])


def test_laps_are_those_that_were_timed(
    result: CoachResult, early: tuple[Path, float], usual: tuple[Path, float]
) -> None:
    assert result.facts.lap.lap_s == pytest.approx(early[1], abs=0.01)
    assert result.facts.other_lap_s == pytest.approx(usual[1], abs=0.01)


def test_sections_follow_each_other_and_add_up(result: CoachResult) -> None:
    facts = result.facts
    ends = [one.end_m for one in facts.sections]
    assert [one.start_m for one in facts.sections] == [0.0, *ends[:-1]]
    assert sum(one.time_s for one in facts.sections) == pytest.approx(facts.lap.lap_s, abs=0.02)
    assert sum(one.lost_s for one in facts.sections) == pytest.approx(facts.lost_s, abs=0.02)


def test_who_brakes_early_is_told_so_and_by_how_much(result: CoachResult) -> None:
    early = {
        section.name: cause.other - cause.own
        for section in result.facts.sections
        for cause in section.causes
        if cause.kind == "braking_early" and cause.own is not None and cause.other is not None
    }
    # The three hard brakings of the Lindenring.
    assert {"Haarnadel", "Kehre", "Schikane"} <= set(early)
    assert np.median(list(early.values())) == pytest.approx(EARLY_M, abs=10.0)
    late = [cause for section in result.facts.sections for cause in section.causes if "late" in cause.kind]
    assert not late


def test_advice_gains_by_what_it_says(result: CoachResult, log: RaceLog) -> None:
    advice = result.facts.advice
    assert {"Haarnadel", "Kehre"} <= {one.section for one in advice}
    kinds = {one.kind for one in (*advice, *result.facts.alternatives)}
    assert "brake_later" in kinds
    lap = laps_of(log, 0)[0]
    for one in (*advice, *result.facts.alternatives):
        assert one.gain_s >= 0.02
        assert one.edited_s + one.gain_s <= min(one.recorded_s, one.again_s) + 0.002
        assert one.recorded_s == pytest.approx(lap.between(one.from_m, one.until_m), abs=0.02)
    assert [one.gain_s for one in advice] == sorted((one.gain_s for one in advice), reverse=True)


def test_a_lap_driven_again_without_an_edit_is_the_recorded_one(log: RaceLog) -> None:
    lap = laps_of(log, 0)[0]
    rider = Rider(log, lap)
    for start_m, end_m in ((0.0, 850.0), (2200.0, 3000.0), (3900.0, 4400.0)):
        [driven] = rider.drive([(TrialPlan.of(lap), Jolt())], start_m, end_m)
        assert driven.clean
        assert driven.until(end_m) == pytest.approx(lap.between(start_m, end_m), abs=0.05)


def test_what_changes_nothing_or_ends_beside_the_road_is_no_advice(log: RaceLog) -> None:
    lap = laps_of(log, 0)[0]
    own = TrialPlan.of(lap)
    never_braking = own.with_traces(pedal=np.ones_like(own.pedal), speed=own.speed + 100.0)
    edits = [Edit("more_speed", 0.0, own), Edit("brake_later", 500.0, never_braking)]
    trial = try_edits(Rider(log, lap), lap, ProofWindow(3900.0, 4270.0, 4400.0), edits)
    assert not trial.untrue
    assert trial.best == ()


def test_starts_are_moments_of_the_lap_before_the_greatest_losses(result: CoachResult, log: RaceLog) -> None:
    lap, facts = laps_of(log, 0)[0], result.facts
    bends = [one for one in facts.sections if one.kind != "straight" and one.lost_s >= 0.02]
    assert [one.section for one in facts.starts] == [
        one.name for one in sorted(bends, key=lambda one: -one.lost_s)
    ][: len(facts.starts)]
    for start in facts.starts:
        assert start.speed_m_s == pytest.approx(float(lap.speed[round(start.progress_m)]), abs=0.01)


def test_the_files_say_what_the_result_does(result: CoachResult) -> None:
    assert json.loads(result.facts_file.read_text()) == result.facts.model_dump(mode="json")
    assert result.text_file.read_text() == result.text


def test_against_itself_nothing_is_lost(early: tuple[Path, float], tmp_path: Path) -> None:
    done = command("coach", early[0], "--car", "1", "--against", early[0], "--out", "same", cwd=tmp_path)
    assert done.returncode == 0
    assert "The best lap of driver:early=30 on lindenring takes" in done.stdout
    facts = CoachFacts.model_validate_json((tmp_path / "same" / "coach.json").read_text())
    assert facts.lost_s == 0.0
    assert all(section.lost_s == 0.0 and not section.causes for section in facts.sections)
    # Early braking is slow all the same.
    assert facts.advice
    assert not any(one.kind == "line" for one in (*facts.advice, *facts.alternatives))


def test_where_a_penalty_is_served_nobody_is_told_to_drive_faster(
    log: RaceLog, usual: tuple[Path, float]
) -> None:
    samples = log.samples.copy()
    samples["penalty_s"][:, 0] = np.linspace(9.0, 8.0, len(samples))
    faster = Reference("driver", "recording", laps_of(read_recording(usual[0]), 0)[0], None)
    facts = Coach(replace(log, samples=samples), 0, faster).work(lambda done, total: None).facts
    assert {tuple(cause.kind for cause in one.causes) for one in facts.sections} == {("penalty",)}
    assert facts.advice == ()
    assert {one.unproved for one in facts.attempts} == {"a penalty is served there"}


def test_what_cannot_be_coached_is_refused(early: tuple[Path, float], tmp_path: Path) -> None:
    oval = tmp_path / "oval.mcap"
    write_recording(oval, oval_race(2))
    refused(command("coach", early[0], "--car", "nobody", cwd=tmp_path), "no car 'nobody'")
    refused(
        command("coach", early[0], "--car", "1", "--against", oval, cwd=tmp_path),
        f"{oval}: circuit is 'oval', expected 'lindenring'",
    )
    assert not (tmp_path / "runs").exists()


def opened(browser: Browser, result: CoachResult, heard: list[tuple[list[str], list[str]]]) -> Page:
    page = browser.new_page(viewport={"width": 1400, "height": 1000})
    heard.append(overhear(page))
    page.goto(result.page.as_uri())
    page.wait_for_selector("body[data-ready]")
    return page


def settle(page: Page) -> None:
    page.evaluate("new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")


def at_s(page: Page) -> float:
    return float(page.locator("#scrub").input_value())


def test_the_page_shows_what_was_found_and_goes_there(
    browser: Browser, result: CoachResult, log: RaceLog
) -> None:
    heard: list[tuple[list[str], list[str]]] = []
    page, facts, lap = opened(browser, result, heard), result.facts, laps_of(log, 0)[0]
    assert page.locator(".advice li").count() == len(facts.advice)
    assert page.locator("tbody tr").count() == len(facts.sections)
    assert f"−{facts.advice[0].gain_s:.3f} s" in page.locator(".advice li").first.inner_text()
    # Every piece of the map has a colour of its own loss; most is lost, hardly anything gained.
    colours = page.locator(".piece").evaluate_all("all => all.map((one) => getComputedStyle(one).stroke)")
    assert len(set(colours)) > 20
    lost = [one.lost_s for one in facts.sections]
    assert page.locator(f".bend[data-section='{lost.index(max(lost))}']").count() == 1
    # The names stand beside their bends, each at another place.
    boxes = [label.bounding_box() for label in page.locator("#map .bend circle").all()]
    assert len({round(box["x"]) for box in boxes if box}) > len(boxes) / 2
    assert not re.search(r"[-−]0\.0+\b", page.locator("main").inner_text())
    last = facts.advice[-1]
    page.locator(".advice .look").last.click()
    assert page.locator("#range").inner_text().startswith(last.section)
    assert page.locator("path.edited").count() == 4
    settle(page)
    assert at_s(page) == pytest.approx(lap.start_s + float(lap.time_s[lap.at(last.from_m)]), abs=0.1)
    page.locator("#whole").click()
    assert page.locator("path.edited").count() == 0
    bend = next(number for number, one in enumerate(facts.sections) if one.kind != "straight")
    label = page.locator(f".bend[data-section='{bend}']")
    label.focus()
    page.keyboard.press("Enter")
    assert page.locator("#range").inner_text().startswith(facts.sections[bend].name)
    picture(page, "coach", whole=True)
    page.close()
    requests, complaints = heard[0]
    assert faults(complaints) == []
    assert set(requests) <= {result.page.as_uri(), "data:,"}


def test_a_clip_plays_from_its_beginning(browser: Browser, result: CoachResult) -> None:
    heard: list[tuple[list[str], list[str]]] = []
    page = opened(browser, result, heard)
    page.locator(".watch").first.click()
    assert page.locator("#play").get_attribute("aria-pressed") == "true"
    began = at_s(page)
    until(page, f"document.getElementById('scrub').value > {began + 0.2}")
    page.keyboard.press("Space")
    page.close()


def test_without_scripts_the_words_are_there(browser: Browser, result: CoachResult) -> None:
    context = browser.new_context(java_script_enabled=False)
    page = context.new_page()
    page.goto(result.page.as_uri())
    said = page.locator(".words").inner_text()
    assert result.facts.advice[0].section in said
    assert f"{result.facts.lap.lap_s:.3f} s" in said
    context.close()
