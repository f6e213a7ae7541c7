"""A whole lap of a test drive through the page's own inputs, in a real browser.

A scripted person drives a lap from the grid alone, with keys, and with a gamepad that the page finds where a
browser shows those that are plugged in; see `benchmarks.steered_page`.

    python -m benchmarks.drive_page --json FILE

Figures, by input: `share`, time over that of the built-in driver; `off_course_s`, `wall_s`; `turns`, changes
of what was pressed or turned.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import shutil
import sys
import threading
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from playwright.sync_api import Browser, sync_playwright

from benchmarks.result import write_result
from benchmarks.scripted_drivers import Style, built_in_driver_alone
from benchmarks.steered_page import PAD, PADS, STYLES, LedClock, steer
from nathlon.lab.drive.choice import Offer
from nathlon.lab.drive.room import Room
from nathlon.lab.drive.server import DriveServer, serve_drives
from nathlon.selection.publish.output import OutputFolder
from nathlon.sim.track import load_track

CIRCUIT, CAR = "porto-sereno", "gt3"
MAP = """localStorage.setItem("nathlon drive: view", '{"kind": "map"}');"""
"""Which is drawn in the least time."""


GETTING_READY_MS = 300_000
"""In which a slow machine has compiled, and practised the circuit."""


class Served:
    """The server of a test drive, on a thread of its own."""

    def __init__(self, folder: Path, clock: LedClock, offer: Offer) -> None:
        self._folder, self._clock, self._offer = folder, clock, offer
        self._opened = threading.Event()
        self._thread = threading.Thread(target=lambda: asyncio.run(self._serve()))

    def __enter__(self) -> Served:
        self._thread.start()
        self._opened.wait()
        return self

    def __exit__(self, *fault: object) -> None:
        self._loop.call_soon_threadsafe(self._task.cancel)
        self._thread.join()

    async def _serve(self) -> None:
        self._loop = asyncio.get_running_loop()
        self.room = Room(self._offer, OutputFolder(self._folder), lambda: self._clock)
        self._task = asyncio.create_task(serve_drives(lambda: self.room, 0, self._open))
        await asyncio.gather(self._task, return_exceptions=True)

    def _open(self, server: DriveServer) -> None:
        self.url = server.url
        self._opened.set()


def lap(browser: Browser, style: Style) -> dict[str, Any]:
    """A lap on a page of its own."""
    clock = LedClock()
    with TemporaryDirectory() as folder, Served(Path(folder), clock, Offer.of([], CIRCUIT, CAR)) as served:
        page = browser.new_page()
        page.add_init_script(MAP + PADS)
        page.goto(served.url)
        page.wait_for_selector("#choice button.first")
        page.select_option("[name=device]", "keys" if style.keys else PAD)
        # The race goes on beyond the lap, so that its world waits for the driver there too.
        for name, value in (("cars", "1"), ("seat", "1"), ("laps", "2")):
            page.fill(f"[name={name}]", value)
        page.click("#choice button.first")
        page.wait_for_selector("#track:not([hidden])", timeout=GETTING_READY_MS)
        done = steer(page, served.room, clock, style, load_track(CIRCUIT).length)
        clock.let_go()
        page.close()
    best = built_in_driver_alone(CIRCUIT, CAR)["race_time_s"]
    return {
        "share": round(done.time_s / best, 3),
        "off_course_s": done.off_course_s,
        "wall_s": done.wall_s,
        "turns": done.turns,
    }


def main() -> None:
    """Print and write the figures."""
    parser = argparse.ArgumentParser(prog="benchmarks.drive_page", description="A lap through the page")
    parser.add_argument("--json", type=Path, help="file to write")
    options = parser.parse_args()
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=["--no-sandbox"])
        figures = {
            "circuit": CIRCUIT,
            "car": CAR,
            **{name: lap(browser, how) for name, how in STYLES.items()},
        }
        browser.close()
    print(json.dumps(figures, indent=1), file=sys.stderr)
    if options.json:
        write_result(options.json, figures)


if __name__ == "__main__":
    main()
