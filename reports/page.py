"""The report as one web page that needs no network."""

from __future__ import annotations

import base64
import hashlib
import json
from pathlib import Path

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup

from nathlon.reports.payload import payload
from nathlon.reports.player import player_script, player_style
from nathlon.reports.selection import Selection
from nathlon.reports.verdict import verdict
from nathlon.sim.whole_file import whole_file

HERE = Path(__file__).parent
APP = (
    "data",
    "dom",
    "table",
    "charts",
    "tonight",
    "leaderboard",
    "pareto",
    "n_athlon",
    "matchups",
    "race_laps",
    "race_charts",
    "race_passes",
    "race",
    "lap",
    "checkpoint",
    "committee",
    "app",
)
"""Scripts in templates/app, in the order in which they are written into the page, after the player's."""


def write_page(selection: Selection, folder: Path) -> Path:
    """Write `folder`/index.html, whole or not at all, and return its path."""
    html = render(selection)
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "index.html"
    with whole_file(path) as partial:
        partial.write_text(html, encoding="utf-8")
    return path


def render(selection: Selection) -> str:
    """The page's HTML. Its policy admits only the style and the scripts written here, by their hashes."""
    environment = Environment(
        loader=FileSystemLoader(HERE / "templates"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    style = (HERE / "templates" / "page.css").read_text("utf-8") + player_style()
    views = "\n".join((HERE / "templates" / "app" / f"{name}.js").read_text("utf-8") for name in APP)
    app = f'"use strict";\n\n{player_script()}\n{views}'
    scripts = [_licensed("d3.min.js", "d3"), _licensed("plot.umd.min.js", "plot"), app]
    return environment.get_template("page.html").render(
        title=selection.title,
        verdict=verdict(selection),
        data=Markup(_json(selection)),
        policy=(
            f"default-src 'none'; style-src {_digest(style)}; "
            f"script-src {' '.join(map(_digest, scripts))}; "
            "img-src data:; media-src 'self'; base-uri 'none'; form-action 'none'"
        ),
        style=Markup(style),
        scripts=[Markup(script) for script in scripts],
    )


def _json(selection: Selection) -> str:
    """The data; no text in it can end the element that it stands in, or begin another."""
    text = json.dumps(payload(selection), ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    return text.replace("<", "\\u003c")


def _licensed(file: str, package: str) -> str:
    vendor = HERE / "vendor"
    licence = (vendor / f"{package}.LICENSE").read_text("utf-8")
    return f"/*\n{licence}*/\n{(vendor / file).read_text('utf-8')}"


def _digest(text: str) -> str:
    digest = base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()
    return f"'sha256-{digest}'"
