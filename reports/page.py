"""The report as one web page that needs no network."""

from __future__ import annotations

from pathlib import Path

from nathlon.reports.payload import payload
from nathlon.reports.player import player_style
from nathlon.reports.self_contained import render_page, script_data, template_text, write_page_file
from nathlon.reports.verdict import verdict
from nathlon.results.selection import Selection

PAGE = "index.html"
VENDOR = Path(__file__).parent / "vendor"


def write_page(selection: Selection, folder: Path) -> Path:
    """Write `folder`/index.html, whole or not at all, and return its path."""
    return write_page_file(render(selection), folder / PAGE)


def render(selection: Selection) -> str:
    """The page's HTML. Its policy admits only the style and the scripts written here, by their hashes."""
    return render_page(
        "page.html",
        template_text("scroll.css", "page.css") + player_style(),
        "app/app.js",
        libraries=[_licensed("d3.min.js", "d3"), _licensed("plot.umd.min.js", "plot")],
        films=True,
        title=selection.title,
        verdict=verdict(selection),
        data=script_data(payload(selection)),
    )


def _licensed(file: str, package: str) -> str:
    licence = (VENDOR / f"{package}.LICENSE").read_text("utf-8")
    return f"/*\n{licence}*/\n{(VENDOR / file).read_text('utf-8')}"
