"""A recorded race in the report: the player in the page, what it is next to, and links that open a moment."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from playwright.sync_api import Browser

from nathlon.arena.passes import passes
from nathlon.arena.race_log import Incident, origin, progress
from nathlon.results.selection import Selection
from tests.support.opened_page import Opened, full_night, shown
from tests.support.race_logs import LAP_M

READY = "document.querySelector('#incidents')"
HOSTILE = "</script><img src=x onerror=document.title='owned'>"


@pytest.fixture(scope="module")
def full() -> Selection:
    return full_night()


def address(selection: Selection, **params: float) -> str:
    log = selection.logs[0]
    query = "&".join(f"{name}={value}" for name, value in params.items())
    return f"#/race/{log.match[:12]}/{log.race}" + (f"?{query}" if query else "")


def open_race(browser: Browser, folder: Path, selection: Selection, **params: float) -> Opened:
    opened = Opened(browser, selection, folder, address(selection, **params))
    opened.until(READY)
    opened.until("[...document.querySelectorAll('figure')].every(figure => figure.querySelector('svg'))")
    return opened


def shown_time(opened: Opened) -> float:
    opened.page.evaluate("new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")
    return float(opened.page.locator("#scrub").input_value())


def test_a_clip_opens_the_player_at_its_moment_with_one_click(
    browser: Browser, tmp_path: Path, full: Selection
) -> None:
    opened = Opened(browser, full, tmp_path)
    clip = full.summary.replays[0].clips[0]
    opened.page.get_by_role("link", name="0:21.5 to 0:31.5").click()
    opened.until(READY)
    assert shown_time(opened) == clip.start_s
    assert opened.page.locator("#follow").input_value() == str(clip.car)
    assert clip.why in opened.page.locator(".moments").first.inner_text()
    opened.assert_quiet()


def test_the_address_keeps_the_moment(browser: Browser, tmp_path: Path, full: Selection) -> None:
    opened = open_race(browser, tmp_path, full)
    assert opened.page.evaluate("location.hash") == address(full)
    opened.page.locator("#scrub").press("ArrowRight")
    opened.page.locator("#order tbody button").nth(2).click()
    car = opened.page.locator("#follow").input_value()
    opened.until(f"location.hash.includes('at=1.0') && location.hash.includes('car={car}')")
    opened.page.reload()
    opened.until(READY)
    assert (shown_time(opened), opened.page.locator("#follow").input_value()) == (1.0, car)
    opened.assert_quiet()


def test_the_order_in_the_page_is_that_of_the_log(browser: Browser, tmp_path: Path, full: Selection) -> None:
    opened = open_race(browser, tmp_path, full, at=10)
    # A click on the picture gives the player the keys that stand beside it.
    assert "Space play" in opened.page.locator("p.keys").inner_text()
    opened.page.locator("#scene").click()
    opened.page.keyboard.press("ArrowRight")
    assert shown_time(opened) == 11.0
    opened.page.keyboard.press("ArrowLeft")
    assert shown_time(opened) == 10.0
    order = np.argsort(full.logs[0].samples["place"][100]).tolist()
    names = opened.page.locator("#order tbody button").all_inner_texts()
    assert [name.split()[0] for name in names] == [str(car + 1) for car in order]
    opened.assert_quiet()


def test_a_car_that_did_not_finish_says_so_at_its_line(
    browser: Browser, tmp_path: Path, full: Selection
) -> None:
    log = full.logs[0]
    race = (pl.col("match") == log.match) & (pl.col("race") == log.race)
    ending = pl.when(race & (pl.col("slot") == 3)).then(pl.lit("stuck")).otherwise("ending").alias("ending")
    opened = open_race(browser, tmp_path, replace(full, results=full.results.with_columns(ending)))
    opened.until("document.querySelectorAll('figure g[data-mark=text] text').length > 0")
    labels = opened.page.locator("figure g[data-mark=text] text").all_text_contents()
    assert [label for label in labels if label.endswith("out")] == ["3 out"] * labels.count("3 out") != []
    assert "Out: did not finish." in opened.page.locator(".charts .note").inner_text()
    opened.assert_quiet()


def test_incidents_have_their_verdicts_and_lead_to_the_player(
    browser: Browser, tmp_path: Path, full: Selection
) -> None:
    log = full.logs[0]
    free = Incident(40.0, "contact", (2, 3), "3 a touches the rear of 4 b", closing_m_s=0.8)
    opened = open_race(
        browser, tmp_path, replace(full, logs=(replace(log, incidents=(*log.incidents, free)),))
    )
    verdicts = opened.column("incidents", 5)
    assert verdicts == ["2 entrant b at fault, 3.0 s", "nobody at fault"]
    assert opened.column("incidents", 4) == ["4.2", "0.8"]
    opened.page.locator("#incidents button", has_text="0:40.0").click()
    assert shown_time(opened) == 37.0
    assert opened.page.locator("#follow").input_value() == "2"
    opened.assert_quiet()


def test_the_reference_is_the_fastest_lap_to_the_finish_too(
    browser: Browser, tmp_path: Path, full: Selection
) -> None:
    """On the oval every car keeps its speed, so that the quickest one drives it, in LAP_M / speed.

    It finishes with its second lap, between two samples, of which the later one shows where it was out.
    """
    log = full.logs[0]
    speed = log.samples["velocity_x_m_s"][400]
    quickest, samples = int(np.argmax(speed)), log.samples.copy()
    come_m, finish_m = progress(log)[:, quickest], 2 * LAP_M - origin(log)
    out = int(np.argmax(come_m >= finish_m))
    samples["distance_m"][out:, quickest] -= come_m[out:] - (finish_m + 0.4)
    samples["driving"][out:, quickest] = False
    opened = open_race(browser, tmp_path, replace(full, logs=(replace(log, samples=samples),)))
    said = opened.page.get_by_text("Dashed: the reference").inner_text()
    found = re.search(r": (\d) entrant ., lap 2, ([\d.]+) s\.$", said)
    assert found is not None, said
    assert int(found[1]) == quickest + 1
    assert float(found[2]) == pytest.approx(LAP_M / float(speed.max()), abs=0.02)
    opened.assert_quiet()


def test_a_lap_is_chosen_and_kept_in_the_address(browser: Browser, tmp_path: Path, full: Selection) -> None:
    opened = open_race(browser, tmp_path, full)
    other = opened.page.locator(".controls select").nth(1)
    lines = opened.page.locator("figure g[data-mark=line] path")
    before = lines.count()
    other.select_option("4.2")
    assert opened.page.evaluate("location.hash").endswith("b=4.2")
    opened.until(f"document.querySelectorAll('figure g[data-mark=line] path').length === {before + 2}")
    opened.assert_quiet()


def test_passes_are_counted_by_section(browser: Browser, tmp_path: Path, full: Selection) -> None:
    """Two cars that swap places every 15 s or so."""
    log = full.logs[0]
    samples = log.samples.copy()
    along = 40.0 * log.time_s + 8.0
    samples["distance_m"][:, 0] = along
    samples["distance_m"][:, 1] = along + 9.0 + 15.0 * np.sin(log.time_s / 5.0)
    samples["velocity_x_m_s"][:, :2] = 40.0
    swapping = replace(log, samples=samples)
    found = passes(swapping)
    assert len(found) > 3
    opened = open_race(browser, tmp_path, replace(full, logs=(swapping,)))
    assert f"this race, {len(found)}" in opened.page.locator("main").inner_text()
    bars = opened.page.locator("figure g[data-mark=bar] rect")
    assert bars.count() == len({one.section for one in found})
    rows = opened.page.locator("ol.moments li")
    assert rows.count() == len(found)
    rows.last.locator("button").click()
    assert shown_time(opened) == pytest.approx(found[-1].time_s - 4.0, abs=0.01)
    opened.assert_quiet()


def test_a_race_that_was_not_recorded_says_how_to_record_it(
    browser: Browser, tmp_path: Path, full: Selection
) -> None:
    match = full.results["match"][0]
    opened = Opened(browser, full, tmp_path, f"#/race/{match[:12]}/0")
    assert opened.page.locator("#scene").count() == 0
    assert opened.page.locator("pre").inner_text() == f"nathlon replay nathlon.sqlite {match[:12]}:0"
    opened.assert_quiet()


def test_the_command_of_a_twin_names_the_moment_and_the_car(
    browser: Browser, tmp_path: Path, full: Selection
) -> None:
    opened = open_race(browser, tmp_path, full, at=5)
    opened.page.locator("#follow").select_option("2")
    opened.page.get_by_role("button", name="race it again").click()
    asked = opened.page.get_by_role("status").locator("pre").inner_text()
    assert asked.startswith("nathlon twin ")
    assert "--car 3 --policy FILE --at 5.0 --out twin" in asked
    opened.assert_quiet()


@pytest.mark.parametrize("ticks", [0, 1, 2])
def test_the_shortest_race_and_hostile_names_can_be_shown(
    browser: Browser, tmp_path: Path, full: Selection, ticks: int
) -> None:
    log = full.logs[0]
    short = replace(
        log,
        time_s=log.time_s[:ticks],
        samples=log.samples[:ticks],
        names=(HOSTILE, *log.names[1:]),
        sections=(),
    )
    opened = Opened(browser, replace(full, logs=(short,)), tmp_path, address(full))
    opened.until("document.querySelector('#incidents')")
    assert f"1 {HOSTILE[:13]}…{HOSTILE[-14:]}" in opened.page.locator("#follow").inner_text()
    assert opened.page.locator("main img").count() == 0
    assert "owned" not in opened.page.title()
    opened.assert_quiet()


def test_the_wheel_scrolls_the_page_and_zooms_with_control(
    browser: Browser, tmp_path: Path, full: Selection
) -> None:
    opened = open_race(browser, tmp_path, full, at=5)
    scene = opened.page.locator("#scene")
    scene.hover()
    before = opened.page.evaluate("document.getElementById('scene').toDataURL()")
    opened.page.mouse.wheel(0, 100)
    opened.until("scrollY > 0")
    assert opened.page.evaluate("document.getElementById('scene').toDataURL()") == before
    opened.page.evaluate(
        "document.getElementById('scene').dispatchEvent(new WheelEvent('wheel',"
        " {deltaY: -300, ctrlKey: true, cancelable: true}))"
    )
    opened.until(f"document.getElementById('scene').toDataURL().length !== {len(before)}")
    opened.assert_quiet()


def test_a_race_is_seen_in_three_dimensions(browser: Browser, tmp_path: Path, full: Selection) -> None:
    opened = open_race(browser, tmp_path, full, at=8, car=2)
    opened.page.get_by_role("button", name="3-D").click()
    opened.until("document.querySelector('.shot').textContent")
    assert len(np.unique(shown(opened.page, "#space").reshape(-1, 3), axis=0)) > 100
    opened.picture("race in space")
    # Back from another view the player begins on the map.
    opened.go("#/leaderboard")
    opened.go(address(full))
    opened.until(READY)
    assert opened.page.locator("#scene").is_visible()
    assert opened.page.locator("#space").is_hidden()
    opened.assert_quiet()
