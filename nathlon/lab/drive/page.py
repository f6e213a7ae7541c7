"""The page in which a person drives: one document, with all that it needs."""

from __future__ import annotations

from nathlon.reports.self_contained import render_page, script_data, template_text


def drive_page(address: str, connect: str, token: str | None, room: str | None = None) -> str:
    """The page that drives with a server.

    Args:
        address: of its WebSocket.
        connect: where its policy lets it connect, `ws://127.0.0.1:PORT`.
        token: by which the server knows its own page; None where the browser keeps it for the tab.
        room: address of the committee's room that it was opened from.
    """
    return render_page(
        "drive/page.html",
        template_text("drive/page.css"),
        "drive/drive.js",
        connect=connect,
        room=room,
        session=script_data({"address": address, "token": token}),
    )
