"""The page of a settings matrix in a browser."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from playwright.sync_api import Browser

from nathlon.reports.matrix_page import difference, write_matrix_page
from nathlon.results.matrix import CellReport, LevelReport, MatrixFinding, MatrixMeasure, MatrixReport
from tests.support.opened_page import overhear, picture


def finding(worse: float | None, verdict: Any) -> MatrixFinding:
    bounds = (None, None) if worse is None else (worse - 0.01, worse + 0.01)
    return MatrixFinding(
        worse=worse, low=bounds[0], high=bounds[1], policy=48.0, baseline=50.0, verdict=verdict
    )


def level(delay_s: float, *findings: MatrixFinding) -> LevelReport:
    return LevelReport(dimension="delay_s", level=delay_s, findings=findings)


def report(circuits: int = 3, cars: int = 3) -> MatrixReport:
    scenarios = ("sprint", "a<b>c", "following", "chicane_in_traffic", "braking_duel")
    cells = [
        CellReport(
            circuit=f"circuit-{circuit}", car=f"car-{car}", scenario=scenario, compound=compound,
            delay_s=delay, place=place, runs=12,
            findings=(
                finding(0.03 if bad else 0.002 * circuit - 0.001, "worse" if bad else "no sign"),
                finding(None if scenario == "sprint" else 0.1, "no sign"),
            ),
            replay="replays/01.html" if bad and place == 4 else None,
        )
        for circuit in range(circuits) for car in range(cars) for scenario in scenarios
        for compound in ("racing-hard", "racing-soft") for delay in (0.0, 0.1, 0.2) for place in (1, 4)
        for bad in [scenario == "a<b>c" and delay == 0.2 and circuit == 1]
    ]  # fmt: skip
    return MatrixReport(
        policy="new", policy_id="n", baseline="old", baseline_id="o", world="racing", seed=1,
        false_discovery_rate=0.05, screening_runs=4, runs=8 * len(cells), wall_s=60.0, versions={},
        measures=(
            MatrixMeasure(name="pace", unit="m/s", relative=True, less_is_better=False, margin=0.005),
            MatrixMeasure(name="off_course", unit="s", relative=False, less_is_better=True, margin=0.5),
        ),
        set_aside=("porto-sereno with gt3: cannot",), cells=tuple(cells),
        levels=(
            level(0.0, finding(-0.001, "no sign"), finding(None, "no sign")),
            level(0.2, finding(0.02, "worse"), finding(0.1, "no sign")),
        ),
    )  # fmt: skip


def test_what_has_no_unit_is_told_without() -> None:
    score = MatrixMeasure(name="score", unit="1", relative=False, less_is_better=False, margin=0.0)
    assert difference(score, finding(2.0, "worse")).startswith("+2 (")


def test_what_got_worse_stands_first_and_every_cell_can_be_reached(browser: Browser, tmp_path: Path) -> None:
    made = report()
    path = write_matrix_page(made, tmp_path)
    page = browser.new_page(viewport={"width": 1400, "height": 900})
    requests, complaints = overhear(page)
    page.goto(path.as_uri())
    assert page.locator("h1").inner_text() == "new is worse than old in 12 of 540 cells."
    assert page.locator("#grid rect[data-cell]").count() == 540
    assert page.locator("#grid circle").count() == 12
    common, worst = page.locator("table").nth(0), page.locator("table").nth(1)
    assert common.locator("tbody th").all_inner_texts() == ["no delay", "0.2 s late"]
    assert common.locator("td.fail").all_inner_texts() == ["+2 %\n+1 to +3"]
    assert worst.locator("tbody th").first.inner_text() == "a<b>c"
    assert page.get_by_role("link", name="side by side").count() == 6
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
    picture(page, "matrix")

    page.locator("#grid svg").focus()
    page.keyboard.press("ArrowDown")
    first = page.locator("#detail h3").inner_text()
    assert first == "sprint, place 1, circuit-0, car-0, racing-hard, no delay"
    page.keyboard.press("ArrowDown")
    assert page.locator("#detail h3").inner_text() == first.replace("place 1", "place 4")
    page.keyboard.press("ArrowRight")
    assert page.locator("#detail h3").inner_text().endswith("racing-hard, 0.1 s late")
    assert "not measured" in page.locator("#detail").inner_text()

    page.locator("#grid rect.c-n4").first.hover()
    assert "+3 %" in page.locator("#detail").inner_text()
    page.select_option("#measure", label="off course")
    assert page.locator("#grid circle").count() == 0
    page.get_by_label("car", exact=True).check()
    assert "measure=off%20course&down=scenario+place+car" in page.url
    page.reload()
    assert page.get_by_label("car", exact=True).is_checked()
    assert page.locator("#grid rect[data-cell]").count() == 540
    assert requests[0] == path.as_uri()
    assert all(asked == path.as_uri() for asked in requests)
    assert complaints == []
    page.close()


def test_a_narrow_window_scrolls_the_map_and_not_the_page(browser: Browser, tmp_path: Path) -> None:
    page = browser.new_page(viewport={"width": 390, "height": 800})
    page.goto(write_matrix_page(report(), tmp_path).as_uri())
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
    page.close()


def test_nothing_worse_says_so(browser: Browser, tmp_path: Path) -> None:
    cell = report().cells[0]
    calm = report().model_copy(update={"cells": (cell,)})
    page = browser.new_page()
    page.goto(write_matrix_page(calm, tmp_path).as_uri())
    assert page.locator("h1").inner_text() == "new is nowhere proven to be worse than old: 1 cell."
    assert "Nothing looked worse." in page.locator("main").inner_text()
    page.close()
