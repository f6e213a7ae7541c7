"""The player: a race as one web page that plays without a network and without a graphics card."""

from __future__ import annotations

import base64
import hashlib
import json
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup

from nathlon.arena.race_log import RaceLog
from nathlon.reports.cars import winner
from nathlon.reports.race_data import circuit_data, race_data
from nathlon.sim.whole_file import whole_file

TEMPLATES = Path(__file__).parent / "templates"

PARTS = ("element", "recording", "scene", "player", "order")
"""Scripts in templates/race of which the player is made, in their order; the report has them too."""


def write_player(log: RaceLog, path: Path, follow: int | None = None) -> None:
    """Write the page, at first with the camera on car `follow` (the winner if None), whole or not at all."""
    html = render_player(log, follow)
    with whole_file(path) as partial:
        partial.write_text(html, "utf-8")


def render_player(log: RaceLog, follow: int | None = None) -> str:
    """The page's HTML. Its policy admits only the style and the script written here, by their hashes."""
    environment = Environment(
        loader=FileSystemLoader(TEMPLATES),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    style = player_style() + (TEMPLATES / "player_page.css").read_text("utf-8")
    script = f'"use strict";\n\n{player_script()}\n{(TEMPLATES / "player_page.js").read_text("utf-8")}'
    race = {
        "race": race_data(log),
        "circuit": circuit_data(log),
        "followed": winner(log) if follow is None else follow,
    }
    return environment.get_template("player.html").render(
        log=log,
        race=Markup(_script_json(race)),
        policy=f"default-src 'none'; style-src {_digest(style)}; script-src {_digest(script)}; "
        "img-src data:; base-uri 'none'; form-action 'none'",
        style=Markup(style),
        script=Markup(script),
    )


def player_script() -> str:
    """The player itself, for whichever page it stands in."""
    return "\n".join((TEMPLATES / "race" / f"{part}.js").read_text("utf-8") for part in PARTS)


def player_style() -> str:
    """How the player looks, in the colours of the page that it stands in."""
    return (TEMPLATES / "race" / "player.css").read_text("utf-8")


def _script_json(value: Any) -> str:
    """JSON that can stand in a script element: nothing in it ends the element."""
    return json.dumps(value, separators=(",", ":")).replace("<", "\\u003c")


def _digest(text: str) -> str:
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"
