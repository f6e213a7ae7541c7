"""Pictures of every view of a report, of its player and of a replay in Rerun: the gallery, and the README's.

`.venv/bin/python -m benchmarks.gallery runs/demo` takes the folder that a selection left and writes
`docs/gallery/*.png` and `docs/images/replay.png`, of 256 colours, which keeps them small.
"""

from __future__ import annotations

import io
import json
import re
import shutil
from pathlib import Path
from typing import Annotated

import typer
from PIL import Image
from playwright.sync_api import Page, ViewportSize, sync_playwright
from rich.progress import track

from benchmarks.replay_viewer import paused_viewer, settled
from nathlon.sim.errors import InputError

DOCS = Path(__file__).parent.parent / "docs"
OUT = DOCS / "gallery"
REPLAY = DOCS / "images" / "replay.png"
REPLAY_SIZE = "1440x840"
SIZE: ViewportSize = {"width": 1280, "height": 800}
MOST_PX = 2400
"""Of a page's height that is shown."""
COLOURS = 256
DARK = ("n-athlon", "compare")
"""Views that are shown in dark."""
DRAWN = "[...document.querySelectorAll('figure')].every(figure => figure.querySelector('svg, canvas'))"
PLAYED_S = 35
"""After which a race has come far enough to be worth a picture."""
SETTLED_MS = 1000
SHORTEN = """root => {
  const texts = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  while (texts.nextNode()) texts.currentNode.data = texts.currentNode.data.replaceAll(root, "");
}"""
"""Script that has paths begin at a folder: where the pictures were taken is nobody's business."""


def addresses(page: str) -> dict[str, str]:
    """The views to show of a report, by the names of their pictures.

    Raises:
        InputError: if nobody is sent, for then there is little to show.
    """
    found = re.search(r'id="data">(.*?)</script>', page, re.DOTALL)
    data = json.loads(found[1]) if found else {}
    ranking = data.get("tables", {}).get("ranking", {}).get("entrant", [])
    if len(ranking) < 2:
        raise InputError("the report: expected one with two finalists at least")
    first, second = (data["entrants"]["entrant"][number][:12] for number in ranking[:2])
    names = ("tonight", "leaderboard", "pareto", "n-athlon", "matchups", "committee")
    views = {name: f"#/{name}" for name in names}
    views |= {"compare": f"#/compare/{first}/{second}", "checkpoint": f"#/checkpoint/{first}"}
    for race in [replay for replay in data["summary"]["replays"] if replay["clips"]][:1]:
        views["race"] = f"#/race/{race['match'][:12]}/{race['race']}?at={race['clips'][0]['start_s']:g}"
    return views


def shoot(page: Page, name: str) -> int:
    """Write a picture of what a page shows, and return its size in bytes."""
    page.evaluate("scrollTo(0, 0)")  # a page that is loaded anew stays where it was
    height = min(int(page.evaluate("document.documentElement.scrollHeight")), MOST_PX)
    picture = page.screenshot(full_page=True, clip={"x": 0, "y": 0, "width": SIZE["width"], "height": height})
    return keep(picture, OUT / f"{name}.png")


def keep(picture: bytes, path: Path) -> int:
    """Write a picture with few colours, and return its size in bytes."""
    Image.open(io.BytesIO(picture)).convert("RGB").quantize(COLOURS).save(path, optimize=True)
    return path.stat().st_size


def main(folder: Annotated[Path, typer.Argument(help="What a selection left.")]) -> None:
    """Take pictures of a report's views and of its first player."""
    report = folder / "report" / "index.html"
    players = sorted((folder / "replays").glob("*.html"), key=lambda path: path.stem != "final")
    try:
        views = addresses(report.read_text("utf-8"))
    except OSError as error:
        raise InputError(f"{report}: cannot be read: {error.strerror}") from None
    chromium = shutil.which("chromium")
    if chromium is None:
        raise InputError("chromium: not found on the PATH, expected the browser to take the pictures with")
    OUT.mkdir(parents=True, exist_ok=True)
    sizes = {}
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=chromium, args=["--no-sandbox"])
        page = browser.new_page(viewport=SIZE)
        for name, address in track(views.items(), "Views"):
            page.emulate_media(color_scheme="dark" if name in DARK else "light")
            page.goto(f"{report.resolve().as_uri()}{address}")
            page.reload()
            while not page.evaluate(DRAWN):
                page.wait_for_timeout(50)
            page.evaluate(SHORTEN, f"{DOCS.parent.resolve()}/")
            sizes[name] = shoot(page, name)
        for player in players[:1]:
            page.goto(f"{player.resolve().as_uri()}#at={PLAYED_S}&car=0")
            page.wait_for_timeout(SETTLED_MS)
            sizes["player"] = shoot(page, "player")
        browser.close()
    for replay in (folder / "replays").glob("final.rrd"):
        with paused_viewer(replay, PLAYED_S, REPLAY_SIZE) as viewer:
            sizes["replay"] = keep(settled(viewer.take_screenshot), REPLAY)
    print(json.dumps({"bytes": sizes, "total": sum(sizes.values())}))


if __name__ == "__main__":
    typer.run(main)
