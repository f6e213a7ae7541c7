"""The page of recipes in a browser."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import polars as pl
from playwright.sync_api import Browser

from nathlon.reports.recipes_page import headline, write_recipes_page
from nathlon.results.recipes import RECIPES, SCORES
from tests.support.opened_page import overhear


def row(name: str, points: float, better: tuple[float, float, float] | None, runs: int = 5) -> dict[str, Any]:
    low, value, high = better or (None, None, None)
    others = ("iqm", "gap", "at_fault_per_km")
    return {f"{one}{end}": 0.1 for one in others for end in ("", "_low", "_high")} | {
        "recipe": name, "runs": runs, "checkpoints": 10,
        "points": points, "points_low": points - 1, "points_high": points + 1,
        "better": value, "better_low": low, "better_high": high,
        "best": f"{name}-004k", "best_points": points + 3, "best_expected": points + 1,
    }  # fmt: skip


RECIPES_TABLE = pl.DataFrame(
    [row("base", 1.0, None), row("x<b>y", 4.0, (0.7, 0.9, 1.0)), row("plain", 0.5, (0.2, 0.4, 0.6))], RECIPES
)
SCORES_TABLE = pl.DataFrame(
    [
        {"recipe": name, "run": "1", "step": step, "entrant": f"{name}{step}", "task": "4v4", "points": 1.0}
        for name in RECIPES_TABLE["recipe"]
        for step in (1000, 2000)
    ],
    SCORES,
)


def test_it_says_which_recipes_are_better_and_loads_nothing(browser: Browser, tmp_path: Path) -> None:
    path = write_recipes_page(RECIPES_TABLE, SCORES_TABLE, "lindenring, gt3", ["driver"], tmp_path)
    page = browser.new_page()
    requests, complaints = overhear(page)
    page.goto(path.as_uri())
    assert page.locator("h1").inner_text() == "Better than base: x<b>y"
    assert page.locator("tbody th").all_inner_texts() == ["base", "x<b>y", "plain"]
    assert "90 %" in page.locator("tbody tr").nth(1).inner_text()
    intervals = page.locator("tbody small").all_inner_texts()
    assert intervals
    assert all(re.fullmatch(r"\(.+ to .+\)", one) for one in intervals)
    assert "fewer than five" not in page.locator("main").inner_text()
    width = page.evaluate("document.querySelector('img').naturalWidth")
    assert width > 1000
    assert [asked for asked in requests if not asked.startswith("data:")] == [path.as_uri()]
    assert complaints == []
    page.close()


def test_few_runs_are_warned_of(browser: Browser, tmp_path: Path) -> None:
    few = pl.DataFrame([row("base", 1.0, None, runs=3)], RECIPES)
    path = write_recipes_page(few, SCORES_TABLE, "lindenring", ["driver"], tmp_path)
    page = browser.new_page()
    page.goto(path.as_uri())
    assert "fewer than five" in page.locator("main").inner_text()
    assert page.locator("h1").inner_text() == headline(few) == "base: +1.0 (+0.0 to +2.0) points a race"
    page.close()
