"""The player in three dimensions: what it draws, by which cameras, how fast, and without WebGL."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from axe_playwright_python.sync_playwright import Axe
from numpy.typing import NDArray
from playwright.sync_api import Browser, Page

from nathlon.arena.race_log import RaceLog
from nathlon.reports.player import write_player
from tests.support.opened_page import faults, overhear, picture, shown
from tests.support.page_modules import module
from tests.support.race_logs import LAP_M, STRAIGHT_M, oval_height, oval_point, oval_race

NO_WEBGL = """() => {
  const context = HTMLCanvasElement.prototype.getContext;
  HTMLCanvasElement.prototype.getContext = function (kind, ...rest) {
    return kind.startsWith("webgl") ? null : context.call(this, kind, ...rest);
  };
}"""
CONTACT_S = 20.0 / 3
FOLLOWED = 1
LOADED_S = 3600.0
"""Of the page's clock, by which it is loaded."""


@pytest.fixture(scope="module")
def log() -> RaceLog:
    return oval_race(cars=4, duration_s=20.0)


class Watched:
    """A player opened from the disk at a moment behind a car, with what it complains of."""

    def __init__(
        self, browser: Browser, folder: Path, log: RaceLog, at_s: float, car: int = 0, **context: Any
    ) -> None:
        write_player(log, folder / "race.html")
        self.page: Page = browser.new_page(**{"viewport": {"width": 820, "height": 460}} | context)
        self.page.clock.install(time=0)
        self.requests, self.complaints = overhear(self.page)
        self.own = (folder / "race.html").as_uri()
        self.page.goto(f"{self.own}#at={at_s}&car={car}")
        self.page.wait_for_selector("body[data-ready]")

    def pass_time(self, seconds: float) -> None:
        """At least so much, as the page sees it, however long it takes to draw."""
        self.page.clock.run_for(round(seconds * 1000))

    def press(self, *keys: str) -> None:
        for key in keys:
            self.page.keyboard.press(key)
        self.pass_time(0.1)

    def seek(self, seconds: float) -> None:
        self.page.locator("#scrub").evaluate(
            "(bar, at) => { bar.value = at; bar.dispatchEvent(new Event('input')); }", seconds
        )
        self.pass_time(0.1)

    def now(self) -> float:
        return float(self.page.locator("#scrub").input_value())

    def told(self) -> str:
        return self.page.locator(".shot").inner_text()

    def camera(self) -> int:
        found = re.match(r"Camera (\d+) of", self.told())
        assert found is not None
        return int(found[1])

    def picture(self) -> NDArray[np.uint8]:
        return shown(self.page, "#space")

    def close(self) -> None:
        assert faults(self.complaints) == []
        assert [url for url in self.requests if url.partition("#")[0] not in (self.own, "data:,")] == []
        self.page.close()


def test_every_camera_draws_another_picture(browser: Browser, tmp_path: Path, log: RaceLog) -> None:
    watched = Watched(browser, tmp_path, log, 8.0)
    assert watched.page.locator("#space").is_hidden()
    watched.press("v")
    assert watched.page.locator("#scene").is_hidden()
    pictures = [watched.picture()]
    for _ in range(2):
        watched.press("c")
        pictures.append(watched.picture())
    for one in pictures:
        assert len(np.unique(one.reshape(-1, 3), axis=0)) > 100
    for first, second in ((0, 1), (0, 2), (1, 2)):
        assert np.abs(pictures[first].astype(int) - pictures[second]).mean() > 5
    found = Axe().run(watched.page).response["violations"]
    assert [one["id"] for one in found if one["impact"] in ("serious", "critical")] == []
    picture(watched.page, "player-space")
    watched.press("v")
    assert watched.page.locator("#space").is_hidden()
    assert watched.page.locator("#scene").is_visible()
    watched.close()


def test_trackside_cameras_keep_the_followed_car_in_the_picture(
    browser: Browser, tmp_path: Path, log: RaceLog
) -> None:
    """Where its label stands is what changes with its paint, and nothing else does."""
    paints = [tuple(team if car == FOLLOWED else 0 for car in range(len(log.names))) for team in (1, -1)]
    pages = [tmp_path / name for name in ("own", "other")]
    for folder in pages:
        folder.mkdir()
    own, other = (
        Watched(browser, folder, replace(log, teams=teams), 0.0, car=FOLLOWED)
        for folder, teams in zip(pages, paints, strict=True)
    )
    cameras = set()
    for watched in (own, other):
        watched.press("v")
    for now_s in np.linspace(1.0, 19.0, 10):
        for watched in (own, other):
            watched.seek(float(now_s))
        cameras.add(own.camera())
        label = own.page.locator(".label.own").bounding_box()
        view = own.page.locator("#space").bounding_box()
        assert label is not None
        assert view is not None
        above = label["x"] - view["x"] + label["width"] / 2, label["y"] - view["y"]
        at_px = own.page.evaluate("parseFloat(document.querySelector('.label.own').style.translate)")
        assert above[0] == pytest.approx(at_px, abs=1.0), "the label stands above its car"
        assert own.picture().any(axis=2).all(), "all places have light"
        changed = np.abs(own.picture().astype(int) - other.picture()).max(axis=2) > 40
        rows, columns = np.nonzero(changed)
        assert len(rows) > 50, now_s
        assert np.abs(columns - above[0]).max() < 30, now_s
        assert np.abs(rows - above[1] - 35).max() < 18, now_s
    assert len(cameras) > 3
    for watched in (own, other):
        watched.close()


def test_trackside_cameras_stand_outside_of_bends_and_near_enough(
    browser: Browser, tmp_path: Path, log: RaceLog
) -> None:
    watched = Watched(browser, tmp_path, log, 0.0)
    cameras = watched.page.evaluate(
        "async () => { const { race, circuit } = JSON.parse(document.getElementById('race').textContent);"
        f" const recording = await {module('race/recording.js')}.openRecording(race, circuit);"
        f" return {module('race/trackside.js')}.tracksideCameras(recording); }}"
    )
    along = np.array([camera["along"] for camera in cameras])
    # The oval turns left: its wall on the outside is 10 m to the right. Its outline has a row every 5 m.
    row_m = 5.0 * np.rint(along * len(log.outline.centre) / LAP_M)
    x, y, _ = oval_point(row_m, -11.5)
    z, _ = oval_height(row_m, -10.0)
    eyes = np.array([camera["eye"] for camera in cameras])
    assert eyes == pytest.approx(np.stack([x, y, z + 4.0], axis=1), abs=0.1)
    gaps = np.diff(np.sort(along), append=along.min() + LAP_M)
    assert gaps.max() < 250.0
    middle_of_bend = LAP_M / 4
    assert STRAIGHT_M / 2 < middle_of_bend < LAP_M / 2 - STRAIGHT_M / 2
    assert np.abs(along - middle_of_bend).min() < 6.0
    watched.close()


@pytest.mark.parametrize("closest", [(0, 1), (1, 2)])
def test_the_closest_two_are_shown(
    browser: Browser, tmp_path: Path, log: RaceLog, closest: tuple[int, int]
) -> None:
    samples = log.samples.copy()
    # With it, the third comes up to the second by 4 m.
    samples["distance_m"][:, 2] += np.linspace(0.0, 4.0, len(samples)) * closest[0]
    watched = Watched(browser, tmp_path, replace(log, samples=samples), 4.0)
    watched.press("v")
    for key in ("ArrowDown", "m"):
        watched.press(key)
        found = re.search(r": (\d) entrant ., [\d.]+ s before (\d) entrant .$", watched.told())
        assert found is not None
        assert (int(found[1]) - 1, int(found[2]) - 1) == closest
        shown = watched.page.locator(
            "#space + .labels .label:visible, .labels .label:visible"
        ).all_inner_texts()
        assert {found[1], found[2]} <= set(shown), "who is spoken of is in the picture"
    watched.close()


def test_contacts_are_seen_in_slow_motion(browser: Browser, tmp_path: Path, log: RaceLog) -> None:
    watched = Watched(browser, tmp_path, log, CONTACT_S - 1.0)
    # Time that also passes by itself comes in pieces of any length, and the player cuts long ones short.
    watched.page.clock.pause_at(LOADED_S)

    def rate(from_s: float) -> float:
        """Seconds of the race in a second of the page's clock."""
        watched.seek(from_s)
        watched.page.locator("#play").click()
        watched.pass_time(0.1)
        moment = "[Number(document.getElementById('scrub').value), performance.now() / 1000]"
        before = np.array(watched.page.evaluate(moment))
        watched.pass_time(1.0)
        passed = np.array(watched.page.evaluate(moment)) - before
        watched.page.locator("#play").click()
        return float(passed[0] / passed[1])

    assert rate(CONTACT_S - 1.0) == pytest.approx(1.0, abs=0.1)
    watched.page.get_by_label("slow motion on incidents").check()
    assert rate(CONTACT_S - 1.0) == pytest.approx(0.25, abs=0.03)
    assert rate(CONTACT_S + 5.0) == pytest.approx(1.0, abs=0.1)
    watched.close()


@pytest.mark.parametrize("motion", ["no-preference", "reduce"])
def test_cameras_cut_while_it_plays_unless_motion_is_reduced(
    browser: Browser, tmp_path: Path, motion: str
) -> None:
    small = {"width": 400, "height": 300}
    log = oval_race(cars=4, duration_s=60.0)
    watched = Watched(browser, tmp_path, log, 6.0, reduced_motion=motion, viewport=small)
    watched.page.locator("#rate").select_option("4")
    watched.press("v")
    first = watched.camera()
    watched.press("Space")
    while watched.now() < 12.0:
        watched.pass_time(0.1)
    assert (watched.camera() == first) == (motion == "reduce")
    watched.press("Space")
    assert watched.camera() != first
    assert watched.page.get_by_label("slow motion").is_disabled() == (motion == "reduce")
    watched.close()


def test_without_webgl_the_map_stays(browser: Browser, tmp_path: Path, log: RaceLog) -> None:
    watched = Watched(browser, tmp_path, log, 4.0)
    watched.page.evaluate(NO_WEBGL)
    watched.page.get_by_role("button", name="3-D").click()
    told = watched.page.locator(".lacking").inner_text()
    assert told == "This browser has no WebGL, so the race stays on the map."
    assert watched.page.locator("#scene").is_visible()
    assert watched.page.locator("#space").is_hidden()
    assert watched.page.get_by_role("button", name="3-D").get_attribute("aria-pressed") == "false"
    watched.close()


def test_the_player_fills_the_screen_and_leaves_it(browser: Browser, tmp_path: Path, log: RaceLog) -> None:
    watched = Watched(browser, tmp_path, log, 4.0)
    button = watched.page.get_by_role("button", name="Full screen")
    button.click()
    watched.page.wait_for_selector(".player:fullscreen")
    assert watched.page.locator("#play").is_visible()
    watched.press("f")
    watched.page.wait_for_selector(".player:not(:fullscreen)")
    watched.close()
