"""The page in which a person drives: one document, with all that it needs."""

from __future__ import annotations

import json
from pathlib import Path
from typing import NamedTuple

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup

from nathlon.reports.player import TEMPLATES as REPORT
from nathlon.reports.player import digest

TEMPLATES = Path(__file__).parent / "templates"
SHARED = ("element", "recording", "scene")
"""Scripts of the report's player that the page has too."""
OWN = ("link", "inputs", "mesh", "view", "sound", "hud", "menu", "drive")


class Page(NamedTuple):
    """A document and the policy that it is served with.

    Attributes:
        html: the document.
        policy: content security policy.
    """

    html: bytes
    policy: str


def drive_page(address: str, token: str) -> Page:
    """The page that drives with a server.

    Args:
        address: of its WebSocket, `ws://127.0.0.1:PORT`.
        token: by which the server knows its own page.
    """
    shared = [(REPORT / "race" / f"{part}.js").read_text("utf-8") for part in SHARED]
    own = [(TEMPLATES / f"{part}.js").read_text("utf-8") for part in OWN]
    script = "\n".join(['"use strict";\n', *shared, *own])
    style = (TEMPLATES / "drive.css").read_text("utf-8")
    environment = Environment(
        loader=FileSystemLoader(TEMPLATES), autoescape=True, undefined=StrictUndefined, trim_blocks=True
    )
    html = environment.get_template("drive.html").render(
        style=Markup(style),
        script=Markup(script),
        session=Markup(json.dumps({"address": address, "token": token})),
    )
    policy = (
        f"default-src 'none'; script-src {digest(script)}; style-src {digest(style)}; connect-src {address}; "
        "img-src data:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    )
    return Page(html.encode(), policy)
