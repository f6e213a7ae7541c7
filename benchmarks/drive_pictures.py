"""Pictures of a test drive for the documentation: behind the car and from the cockpit, some way into a race.

`python -m benchmarks.drive_pictures` has a scripted person race from the last place of eight, and writes
`docs/images/drive.png` and `docs/images/drive-cockpit.png`.
"""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from tempfile import TemporaryDirectory

from playwright.sync_api import ViewportSize, sync_playwright

from benchmarks.drive_page import GETTING_READY_MS, Served
from benchmarks.gallery import DOCS, SETTLED_MS, keep
from benchmarks.scripted_drivers import KEYS
from benchmarks.steered_page import LedClock, steer
from nathlon.lab.drive.choice import DriveOpponent, Offer
from nathlon.policies.bundled import champion

CIRCUIT, CAR = "lindenring", "gt3"
SIZE: ViewportSize = {"width": 1280, "height": 720}
UNTIL_M = 260.0
"""Where the field is still together."""
REFRESHED_MS = 300
"""In which what stands over the picture is written anew."""
FINE = """
const real = performance.now.bind(performance);
let [since, told, slowdown] = [0, 0, 100];
performance.now = () => told + (real() - since) / slowdown;
window.passTime = (factor) => ([told, since, slowdown] = [performance.now(), real(), factor]);
"""
"""Script of a page to which pictures seem to come as fast as on a graphics card, and so are as fine."""


def main() -> None:
    """Drive, and take the pictures."""
    clock, offer = LedClock(), Offer.of([DriveOpponent.of(str(champion(CIRCUIT, CAR)))], CIRCUIT, CAR)
    sizes = {}
    with (
        sync_playwright() as playwright,
        TemporaryDirectory() as folder,
        Served(Path(folder), clock, offer) as served,
    ):
        browser = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=["--no-sandbox"])
        page = browser.new_page(viewport=SIZE)
        page.add_init_script(FINE)
        page.goto(served.url)
        page.wait_for_selector("#choice button.first")
        for name, value in (("cars", "8"), ("seat", "8"), ("laps", "2"), ("name", "You")):
            page.fill(f"[name={name}]", value)
        page.click("#choice button.first")
        page.wait_for_selector("#track:not([hidden])", timeout=GETTING_READY_MS)
        steer(page, served.room, clock, KEYS, UNTIL_M)
        page.evaluate("passTime(1)")
        page.wait_for_timeout(REFRESHED_MS)
        page.evaluate("passTime(100)")
        for name in ("drive", "drive-cockpit"):
            page.wait_for_timeout(SETTLED_MS)
            sizes[name] = keep(page.screenshot(), DOCS / "images" / f"{name}.png")
            page.keyboard.press("c")
        clock.let_go()
        browser.close()
    print(json.dumps({"bytes": sizes}))


if __name__ == "__main__":
    main()
