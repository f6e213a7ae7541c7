"""The page in which a person drives: one document, with all that it needs."""

from __future__ import annotations

from nathlon.reports.player import SPACE
from nathlon.reports.self_contained import render_page, script_data, template_text

SHARED = ("element", "recording", "scene")
"""Scripts of the report's player that the page has too."""
OWN = ("link", "inputs", "sound", "hud", "menu", "blind", "drive")


def drive_page(address: str, token: str) -> str:
    """The page that drives with a server.

    Args:
        address: of its WebSocket, `ws://127.0.0.1:PORT`, the only one to which its policy lets it connect.
        token: by which the server knows its own page.
    """
    parts = [*(f"race/{part}.js" for part in SHARED), *SPACE, *(f"drive/{part}.js" for part in OWN)]
    return render_page(
        "drive/page.html",
        template_text("drive/page.css"),
        [f'"use strict";\n\n{template_text(*parts)}'],
        connect=address,
        session=script_data({"address": address, "token": token}),
    )
