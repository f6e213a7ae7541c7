"""The racing line of a checkpoint: its lap against another line."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from playwright.sync_api import Browser

from nathlon.results.selection import Selection
from tests.support.lap_tables import LEAST_S, RADIUS_M, ROWS, SECTIONS
from tests.support.opened_page import LIMIT_S, Opened, full_night, key


@pytest.fixture(scope="module")
def full() -> Selection:
    return full_night()


def test_the_lap_is_compared_with_the_limit_and_the_drivers_line(
    browser: Browser, tmp_path: Path, full: Selection
) -> None:
    opened = Opened(browser, full, tmp_path)
    opened.go(f"#/checkpoint/{key(full, 0)}")
    facts = opened.page.locator("main").inner_text()
    assert f"Limit\n60.500 s\nBest lap / limit\n{64.2 / LIMIT_S:.3f}\n" in facts
    assert f"Built-in driver's line\n{LEAST_S:.3f} s\nDifference\n+2.200 s" in facts
    assert opened.names("sections") == []
    assert opened.column("sections", 1) == [*SECTIONS[:3], "after Quay"]
    lost = [float(text) for text in opened.column("sections", 3)]
    assert sum(lost) == pytest.approx(2.2, abs=0.003)
    opened.page.get_by_role("link", name="64.200 s").click()
    opened.page.wait_for_url("**#/race/**")
    opened.assert_quiet()


def test_tables_compare_laps_with_the_limit(browser: Browser, tmp_path: Path, full: Selection) -> None:
    opened = Opened(browser, full, tmp_path, "#/pareto?sort=limit")
    field = full.tables["pareto"].drop_nulls("lap_s").sort("lap_s")
    assert opened.column("pareto", 5)[:200] == [f"{lap / LIMIT_S:.3f}" for lap in field["lap_s"][:200]]
    opened.go("#/leaderboard")
    finalist = full.named("ranking").join(full.tables["pareto"], on="entrant", how="left").row(0, named=True)
    assert opened.column("leaderboard", 10)[0] == f"{finalist['lap_s'] / LIMIT_S:.3f}"
    assert "over 60.500 s" in opened.page.locator("main").inner_text()
    opened.assert_quiet()


def test_nothing_is_said_of_an_unknown_limit(browser: Browser, tmp_path: Path, full: Selection) -> None:
    opened = Opened(browser, replace(full, limit_s=None), tmp_path)
    for address in (
        "#/leaderboard",
        "#/pareto",
        f"#/checkpoint/{key(full, 0)}",
        f"#/checkpoint/{key(full, 2)}",
    ):
        opened.go(address)
        text = opened.page.locator("main").inner_text()
        assert "/ limit" not in text
        assert "optimal control" not in text
    opened.assert_quiet()


def test_slider_charts_and_maps_share_a_place(browser: Browser, tmp_path: Path, full: Selection) -> None:
    opened = Opened(browser, full, tmp_path)
    opened.go(f"#/checkpoint/{key(full, 0)}")
    slider = opened.page.get_by_role("slider", name="Place on the lap")
    slider.press("Home")
    slider.press("ArrowRight")
    metres = 2 * 3.14159265 * RADIUS_M / ROWS
    said = opened.page.locator("output").inner_text()
    assert said.startswith(f"{metres:.0f} m, {SECTIONS[0]}: ")
    assert said.endswith(f"{2.2 / ROWS:+.2f} s")
    place = opened.page.locator(".close").get_attribute("viewBox")
    slider.press("End")
    assert opened.page.locator("output").inner_text().endswith("+2.20 s")
    assert opened.page.locator(".close").get_attribute("viewBox") != place
    whole = opened.page.locator(".map:not(.close)").bounding_box()
    assert whole is not None
    # The circuit is a circle, left to right from the line: a quarter of a lap on lies its northernmost point.
    opened.page.mouse.move(whole["x"] + whole["width"] / 2, whole["y"] + 5)
    assert opened.page.locator("output").inner_text().startswith(f"{RADIUS_M * 3.14159265 / 2:.0f} m, ")
    opened.assert_quiet()


def test_another_entrants_lap_is_kept_in_the_address(
    browser: Browser, tmp_path: Path, full: Selection
) -> None:
    opened = Opened(browser, full, tmp_path)
    opened.go(f"#/checkpoint/{key(full, 0)}")
    opened.page.get_by_label("Against").select_option(key(full, 1))
    assert opened.page.evaluate("location.hash").endswith(f"?against={key(full, 1)}")
    assert "Difference\n−0.700 s" in opened.page.locator("main").inner_text()
    opened.until(f"document.querySelectorAll('figure .driven path').length === {2 * ROWS}")
    opened.assert_quiet()


def test_without_a_lap_or_a_curve_nothing_is_drawn(browser: Browser, tmp_path: Path, full: Selection) -> None:
    opened = Opened(browser, full, tmp_path)
    opened.go(f"#/checkpoint/{key(full, 2)}")
    assert opened.page.locator(".map").count() == 0
    assert "It completed no lap of its time trials." in opened.page.locator("main").inner_text()
    opened.assert_quiet()


def test_the_curve_of_its_run_shows_where_it_stands(
    browser: Browser, tmp_path: Path, full: Selection
) -> None:
    opened = Opened(browser, full, tmp_path)
    opened.go(f"#/checkpoint/{key(full, 0)}")
    figure = opened.page.get_by_role("img", name="Mean flying lap, s")
    laps = full.tables["curves"]["lap_s"]
    assert figure.locator("g[data-mark=dot] circle").count() == len(laps) - laps.null_count()
    kin = full.tables["entrants"]["source"].str.starts_with("checkpoints/").sum()
    assert figure.locator("g[data-mark=rule]").first.locator("line").count() == kin
    opened.assert_quiet()
