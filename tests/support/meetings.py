"""The committee's room for the tests: its server in a thread, and its page in a browser."""

from __future__ import annotations

import re
import ssl
from collections.abc import Callable, Coroutine, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

from playwright.sync_api import Browser, Page

from nathlon.lab.serve.folders import Folders
from nathlon.lab.serve.record import RunsRecord
from nathlon.lab.serve.server import MeetingServer, serve_meeting
from nathlon.lab.serve.tokens import Tokens
from nathlon.lab.web.address import Address
from tests.support.drives import fast, in_a_thread
from tests.support.opened_page import faults, overhear, picture, until


@contextmanager
def met(
    store: Path,
    members: Sequence[str] = ("ann", "bob"),
    pace: float = 1.0,
    tls: ssl.SSLContext | None = None,
) -> Iterator[MeetingServer]:
    """The room of a store's committee on a free port; races run so many times as fast as time."""
    record = RunsRecord(str(store), Folders(str(store), None))
    address = Address("127.0.0.1", 0) if tls is None else Address("localhost", 0, tls=True)

    def serve(on_open: Callable[[MeetingServer], None]) -> Coroutine[Any, Any, None]:
        return serve_meeting(record, str(store), Tokens(members), address, tls, on_open, partial(fast, pace))

    with in_a_thread(serve) as server:
        yield server
    record.close()


class Window:
    """The room in a browser of its own, and what it asks for or complains of."""

    def __init__(self, browser: Browser, url: str, script: str = "") -> None:
        self.page: Page = browser.new_context(viewport={"width": 1280, "height": 900}).new_page()
        if script:
            self.page.add_init_script(script)
        self.requests, self.complaints = overhear(self.page)
        self.page.goto(url)
        self.until("document.querySelector('.question h2, #stands.lost')")

    def until(self, condition: str) -> None:
        until(self.page, condition)

    def shows(self, text: str, part: str = "#questions") -> None:
        """Wait until a part of the page shows a text."""
        self.until(f"document.querySelector({part!r}).innerText.includes({text!r})")

    def ballot(self, places: dict[str, int], fit: Sequence[str], reason: str) -> None:
        """Fill in a ballot and cast it."""
        for name, place in places.items():
            self.page.get_by_label(f"Place of {name}").fill(str(place))
        for box in self.page.locator("form.ballot input[type=checkbox]").all():
            name = re.sub(" is fit$", "", box.get_attribute("aria-label") or "")
            box.set_checked(name in fit)
        self.page.locator("form.ballot input[type=text]").fill(reason)
        self.page.click("text=Cast my ballot")

    def picture(self, name: str) -> None:
        picture(self.page, f"room-{name}")

    def close(self) -> None:
        assert faults(self.complaints) == []
        self.page.context.close()
