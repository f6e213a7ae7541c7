"""How many pictures a second the three-dimensional view comes to without a graphics card.

A made-up race of eight cars is played from behind a car, and from its cockpit, in a browser that draws by the
processor alone:

    python -m benchmarks.scene --json FILE

Figures, by camera: `pictures_s`, in the second half of the time; `share`, of the pixels on a side that the
canvas has, which adapts.
"""

from __future__ import annotations

import argparse
import json
import shutil
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from playwright.sync_api import Page, ViewportSize, sync_playwright

from benchmarks.replay import race_log
from benchmarks.result import write_result
from nathlon.arena.recording import read_recording
from nathlon.reports.player import write_player

SIZE: ViewportSize = {"width": 1280, "height": 800}
CAMERAS = {"chase": 1, "cockpit": 2}
"""How often C is pressed for each."""
AT_S, HALF_S = 20, 10
COUNTER = """
const drawn = WebGL2RenderingContext.prototype.bindBuffer;
window.pictures = 0;
let noted = false;
WebGL2RenderingContext.prototype.bindBuffer = function (...rest) {
  if (!noted) { noted = true; window.pictures += 1; requestAnimationFrame(() => (noted = false)); }
  return drawn.apply(this, rest);
};"""


def played(page: Page, address: str, presses: int) -> dict[str, Any]:
    """Figures of one camera."""
    page.goto(f"{address}#at={AT_S}&car=5")
    page.reload()
    page.wait_for_selector("body[data-ready]")
    for key in ("v", *"c" * presses, "Space"):
        page.keyboard.press(key)
    page.wait_for_timeout(1000 * HALF_S)
    counted = "[window.pictures, performance.now() / 1000]"
    pictures, now = page.evaluate(counted)
    page.wait_for_timeout(1000 * HALF_S)
    drawn, after = page.evaluate(counted)
    share = page.locator("#space").evaluate("canvas => canvas.width / canvas.clientWidth")
    return {"pictures_s": round((drawn - pictures) / (after - now), 1), "share": round(share, 2)}


def main() -> None:
    """Print and write the figures."""
    parser = argparse.ArgumentParser(prog="benchmarks.scene", description="Pictures without a graphics card")
    parser.add_argument("--recording", type=Path, help="race to play, instead of a made-up one")
    parser.add_argument("--json", type=Path, help="file to write")
    options = parser.parse_args()
    log = read_recording(options.recording) if options.recording else race_log("lindenring", 1)[0]
    with TemporaryDirectory() as folder, sync_playwright() as playwright:
        path = Path(folder) / "race.html"
        write_player(log, path)
        browser = playwright.chromium.launch(
            executable_path=shutil.which("chromium"), args=["--no-sandbox", "--disable-gpu"]
        )
        page = browser.new_page(viewport=SIZE)
        page.add_init_script(COUNTER)
        figures: dict[str, Any] = {"size": list(SIZE.values())}
        figures |= {camera: played(page, path.as_uri(), presses) for camera, presses in CAMERAS.items()}
        browser.close()
    print(json.dumps(figures, indent=1), file=sys.stderr)
    if options.json:
        write_result(options.json, figures)


if __name__ == "__main__":
    main()
