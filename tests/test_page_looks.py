"""How the page looks and feels: in light and dark, on a phone, on paper, by keyboard."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Browser

from nathlon.reports.selection import Selection
from tests.opened_page import Opened, full_night, key, views

SHEET_PX = 1032
"""Width of what is printed on A4 in landscape with margins of 12 mm."""


@pytest.fixture(scope="module")
def full() -> Selection:
    return full_night()


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_every_view_is_quiet_and_accessible(
    browser: Browser, tmp_path: Path, full: Selection, scheme: str
) -> None:
    opened = Opened(browser, full, tmp_path, color_scheme=scheme)
    axe = Axe()
    titles = set()
    for address in views(full):
        opened.go(address)
        titles.add(opened.page.title())
        found = axe.run(opened.page).response["violations"]
        serious = [
            (fault["id"], fault["nodes"][0]["html"])
            for fault in found
            if fault["impact"] in ("serious", "critical")
        ]
        assert serious == [], address
        opened.picture(f"{scheme} {address}")
    assert len(titles) == len(views(full)) - 1  # contacts and points are one view
    opened.assert_quiet()


def test_no_view_is_wider_than_a_phone(browser: Browser, tmp_path: Path, full: Selection) -> None:
    opened = Opened(browser, full, tmp_path, viewport={"width": 390, "height": 800})
    for address in views(full):
        opened.go(address)
        assert opened.page.evaluate("document.documentElement.scrollWidth") == 390, address
        opened.picture(f"phone {address}")
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
