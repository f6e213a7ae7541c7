"""How the page looks and feels: in light and dark, on a phone, on paper, by keyboard."""

from __future__ import annotations

import itertools
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import polars as pl
import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Browser

from nathlon.arena.results import SKILLS
from nathlon.results.selection import Selection
from nathlon.results.standing import ActionTime
from nathlon.selection.battery import DECATHLON, ON_REQUEST
from nathlon.selection.battery.skill import SKILLS_FOLDER
from tests.support.opened_page import Opened, full_night, key, views

pytestmark = pytest.mark.takes_long

SHEET_PX = 1032
"""Width of what is printed on A4 in landscape with margins of 12 mm."""


@pytest.fixture(scope="module")
def full() -> Selection:
    return full_night()


@pytest.fixture(scope="module")
def short() -> Selection:
    """A night whose tables are short: what is looked at cell by cell is the same in every row."""
    return full_night(entrants=40)


COLOURS = {"runOnly": ["color-contrast", "link-in-text-block"]}
"""What is left to look at in other colours: all else is the same."""


@pytest.mark.parametrize(("scheme", "rules"), [("light", {}), ("dark", COLOURS)], ids=["light", "dark"])
def test_every_view_is_quiet_and_accessible(
    browser: Browser, tmp_path: Path, short: Selection, scheme: str, rules: dict[str, Any]
) -> None:
    opened = Opened(browser, short, tmp_path, color_scheme=scheme)
    axe = Axe()
    titles = set()
    for address in views(short):
        opened.go(address)
        titles.add(opened.page.title())
        found = axe.run(opened.page, options={"resultTypes": ["violations"], **rules}).response["violations"]
        serious = [
            (fault["id"], fault["nodes"][0]["html"])
            for fault in found
            if fault["impact"] in ("serious", "critical")
        ]
        assert serious == [], address
        opened.picture(f"{scheme} {address}")
    assert len(titles) == len(views(short)) - 1  # contacts and points are one view
    opened.assert_quiet()


def test_no_view_is_wider_than_a_phone(browser: Browser, tmp_path: Path, short: Selection) -> None:
    opened = Opened(browser, short, tmp_path, viewport={"width": 390, "height": 800})
    for address in views(short):
        opened.go(address)
        assert opened.page.evaluate("document.documentElement.scrollWidth") == 390, address
        links = opened.page.evaluate(
            "[...document.querySelectorAll('nav a, nav button')].map(e => e.getBoundingClientRect().right)"
        )
        assert max(links) <= 390
        opened.picture(f"phone {address}")
    opened.assert_quiet()


NAMES = "[...document.querySelectorAll('figure g[data-mark=text] text')]"


@pytest.mark.parametrize("width", [1280, 390])
def test_names_of_the_front_cover_neither_each_other_nor_their_dots(
    browser: Browser, tmp_path: Path, short: Selection, width: int
) -> None:
    opened = Opened(browser, short, tmp_path, viewport={"width": width, "height": 900})
    opened.go("#/pareto")
    box = "(e => [e.left, e.right, e.top, e.bottom])(e.getBoundingClientRect())"
    boxes = opened.page.evaluate(f"{NAMES}.map(e => {box})")
    for (left, right, top, bottom), (other, end, above, below) in itertools.combinations(boxes, 2):
        assert right <= other or end <= left or bottom <= above or below <= top
    assert all(left >= 0 and right <= width for left, right, *_ in boxes)
    told = opened.page.evaluate(f"{NAMES}.map(e => e.textContent)")
    finalists = set(short.named("ranking")["name"])
    assert [name for name in told if name.endswith(", sent")]
    if width == 1280:
        assert finalists <= {name.removesuffix(", sent") for name in told}
    opened.assert_quiet()


SUMS = {"points": 10_250.0, "points_low": 10_150.0, "points_high": 10_350.0}


def with_shipped_tests(selection: Selection) -> Selection:
    """The selection with points in all tests that are held unasked, of four digits in some, sums of five.

    The actions of all that were ranked are timed.
    """
    tests = sorted({file.stem for file in SKILLS_FOLDER.glob("*.toml")} - set(ON_REQUEST))
    battery = selection.tables["battery"].with_columns(
        *(pl.lit(value).alias(name) for name, value in SUMS.items())
    )
    rows = [
        dict.fromkeys(SKILLS, 1.0)
        | {"entrant": entrant, "test": test, "unit": "s", "points": points, "runs": 24}
        for place, entrant in enumerate(battery["entrant"])
        for test, points in zip(tests, range(1090 - 40 * place, 0, -25), strict=False)
    ]
    tables = {**selection.tables, "battery": battery, "skills": pl.DataFrame(rows, schema=SKILLS)}
    times = tuple(
        ActionTime(
            name="", entrant=one, median_ms=0.052, p99_ms=0.104, actions=500, model_bytes=480_000, machine="m"
        )
        for one in selection.tables["ranking"]["entrant"]
    )
    summary = selection.summary.model_copy(update={"action_times": times})
    return replace(selection, tables=tables, summary=summary)


HIDDEN = "document.querySelector('.scroll').scrollWidth - document.querySelector('.scroll').clientWidth"
HEADS = "[...document.querySelectorAll('#n-athlon thead .test button')]"


def test_widest_tables_fit_a_window(browser: Browser, tmp_path: Path, full: Selection) -> None:
    opened = Opened(
        browser, with_shipped_tests(full), tmp_path, "#/n-athlon", viewport={"width": 1280, "height": 900}
    )
    assert len(opened.page.evaluate(f"{HEADS}.map(e => e.textContent)")) == len(DECATHLON)
    assert opened.page.evaluate(HIDDEN) == 0
    boxes = opened.page.evaluate(f"{HEADS}.map(e => e.getBoundingClientRect()).map(e => [e.left, e.right])")
    assert all(right <= left for (_, right), (left, _) in itertools.pairwise(boxes))
    opened.picture("all shipped tests")
    opened.go("#/leaderboard")
    assert opened.page.evaluate(HIDDEN) == 0
    opened.assert_quiet()


@pytest.mark.parametrize(("width", "name"), [(1100, "a-name-as-long-as-it-is-shown-at-most"), (390, "e")])
def test_names_stay_where_a_wide_table_scrolls(
    browser: Browser, tmp_path: Path, full: Selection, width: int, name: str
) -> None:
    selection = with_shipped_tests(full)
    entrants = selection.tables["entrants"].with_columns(
        name=pl.format("{}-{}", pl.lit(name), pl.int_range(pl.len()))
    )
    wide = replace(selection, tables={**selection.tables, "entrants": entrants})
    opened = Opened(browser, wide, tmp_path, "#/n-athlon", viewport={"width": width, "height": 900})
    assert opened.page.evaluate(HIDDEN) > 0
    opened.page.evaluate("document.querySelector('.scroll').scrollLeft = 1e4")
    # The last test's points are in sight, and the name lies before whatever else is where it is.
    row = "document.querySelector('#n-athlon tbody tr')"
    last, box, link = (
        opened.page.evaluate(f"(e => [e.left, e.right, e.top])({place}.getBoundingClientRect())")
        for place in (
            f"{row}.lastChild",
            "document.querySelector('.scroll')",
            f"{row}.querySelector('.name a')",
        )
    )
    assert last[1] <= box[1] + 1
    assert box[0] <= link[0] < link[1] <= last[0]
    on_top = f"document.elementFromPoint({link[0] + 3}, {link[2] + 8}) === {row}.querySelector('.name a')"
    assert opened.page.evaluate(on_top)
    opened.picture(f"scrolled n-athlon {width}")
    opened.assert_quiet()


def test_paper_is_light_and_holds_everything(browser: Browser, tmp_path: Path, full: Selection) -> None:
    opened = Opened(browser, full, tmp_path, color_scheme="dark", viewport={"width": SHEET_PX, "height": 730})
    opened.page.emulate_media(media="print")
    for address in views(full):
        opened.go(address)
        opened.page.evaluate("dispatchEvent(new Event('beforeprint'))")
        assert opened.page.evaluate("document.documentElement.scrollWidth") == SHEET_PX, address
        cut = "[...document.querySelectorAll('.scroll')].some(box => box.scrollWidth > box.clientWidth + 1)"
        assert not opened.page.evaluate(cut), address
        opened.picture(f"paper {address}")
    assert _luminance(opened.page.evaluate("getComputedStyle(document.body).color")) < 0.05
    opened.go("#/pareto")
    opened.page.evaluate("dispatchEvent(new Event('beforeprint'))")
    assert len(opened.column("pareto", 1)) == full.tables["pareto"].height
    opened.assert_quiet()


def test_the_button_changes_the_colours_until_they_are_the_systems(
    browser: Browser, tmp_path: Path, full: Selection
) -> None:
    opened = Opened(browser, full, tmp_path, color_scheme="light")
    paper = "getComputedStyle(document.body).backgroundColor"
    light = opened.page.evaluate(paper)
    opened.page.get_by_role("button", name="Dark colours").click()
    dark = opened.page.evaluate(paper)
    assert _luminance(dark) < 0.05 < _luminance(light)
    opened.page.reload()
    assert opened.page.evaluate(paper) == dark
    opened.page.get_by_role("button", name="Light colours").click()
    assert opened.page.evaluate(paper) == light
    opened.page.emulate_media(color_scheme="dark")
    opened.until(f"{paper} === '{dark}'")
    opened.assert_quiet()


def test_arrow_keys_walk_through_tables(browser: Browser, tmp_path: Path, full: Selection) -> None:
    opened = Opened(browser, full, tmp_path, "#/matchups")
    focused = "document.activeElement.closest('td, th')"
    opened.page.locator("#matchups tbody tr").nth(1).locator(".cell a").first.focus()
    walked = []
    for arrow in ("ArrowRight", "ArrowDown", "ArrowLeft", "ArrowLeft", "ArrowUp", "ArrowUp"):
        opened.page.keyboard.press(arrow)
        walked.append(opened.page.evaluate(f"[{focused}.parentElement.rowIndex, {focused}.cellIndex]"))
    # From the cell (2, 1); the diagonal has nothing to stand on, and above the first row there is nothing.
    assert walked == [[2, 3], [4, 3], [4, 2], [4, 1], [3, 1], [2, 1]]
    opened.page.keyboard.press("Enter")
    opened.page.wait_for_url(f"**#/matchup/{key(full, 1)}/{key(full, 0)}")
    opened.assert_quiet()


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_heat_map_is_legible(browser: Browser, tmp_path: Path, full: Selection, scheme: str) -> None:
    """Text on every shade has the contrast of WCAG 2 level AA."""
    opened = Opened(browser, full, tmp_path, "#/matchups", color_scheme=scheme)
    pairs = opened.page.evaluate(
        "[...document.querySelectorAll('.cell')].map(e => {"
        " const own = getComputedStyle(e); return [own.color, own.backgroundColor]})"
    )
    assert len(pairs) == 30
    assert min(_contrast(text, ground) for text, ground in {tuple(pair) for pair in pairs}) >= 4.5
    opened.assert_quiet()


def _contrast(text: str, ground: str) -> float:
    light, dark = sorted((_luminance(text), _luminance(ground)), reverse=True)
    return (light + 0.05) / (dark + 0.05)


def _luminance(colour: str) -> float:
    channels = [int(value) / 255 for value in re.findall(r"\d+", colour)[:3]]
    red, green, blue = (c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in channels)
    return 0.2126 * red + 0.7152 * green + 0.0722 * blue
