"""Two races from one start as one web page: side by side, at one moment."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from nathlon.reports.player import player_style
from nathlon.reports.race_data import circuit_data, race_data
from nathlon.reports.seen_data import seen_data
from nathlon.reports.self_contained import render_page, script_data, template_text, write_page_file
from nathlon.results.twin import Twins, outcome


def write_twin_page(twins: Twins, path: Path) -> None:
    """Write the page, whole or not at all."""
    write_page_file(render_twin_page(twins), path)


def render_twin_page(twins: Twins) -> str:
    """The page's HTML. Its policy admits only the style and the script written here, by their hashes."""
    logs = twins.original.log, twins.twin.log
    return render_page(
        "twin/page.html",
        player_style() + template_text("scroll.css", "twin/page.css"),
        "twin/page.js",
        twins=twins,
        log=twins.original.log,
        races=[
            ("original", logs[0], outcome(logs[0], twins.car)),
            ("twin", logs[1], outcome(logs[1], twins.car)),
        ],
        parted_s=twins.parted_s,
        data=script_data(_data(twins)),
    )


def _data(twins: Twins) -> dict[str, Any]:
    return {
        "circuit": circuit_data(twins.original.log.outline, twins.original.log.sections),
        "car": twins.car,
        "at": twins.at_s,
        "parted": twins.parted_s,
        "sides": [
            {"race": race_data(side.log), "seen": seen_data(side.seen) if side.seen else None}
            for side in (twins.original, twins.twin)
        ],
    }
