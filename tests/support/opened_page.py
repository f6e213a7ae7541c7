"""A full night's page, opened in a browser."""

from __future__ import annotations

import os
import re
from dataclasses import replace
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from playwright.sync_api import Browser, Page

from nathlon.reports.page import write_page
from nathlon.results.selection import Selection
from nathlon.results.summary import Replay
from tests.support.lap_tables import with_laps
from tests.support.race_logs import oval_race
from tests.support.selections import build, night_before

SCREENSHOTS = os.environ.get("SCREENSHOTS")
"""The folder for pictures of what tests have seen, which take longer than all else that they do there."""
PATIENCE_MS = 90_000
LIMIT_S = 60.5
REPLAY = {
    "why": "the closest race",
    "race": 1,
    "player": "../replays/final.html",
    "recording": "javascript:alert(1);'$(x).mcap",
    "replay": None,
    "clips": [
        {
            "start_s": 21.5,
            "end_s": 31.5,
            "car": 1,
            "why": "the hardest contact that nobody is blamed for: a touch",
        }
    ],
    "missing": None,
}


def full_night(entrants: int = 250) -> Selection:
    """A night with everything: a person on the committee, a night before, a race that was recorded, laps."""
    selection = build(np.random.default_rng(0), entrants=entrants, finalists=6)
    first, second = selection.tables["ranking"]["entrant"][:2]
    replay = {"match": selection.results["match"][0], **REPLAY}
    log = replace(oval_race(duration_s=90.0), match=replay["match"], race=replay["race"])
    return with_laps(
        replace(
            selection,
            summary=selection.summary.model_copy(
                update={"replays": (Replay.model_validate(replay),), "log": "../policies.log"}
            ),
            previous=night_before(selection),
            logs=(log,),
            limit_s=LIMIT_S,
        ),
        {first: 64.2, second: 64.9},
    )


def overhear(page: Page) -> tuple[list[str], list[str]]:
    """What a page is going to ask for, and to complain of: messages, errors, breaches of its policy.

    From now on, Playwright waits for the page as long as `until` does.
    """
    page.set_default_timeout(PATIENCE_MS)
    requests: list[str] = []
    complaints: list[str] = []
    page.on("request", lambda request: requests.append(request.url))
    page.on("console", lambda message: complaints.append(message.text))
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.add_init_script(
        "document.addEventListener('securitypolicyviolation',"
        " e => console.error('violation', e.violatedDirective))"
    )
    return requests, complaints


def until(page: Page, condition: str) -> None:
    """Wait for it, but not for ever; Playwright's own way needs `eval`, which the pages' policies forbid."""
    page.evaluate(
        f"""async ([condition, patience]) => {{
            const end = performance.now() + patience;
            while (!({condition})) {{
                if (performance.now() > end) throw new Error(`waited in vain: ${{condition}}`);
                await new Promise(done => setTimeout(done, 20));
            }}
        }}""",
        [condition, PATIENCE_MS],
    )


def visit(page: Page, address: str) -> None:
    """To a view of a page: it has been made when this returns, though its charts may come later.

    The address changes before the view does, so that waiting for the address would not do. The page has
    begun to listen earlier, and is told first.
    """
    page.evaluate(
        """address => new Promise(done => {
            if (location.hash === address) return done();
            addEventListener("hashchange", () => done(), { once: true });
            location.hash = address;
        })""",
        address,
    )


def picture(page: Page, name: str, whole: bool = False) -> None:
    """Leave a picture of a page where somebody wants pictures."""
    if SCREENSHOTS:
        page.screenshot(path=Path(SCREENSHOTS) / f"{name}.png", full_page=whole)


def shown(page: Page, selector: str) -> NDArray[np.uint8]:
    """The pixels of an element, (rows, columns, 3), also of what WebGL draws."""
    picture = page.locator(selector).screenshot()
    return np.asarray(Image.open(BytesIO(picture)).convert("RGB"))


def faults(complaints: list[str]) -> list[str]:
    """Complaints but for those in which drivers of graphics cards talk about themselves."""
    return [text for text in complaints if "GL Driver Message" not in text]


class Opened:
    """A page opened from the disk, with all that it asked for or complained of."""

    def __init__(
        self, browser: Browser, selection: Selection, folder: Path, address: str = "", **context: Any
    ) -> None:
        self.own = write_page(selection, folder).as_uri()
        self.page: Page = browser.new_page(**context)
        self.requests, self.complaints = overhear(self.page)
        self.page.goto(self.own + address)

    def go(self, address: str) -> None:
        """To a view, and wait until its charts are drawn."""
        visit(self.page, address)
        self.until("[...document.querySelectorAll('figure')].every(figure => figure.querySelector('svg'))")

    def until(self, condition: str) -> None:
        until(self.page, condition)

    def picture(self, name: str) -> None:
        """Leave a picture of the whole page."""
        picture(self.page, re.sub(r"[^a-z0-9]+", "-", name).strip("-"), whole=True)

    def column(self, table: str, index: int) -> list[str]:
        cells = self.page.locator(f"#{table} tbody tr > :nth-child({index})")
        return [text.strip() for text in cells.all_inner_texts()]

    def names(self, table: str) -> list[str]:
        links = self.page.locator(f"#{table} tbody th a")
        return [text.strip() for text in links.all_inner_texts()]

    def assert_quiet(self) -> None:
        assert [url for url in self.requests if url.partition("#")[0] not in (self.own, "data:,")] == []
        assert faults(self.complaints) == []
        self.page.close()


def key(selection: Selection, place: int) -> str:
    """How addresses call the entrant at a place of the ranking."""
    return str(selection.tables["ranking"]["entrant"][place][:12])


def views(selection: Selection) -> list[str]:
    two = f"{key(selection, 0)}/{key(selection, 1)}"
    race = f"{selection.results['match'][0][:12]}/1"
    return [
        *(f"#/{view}" for view in ("tonight", "leaderboard", "pareto", "n-athlon", "matchups", "committee")),
        "#/matchups?of=contacts",
        f"#/compare/{two}",
        f"#/matchup/{two}",
        f"#/race/{race}",
        f"#/checkpoint/{key(selection, 0)}",
        f"#/checkpoint/{key(selection, 2)}",
    ]
