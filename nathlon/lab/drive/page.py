"""The page in which a person drives: one document, with all that it needs."""

from __future__ import annotations

from nathlon.reports.player import SPACE
from nathlon.reports.self_contained import render_page, script_data, template_text

SHARED = ("element", "recording", "scene", "trackside")
"""Scripts of the report's player that the page has too."""
OWN = ("link", "inputs", "sound", "hud", "menu", "blind", "drive")


def drive_page(address: str, connect: str, token: str | None, room: str | None = None) -> str:
    """The page that drives with a server.

    Args:
        address: of its WebSocket.
        connect: where its policy lets it connect, `ws://127.0.0.1:PORT`.
        token: by which the server knows its own page; None where the browser keeps it for the tab.
        room: address of the committee's room that it was opened from.
    """
    own = ["command.js", *(f"drive/{part}.js" for part in OWN)]
    parts = [*(f"race/{part}.js" for part in SHARED), *SPACE, *own]
    return render_page(
        "drive/page.html",
        template_text("drive/page.css"),
        [f'"use strict";\n\n{template_text(*parts)}'],
        connect=connect,
        room=room,
        session=script_data({"address": address, "token": token}),
    )
