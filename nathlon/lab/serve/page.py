"""The page of the committee's room: one document, with all that it needs."""

from __future__ import annotations

from nathlon.lab.serve.wishes import LONGEST_REASON
from nathlon.lab.web.address import Address
from nathlon.reports.self_contained import render_page, script_data, template_text


def room_page(address: Address, store: str) -> str:
    """The page for a server at an address; it holds no secret.

    Args:
        address: the only one to which its policy lets it connect.
        store: what members call it.
    """
    session = {"socket": f"{address.socket}/room", "longest": LONGEST_REASON}
    return render_page(
        "meeting/page.html",
        template_text("scroll.css", "meeting/page.css"),
        "meeting/room.js",
        connect=f"{address.socket} {address.origin}",
        frames=address.origin,
        store=store,
        session=script_data(session),
    )
