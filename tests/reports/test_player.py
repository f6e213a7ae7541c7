"""The player is one page that needs nothing else, and shows the race."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import Browser, Page

from nathlon.arena.race_log import RaceLog, progress
from nathlon.reports.player import render_player, write_player
from tests.support.opened_page import overhear
from tests.support.race_logs import oval_race

HOSTILE = "</script><script>document.title='owned'</script><img src=x onerror=document.title='owned'>"


@pytest.fixture(scope="module")
def log() -> RaceLog:
    return oval_race(cars=3, duration_s=20.0)


class Opened:
    """A player opened from the disk, with all that it asked for or complained of."""

    def __init__(self, browser: Browser, path: Path) -> None:
        self.page: Page = browser.new_page(viewport={"width": 1000, "height": 700})
        self.requests, self.complaints = overhear(self.page)
        self.page.goto(path.as_uri())
        self.page.wait_for_selector("body[data-ready]")
        self.own = path.as_uri()

    def settle(self) -> None:
        self.page.evaluate("new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")

    def picture(self, canvas: str = "scene") -> bytes:
        self.settle()
        data: str = self.page.evaluate(f"document.getElementById('{canvas}').toDataURL()")
        return data.encode()

    def scrub(self, seconds: float) -> None:
        self.page.locator("#scrub").evaluate(
            "(bar, at) => { bar.value = at; bar.dispatchEvent(new Event('input')); }", seconds
        )
        self.settle()

    def now(self) -> float:
        self.settle()
        return float(self.page.locator("#scrub").input_value())

    def assert_quiet(self) -> None:
        assert [url for url in self.requests if url not in (self.own, "data:,")] == []
        assert self.complaints == []


def test_a_penalty_zone_says_what_it_is(browser: Browser, tmp_path: Path, log: RaceLog) -> None:
    free = replace(log, outline=replace(log.outline, zone=np.zeros_like(log.outline.zone)))
    for race, told in ((log, ["penalty zone"]), (free, [])):
        path = tmp_path / f"{len(told)}.html"
        write_player(race, path)
        opened = Opened(browser, path)
        assert opened.page.locator(".zones").all_inner_texts() == told
        opened.assert_quiet()


def test_names_that_are_too_long_keep_their_ends(browser: Browser, tmp_path: Path, log: RaceLog) -> None:
    names = tuple(f"a-name-of-a-run-that-is-long-{end}" for end in ("fair-012k", "fair-024k", "mend-059k"))
    path = tmp_path / "race.html"
    write_player(replace(log, names=names), path)
    opened = Opened(browser, path)
    right = "e => e.getBoundingClientRect().right"
    for button in opened.page.locator("#order tbody button").all():
        whole, ends = button.get_attribute("title") or "", button.locator("span").nth(1)
        assert whole.partition(" ")[2] in names
        assert whole.endswith(ends.inner_text())
        assert ends.inner_text()[1:] in {name[-9:] for name in names}
        assert ends.evaluate(right) <= button.evaluate(right)
    options = opened.page.locator("#follow option").all_text_contents()[1:]
    assert [option[-9:] for option in options] == [name[-9:] for name in names]
    opened.page.locator("#follow").select_option("2")
    assert (opened.page.locator("#follow").get_attribute("title") or "").endswith(names[2])
    opened.assert_quiet()


@pytest.fixture
def opened(browser: Browser, log: RaceLog, tmp_path: Path) -> Iterator[Opened]:
    write_player(log, tmp_path / "race.html")
    assert [path.name for path in tmp_path.iterdir()] == ["race.html"]
    opened = Opened(browser, tmp_path / "race.html")
    yield opened
    opened.assert_quiet()
    opened.page.close()


def colours(opened: Opened) -> int:
    """How many colours the scene has."""
    count: int = opened.page.evaluate(
        "(() => { const c = document.getElementById('scene');"
        " const d = new Uint32Array(c.getContext('2d').getImageData(0, 0, c.width, c.height).data.buffer);"
        " return new Set(d).size; })()"
    )
    return count


def test_scrubbing_changes_the_picture_and_coming_back_restores_it(opened: Opened) -> None:
    assert colours(opened) > 20
    pictures = []
    for seconds in (2.0, 5.0, 12.0, 2.0):
        opened.scrub(seconds)
        pictures.append((opened.picture(), opened.picture("traces")))
    assert len(set(pictures)) == 3
    assert pictures[0] == pictures[3]


def test_the_order_is_that_of_the_log(opened: Opened, log: RaceLog) -> None:
    opened.scrub(10.0)
    last = log.samples[100]
    order = np.argsort(last["place"]).tolist()
    rows = opened.page.locator("#order tbody tr")
    assert [name.split()[0] for name in rows.locator("button").all_inner_texts()] == [
        str(car + 1) for car in order
    ]
    speeds = rows.locator("td:nth-child(4)").all_inner_texts()
    expected = [
        round(3.6 * float(last["velocity_x_m_s"][car])) if last["driving"][car] else None for car in order
    ]
    for shown, speed in zip(speeds, expected, strict=True):
        assert shown == "–" if speed is None else abs(int(shown) - speed) <= 1
    along = progress(log)
    then = np.interp(along[100, order[2]], along[:, order[0]], log.time_s)
    gap = float(rows.nth(2).locator("td:nth-child(3)").inner_text())
    assert gap == pytest.approx(10.0 - then, abs=0.11)


def test_keys_drive_it(opened: Opened) -> None:
    page = opened.page
    opened.scrub(5.0)
    for key, expected in (
        ("ArrowRight", 6.0),
        ("ArrowLeft", 5.0),
        ("Shift+ArrowRight", 15.0),
        (".", 15.1),
        ("Home", 0.0),
        ("End", 19.9),
        ("[", 10.0),  # the contact is the only incident that is no notice
    ):
        page.keyboard.press(key)
        if key == "[":
            expected = 20.0 / 3
        assert opened.now() == pytest.approx(expected, abs=0.01), key
    followed = page.locator("#follow").input_value()
    page.keyboard.press("ArrowDown")
    assert page.locator("#follow").input_value() != followed
    near = opened.picture()
    page.keyboard.press("m")
    assert page.locator("#follow").input_value() == "-1"
    assert opened.picture() != near


def test_it_plays_to_the_end_and_stops(opened: Opened) -> None:
    opened.scrub(19.5)
    opened.page.keyboard.press("Space")
    assert opened.page.locator("#play").inner_text() == "Pause"
    opened.page.wait_for_function("() => document.getElementById('play').textContent === 'Play'")
    assert opened.now() == pytest.approx(19.9, abs=0.01)


def test_an_incident_is_told_and_can_be_gone_to(opened: Opened, log: RaceLog) -> None:
    opened.page.locator("#incidents button").first.click()
    assert opened.now() == pytest.approx(log.incidents[0].time_s - 2.0, abs=0.01)
    opened.scrub(log.incidents[0].time_s + 0.5)
    assert opened.page.locator("#news").inner_text() == log.incidents[0].text
    assert opened.page.locator("#marks line").count() == len(log.incidents)


def test_nothing_runs_out_of_a_hostile_name(browser: Browser, log: RaceLog, tmp_path: Path) -> None:
    names = (HOSTILE, *log.names[1:])
    write_player(replace(log, names=names, circuit=HOSTILE), tmp_path / "race.html")
    opened = Opened(browser, tmp_path / "race.html")
    assert "owned" not in opened.page.title().replace(HOSTILE, "")
    assert HOSTILE in (opened.page.locator("#order").text_content() or "")
    opened.assert_quiet()


@pytest.mark.parametrize("ticks", [0, 1, 2])
def test_the_shortest_races_can_be_opened(browser: Browser, log: RaceLog, tmp_path: Path, ticks: int) -> None:
    short = replace(log, time_s=log.time_s[:ticks], samples=log.samples[:ticks], incidents=())
    write_player(short, tmp_path / "race.html")
    opened = Opened(browser, tmp_path / "race.html")
    assert len(opened.picture()) > 1000
    opened.assert_quiet()


def test_it_fits_a_telephone(browser: Browser, log: RaceLog, tmp_path: Path) -> None:
    write_player(log, tmp_path / "race.html")
    opened = Opened(browser, tmp_path / "race.html")
    opened.page.set_viewport_size({"width": 380, "height": 700})
    assert opened.page.evaluate("document.documentElement.scrollWidth") <= 380


def test_the_same_race_gives_the_same_page_and_its_policy_admits_nothing_else(log: RaceLog) -> None:
    page = render_player(log)
    assert page == render_player(log)
    assert page != render_player(log, follow=2)
    policy = re.findall(r'Content-Security-Policy" content="([^"]*)"', page)[0]
    assert "unsafe" not in policy
    assert policy.startswith("default-src")


def test_the_page_stays_small() -> None:
    """Scripts and circuit below 150 kB, and some 60 bytes for each second of a car."""
    log = oval_race(cars=8, duration_s=90.0)
    assert len(render_player(log).encode()) < 150_000 + 60 * 8 * 90
