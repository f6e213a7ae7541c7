from __future__ import annotations

import re
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest
from playwright.sync_api import Browser, Page, sync_playwright

from reports.page import duration, number, render, signed, write_page
from reports.selection import Selection
from reports.verdict import verdict
from tests.selections import build, card, ranked, with_tables

CHROMIUM = shutil.which("chromium")
HOSTILE = "</script><script>document.title='owned'</script><img src=x onerror=document.title='owned'>"


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    if CHROMIUM is None:
        pytest.skip("chromium is not installed")
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        yield browser
        browser.close()


class Opened:
    """A page opened from the disk, with all that it asked for or complained of."""

    def __init__(self, browser: Browser, selection: Selection, folder: Path, **context: Any) -> None:
        path = write_page(selection, folder)
        self.requests: list[str] = []
        self.complaints: list[str] = []
        self.page: Page = browser.new_page(**context)
        self.page.on("request", lambda request: self.requests.append(request.url))
        self.page.on("console", lambda message: self.complaints.append(message.text))
        self.page.on("pageerror", lambda error: self.complaints.append(str(error)))
        self.page.add_init_script(
            "document.addEventListener('securitypolicyviolation',"
            " e => console.error('violation', e.violatedDirective))"
        )
        self.page.goto(path.as_uri())
        self.own = path.as_uri()

    def column(self, table: str, index: int) -> list[str]:
        cells = self.page.locator(f"#{table} tbody tr > :nth-child({index})")
        return [text.strip() for text in cells.all_inner_texts()]

    def assert_quiet(self) -> None:
        self.page.wait_for_function(
            "!document.querySelector('figure') || document.querySelectorAll('figure svg').length === 2"
        )
        assert [url for url in self.requests if url not in (self.own, "data:,")] == []
        assert self.complaints == []
        self.page.close()


def test_page_is_whole_and_quiet(browser: Browser, tmp_path: Path) -> None:
    selection = build(np.random.default_rng(0), entrants=200, finalists=6)
    opened = Opened(browser, selection, tmp_path)
    tables = selection.tables
    assert len(opened.column("leaderboard-table", 1)) == tables["ranking"].height == 6
    assert len(opened.column("skill-table", 1)) == tables["battery"].height
    assert opened.page.locator("#matchup-table .cell").count() == tables["matchups"].height == 30
    decided = ((pl.col("difference_low") > 0) | (pl.col("difference_high") < 0)).sum()
    bold = opened.page.locator("#matchup-table .decided").count()
    assert 0 < bold == tables["matchups"].select(decided).item() < 30
    drawn = tables["pareto"].drop_nulls("lap_s").height
    opened.page.wait_for_selector("#contact-chart svg")
    marks = opened.page.locator("#off-chart g[aria-label=dot]").locator("circle, path")
    assert marks.count() == drawn
    without = tables["pareto"]["lap_s"].null_count()
    assert without > 0
    assert f"{without} completed no lap" in opened.page.locator("#pareto .note").inner_text()
    row = tables["ranking"].row(0, named=True)
    intervals = opened.page.locator("#leaderboard-table .interval").all_inner_texts()
    assert f"{row['points_low']:.1f} to {row['points_high']:.1f}" in [text.strip() for text in intervals]
    assert opened.page.locator("#leaderboard-table .whisker").count() == 2 * 6
    assert opened.page.locator("#replay a").first.get_attribute("href") == "races/deciding.rrd"
    opened.assert_quiet()


def test_sorting_by_mouse_and_keyboard(browser: Browser, tmp_path: Path) -> None:
    selection = build(np.random.default_rng(1), finalists=6)
    opened = Opened(browser, selection, tmp_path)
    names = selection.named("ranking")
    by_rate = names.sort("contacts_per_km")["name"].to_list()
    before = opened.column("leaderboard-table", 2)
    head = opened.page.get_by_role("button", name="Contacts per km").first
    head.click()
    assert opened.column("leaderboard-table", 2) == by_rate != before
    assert opened.page.locator("#leaderboard-table th[aria-sort=ascending]").inner_text() == "Contacts per km"
    head.press("Enter")
    assert opened.column("leaderboard-table", 2) == by_rate[::-1]
    opened.page.locator("#leaderboard-table").get_by_role("button", name="Entrant").click()
    assert opened.column("leaderboard-table", 2) == sorted(by_rate)
    opened.assert_quiet()


def test_absent_numbers_sort_last_either_way(browser: Browser, tmp_path: Path) -> None:
    rows = [ranked(card(i, "")["entrant"], i + 1, 20.0 - i) for i in range(3)]
    rows[1] |= {"contacts_per_km": None, "contacts_low": None, "contacts_high": float("nan")}
    selection = with_tables({"entrants": [card(i, f"e{i}") for i in range(3)], "ranking": rows})
    opened = Opened(browser, selection, tmp_path)
    head = opened.page.get_by_role("button", name="Contacts per km")
    for _ in range(2):
        head.click()
        assert opened.column("leaderboard-table", 2)[-1] == "e1"
    opened.assert_quiet()


def test_hostile_names_are_text(browser: Browser, tmp_path: Path) -> None:
    selection = build(np.random.default_rng(2), entrants=40, finalists=4)
    entrants = selection.tables["entrants"].with_columns(
        name=pl.format("{} {}", pl.lit(HOSTILE), pl.int_range(pl.len())), source=pl.lit('" onmouseover="x')
    )
    hostile = Selection(
        HOSTILE,
        {**selection.tables, "entrants": entrants},
        selection.results,
        {
            **selection.summary,
            "circuit": HOSTILE,
            "recording": "javascript:alert(1);'$(x).mcap",
            "replay": None,
        },
    )
    opened = Opened(browser, hostile, tmp_path)
    assert opened.page.title() == HOSTILE
    assert opened.page.locator("img").count() == 0
    assert opened.page.locator("[onmouseover]").count() == 0
    assert HOSTILE in opened.column("leaderboard-table", 2)[0]
    assert (
        opened.page.locator("#replay a").get_attribute("href")
        == "javascript%3Aalert%281%29%3B%27%24%28x%29.mcap"
    )
    opened.assert_quiet()


@pytest.mark.parametrize(
    ("finalists", "laps", "entrants"),
    [(1, 1.0, 1), (0, 0.0, 3), (0, 0.9, 30), (1, 0.9, 30)],
    ids=["one entrant", "nobody finished a lap", "nobody shortlisted", "one finalist"],
)
def test_small_selections(
    browser: Browser, tmp_path: Path, finalists: int, laps: float, entrants: int
) -> None:
    selection = build(np.random.default_rng(4), entrants, finalists, laps)
    opened = Opened(browser, selection, tmp_path)
    assert opened.page.locator("#leaderboard-table tbody tr").count() == finalists
    assert opened.page.locator("figure").count() == (2 if laps else 0)
    opened.assert_quiet()


def test_nothing_at_all(browser: Browser, tmp_path: Path) -> None:
    empty = with_tables({}, replay=None, recording=None, pair_correlation=None, stages=[], versions={})
    opened = Opened(browser, empty, tmp_path)
    assert opened.page.locator("h1").inner_text() == "Nobody to send"
    assert opened.page.locator(".empty").all_inner_texts()[-1] == "No race was recorded."
    opened.assert_quiet()


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_heat_map_is_legible(browser: Browser, tmp_path: Path, scheme: str) -> None:
    """Text on every shade has the contrast of WCAG 2 level AA."""
    selection = build(np.random.default_rng(0), finalists=8)
    opened = Opened(browser, selection, tmp_path, color_scheme=scheme)
    pairs = opened.page.evaluate(
        "[...document.querySelectorAll('.cell, .note, .interval')].map(e => {"
        " const own = getComputedStyle(e), under = getComputedStyle(document.body);"
        " const bare = own.backgroundColor === 'rgba(0, 0, 0, 0)';"
        " return [own.color, (bare ? under : own).backgroundColor]})"
    )
    assert len(pairs) > 50
    assert min(_contrast(text, ground) for text, ground in {tuple(pair) for pair in pairs}) >= 4.5
    opened.assert_quiet()


def test_phone_scrolls_tables_not_the_page(browser: Browser, tmp_path: Path) -> None:
    selection = build(np.random.default_rng(0), finalists=8)
    opened = Opened(browser, selection, tmp_path, viewport={"width": 390, "height": 800})
    assert opened.page.evaluate("document.documentElement.scrollWidth") == 390
    opened.assert_quiet()


def _contrast(text: str, ground: str) -> float:
    light, dark = sorted((_luminance(text), _luminance(ground)), reverse=True)
    return (light + 0.05) / (dark + 0.05)


def _luminance(colour: str) -> float:
    channels = [int(value) / 255 for value in re.findall(r"\d+", colour)[:3]]
    red, green, blue = (c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in channels)
    return 0.2126 * red + 0.7152 * green + 0.0722 * blue


def test_same_selection_same_bytes_and_small_enough(tmp_path: Path) -> None:
    first = render(build(np.random.default_rng(5), entrants=3000))
    assert first == render(build(np.random.default_rng(5), entrants=3000))
    assert len(first.encode()) < 1_500_000


def test_failed_render_leaves_the_old_page(tmp_path: Path) -> None:
    selection = build(np.random.default_rng(5))
    before = write_page(selection, tmp_path).read_bytes()
    broken = Selection(selection.title, selection.tables, selection.results, {})
    with pytest.raises(KeyError):
        write_page(broken, tmp_path)
    assert [file.name for file in tmp_path.iterdir()] == ["index.html"]
    assert (tmp_path / "index.html").read_bytes() == before


def _ranking(*rows: dict[str, Any]) -> Selection:
    return with_tables({"entrants": [card(i, f"e{i}") for i in range(len(rows))], "ranking": list(rows)})


def _ids(count: int) -> list[str]:
    return [card(i, "")["entrant"] for i in range(count)]


def test_verdict_names_a_winner_only_when_intervals_part() -> None:
    a, b = _ids(2)
    clear = verdict(_ranking(ranked(a, 1, 22.0), ranked(b, 2, 17.0)))
    assert clear.headline == "Send e0"
    assert "22.0 team points a race (95% interval 21.2–22.8)" in clear.sentences[0]
    assert "above that of every other finalist" in clear.sentences[0]
    assert "0.20 times a kilometre (0.15–0.26)" in clear.sentences[1]
    tie = verdict(_ranking(ranked(a, 1, 20.0), ranked(b, 1, 20.4)))
    assert tie.headline == "Send e1 or e0"
    assert "do not tell which is best" in tie.sentences[0]
    assert tie.sentences[1].startswith("e1 has the highest estimate, 20.4")
    assert "above" not in " ".join(tie.sentences)
    assert len(tie.sentences) == 3


def test_verdict_calls_one_calmest_only_when_contacts_part() -> None:
    a, b, c = _ids(3)
    calm = {"contacts_per_km": 0.05, "contacts_low": 0.04, "contacts_high": 0.07}
    parted = verdict(_ranking(ranked(a, 1, 20.4), ranked(b, 1, 20.0, **calm), ranked(c, 1, 19.9)))
    assert "e1 touches others least: 0.05 times a kilometre (0.04–0.07)" in parted.sentences[2]
    calm["contacts_high"] = 0.15
    overlapping = verdict(_ranking(ranked(a, 1, 20.4), ranked(b, 1, 20.0, **calm), ranked(c, 1, 19.9)))
    assert "Contacts do not settle it" in overlapping.sentences[2]


def test_verdict_of_many_tied_faulty_or_single() -> None:
    ids = _ids(5)
    many = verdict(_ranking(*(ranked(entrant, 1, 20.0) for entrant in ids)))
    assert many.headline == "5 entrants tie for first"
    assert many.sentences[0].startswith("e0, e1 and 3 more share first place")
    lost: dict[str, Any] = {
        "contacts_per_km": None,
        "contacts_low": None,
        "contacts_high": None,
        "faults": 320,
    }
    alone = verdict(_ranking(ranked(ids[0], 1, 10.0, **lost)))
    assert "only finalist, so no comparison" in alone.sentences[0]
    assert alone.sentences[1] == (
        "Its contact rate is not known, though 320 of its car runs ended by its own fault."
    )


def test_verdict_without_round_robin() -> None:
    unscored = verdict(_ranking(ranked(_ids(1)[0], 1, None)))
    assert unscored.headline == "Nobody to send"
    filtered = build(np.random.default_rng(4), 30, 0)
    assert verdict(filtered).headline == "Nobody is proven yet"
    assert verdict(filtered).sentences[0].startswith("No round robin was scored")


def test_numbers() -> None:
    assert [number(-1234.56, 1), number(None), signed(0.04), signed(-2.0)] == [
        "−1,234.6",
        "–",
        "+0.0",
        "−2.0",
    ]
    assert [duration(59.94), duration(61), duration(3600 * 25 + 61)] == ["59.9 s", "1 min 1 s", "25 h 1 min"]
