"""Two races from one start as one web page: side by side, at one moment."""

from __future__ import annotations

import base64
import hashlib
import json
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup

from nathlon.reports.player import TEMPLATES, player_script, player_style
from nathlon.reports.race_data import circuit_data, race_data
from nathlon.reports.seen_data import seen_data
from nathlon.reports.twin import Twins, outcome
from nathlon.sim.whole_file import whole_file

PARTS = ("charts", "seen", "page")
"""Scripts in templates/twin, in the order in which they are written into the page, after the player's."""


def write_twin_page(twins: Twins, path: Path) -> None:
    """Write the page, whole or not at all."""
    html = render_twin_page(twins)
    with whole_file(path) as partial:
        partial.write_text(html, "utf-8")


def render_twin_page(twins: Twins) -> str:
    """The page's HTML. Its policy admits only the style and the script written here, by their hashes."""
    environment = Environment(
        loader=FileSystemLoader(TEMPLATES),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    style = player_style() + (TEMPLATES / "twin" / "page.css").read_text("utf-8")
    parts = "\n".join((TEMPLATES / "twin" / f"{part}.js").read_text("utf-8") for part in PARTS)
    script = f'"use strict";\n\n{player_script()}\n{parts}'
    logs = twins.original.log, twins.twin.log
    return environment.get_template("twin/page.html").render(
        twins=twins,
        log=twins.original.log,
        races=[
            ("original", logs[0], outcome(logs[0], twins.car)),
            ("twin", logs[1], outcome(logs[1], twins.car)),
        ],
        parted_s=twins.parted_s,
        data=Markup(_script_json(_data(twins))),
        policy=f"default-src 'none'; style-src {_digest(style)}; script-src {_digest(script)}; "
        "img-src data:; base-uri 'none'; form-action 'none'",
        style=Markup(style),
        script=Markup(script),
    )


def _data(twins: Twins) -> dict[str, Any]:
    return {
        "circuit": circuit_data(twins.original.log),
        "car": twins.car,
        "at": twins.at_s,
        "parted": twins.parted_s,
        "sides": [
            {"race": race_data(side.log), "seen": seen_data(side.seen) if side.seen else None}
            for side in (twins.original, twins.twin)
        ],
    }


def _script_json(value: Any) -> str:
    """JSON that can stand in a script element: nothing in it ends the element."""
    return json.dumps(value, separators=(",", ":")).replace("<", "\\u003c")


def _digest(text: str) -> str:
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"
