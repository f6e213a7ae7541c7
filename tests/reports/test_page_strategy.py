"""Strategies in the report: stints and stops of a race, and policies crossed with strategies."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import polars as pl
from playwright.sync_api import Browser

from nathlon.arena.results import STRATEGIES
from nathlon.arena.stints import DrivenStint, written
from nathlon.results.selection import Selection
from tests.support.opened_page import Opened, full_night

TWO = written(
    [
        DrivenStint("racing-soft", 1, 9.0, 31.5),
        DrivenStint("racing-medium", 2, 16.25, 40.0),
        DrivenStint("racing-hard", 2),
    ]
)
NONE = written([DrivenStint("racing-hard", 5)])


def stopping(selection: Selection) -> Selection:
    """The recorded race, in which the first car stops twice, the others never, and one has no strategist."""
    log = selection.logs[0]
    here = (pl.col("match") == log.match) & (pl.col("race") == log.race)
    car = pl.col("car")
    stints = pl.when(here & (car == 0)).then(pl.lit(TWO)).when(here & (car < 7)).then(pl.lit(NONE))
    return replace(selection, results=selection.results.with_columns(stints=stints))


def crossed(selection: Selection) -> Selection:
    first, second = selection.tables["ranking"]["entrant"][:2]
    rows = [
        ("quick", "", None, 5.5, 4.5, 6.5, 0.0, -0.1, 0.1, 4),
        ("", "planner", None, 6.0, 5.0, 7.0, 0.5, 0.25, 0.75, 4),
        ("", "1 stop", None, 5.0, 4.0, 6.0, -0.5, -0.75, -0.25, 4),
        ("quick", "planner", first, 6.0, 5.0, 7.0, 0.0, 0.0, 0.0, 4),
        ("quick", "1 stop", second, 5.0, 4.0, 6.0, 0.0, 0.0, 0.0, 4),
    ]
    table = pl.DataFrame(rows, schema=STRATEGIES, orient="row")
    return replace(selection, tables={**selection.tables, "strategies": table})


def test_a_race_shows_its_stints_and_what_stops_took(browser: Browser, tmp_path: Path) -> None:
    selection = stopping(full_night())
    log = selection.logs[0]
    opened = Opened(browser, selection, tmp_path, f"#/race/{log.match[:12]}/{log.race}")
    opened.until("document.querySelector('#incidents')")
    opened.until("[...document.querySelectorAll('figure')].every(figure => figure.querySelector('svg'))")
    page = opened.page
    chart = page.get_by_role("img", name="Stints of every car")
    assert "5 racing-hard" in (chart.text_content() or "")
    assert chart.locator("[data-mark=bar] rect").count() == 3 + 6
    heads = page.locator("#result thead").inner_text()
    assert all(head in heads for head in ("Stops", "Standing, s", "In the lane, s"))
    winner = page.locator("#result tbody tr").first.inner_text().split()
    assert {"2", "25.3", "71.5"} <= set(winner)
    chart.scroll_into_view_if_needed()
    opened.picture("stints")
    opened.assert_quiet()


def test_policies_and_strategies_are_told_apart(browser: Browser, tmp_path: Path) -> None:
    opened = Opened(browser, crossed(full_night()), tmp_path, "#/leaderboard")
    opened.until("document.querySelector('#strategies')")
    table = opened.page.locator("#strategies").inner_text()
    assert "Effect of the strategy" in table
    assert "+0.50" in table
    assert "−0.75 to −0.25" in table
    assert opened.page.locator("#strategies td a strong").inner_text() == "6.00"
    opened.page.locator("#strategies").scroll_into_view_if_needed()
    opened.picture("strategies")
    opened.assert_quiet()
