"""The page of a test drive, opened in a browser."""

from __future__ import annotations

import time
from typing import Any

from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Browser, Page

from nathlon.lab.drive.room import Room
from nathlon.lab.drive.server import DriveServer
from tests.support.opened_page import PATIENCE_MS, faults, overhear, picture, until

MAP = """localStorage.setItem("nathlon drive: view", '{"kind": "map"}');"""
"""Which is drawn in less time than the view from behind."""


class Drive:
    """A page that drives, the server's side of it, and what it complains of."""

    def __init__(self, browser: Browser, server: DriveServer, room: Room, script: str = "") -> None:
        self.room, self.url = room, server.url
        self.page: Page = browser.new_page(viewport={"width": 1280, "height": 720})
        if script:
            self.page.add_init_script(script)
        self.requests, self.complaints = overhear(self.page)
        self.page.goto(self.url)
        self.until("document.querySelector('#choice button.first')")

    def until(self, condition: str) -> None:
        until(self.page, condition)

    def begin(self, **fields: str) -> None:
        for name, value in fields.items():
            self.page.fill(f"[name={name}]", value)
        self.page.click("#choice button.first")
        self.until("!document.getElementById('track').hidden")

    def picture(self, name: str) -> None:
        picture(self.page, f"drive-{name}")

    def heard(self, keys: bool, steering: float, throttle: float, brake: float) -> None:
        """Wait until the server has heard this."""
        end = time.monotonic() + PATIENCE_MS / 1000.0
        while self.done() != (keys, steering, throttle, brake):
            assert time.monotonic() < end, f"heard last: {self.done()}"
            self.page.wait_for_timeout(20)

    def done(self) -> Any:
        """What the server has heard last."""
        return self.room.buffer.latest.controls

    def close(self) -> None:
        assert faults(self.complaints) == []
        assert {url for url in self.requests if not url.startswith("data:")} == {self.url}
        self.page.close()


class DriveFromRoom(Drive):
    """A page that drives, instead of the committee's room that it was opened from."""

    def __init__(self, page: Page) -> None:
        self.page = page
        self.until("document.querySelector('#choice button.first')")


def serious(page: Page) -> list[str]:
    found = Axe().run(page).response["violations"]
    return [one["id"] for one in found if one["impact"] in ("serious", "critical")]


def raced(drive: Drive, interrupted: bool = False) -> None:
    """See the result of a race: whoever stands still is out. On the way, perhaps, a mark and a new page."""
    drive.begin(laps="1", cars="3", seat="2")
    if interrupted:
        keyboard = drive.page.keyboard
        keyboard.down("ArrowUp")
        keyboard.press("m")
        drive.until("document.getElementById('news').textContent.includes('You marked')")
        keyboard.press("p")
        drive.until("document.getElementById('pause').open")
        drive.picture("blind-race")
        keyboard.up("ArrowUp")
        drive.page.reload()
        drive.until("document.getElementById('pause').open")
        drive.page.click("#pause >> text=Go on")
        keyboard.down("ArrowDown")
    drive.until("document.getElementById('result').open")


def answered(
    drive: Drive,
    better: str | None,
    scores: dict[str, tuple[int, int, int, int]],
    text: str = "",
    missed: str = "",
) -> None:
    """Answer about those that were met; without a better one if there is a letter that was missed."""
    if missed:
        drive.page.check(f"[name='{missed} missed']")
    for letter, values in scores.items():
        for name, value in zip(("again", "fair", "room", "beatable"), values, strict=True):
            drive.page.check(f"[name='{letter} {name}'][value='{value}']")
    if better is None:
        assert drive.page.locator("[name=better]").first.is_disabled()
    else:
        drive.page.check(f"[name=better][value='{better}']")
    drive.page.fill("[name=text]", text)
    drive.picture("blind-questions")
    drive.page.click("#questions >> text=Keep these answers")
