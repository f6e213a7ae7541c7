"""The server of a test drive: one page and one WebSocket, on the loopback interface alone."""

from __future__ import annotations

import asyncio
import secrets
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from http import HTTPStatus

from websockets.asyncio.server import Server, ServerConnection
from websockets.exceptions import ConnectionClosed
from websockets.http11 import Request, Response

from nathlon.door import Address, Door, answer, listen
from nathlon.driving.page import drive_page
from nathlon.driving.room import Room
from nathlon.driving.wheel import LARGEST_FRAME, Wheel
from nathlon.reports.web_viewer import LOOPBACK

CLOSING_S = 1.0
"""In which the other side must answer that a connection ends."""
MOST_STRANGERS = 8
SWITCH_S = 0.0005
"""After which a thread that holds Python's lock lets another one have it: a tick must not wait for long."""


class DriveServer:
    """Serves the page, and lets the one that has the token drive.

    Attributes:
        token: by which it knows its own page.

    Args:
        room: in which the person drives.
    """

    def __init__(self, room: Room) -> None:
        self._wheel = Wheel(room)
        self.token = secrets.token_urlsafe(32)

    async def open_at(self, port: int) -> Server:
        """Listen on a port, 0 for any that is free, and make the page for it.

        Raises:
            InputError: if it cannot be had.
        """
        server, address = await listen(
            self.talk, self.admit, Address(LOOPBACK, port), LARGEST_FRAME, CLOSING_S
        )
        self._door = Door(address, MOST_STRANGERS)
        self._page = drive_page(address.socket, address.socket, self.token).encode()
        return server

    @property
    def port(self) -> int:
        """On which it listens."""
        return self._door.address.port

    @property
    def url(self) -> str:
        """Of the page."""
        return f"{self._door.address.origin}/"

    def admit(self, connection: ServerConnection, request: Request) -> Response | None:
        """Answer a request; None lets it become a WebSocket."""
        refusal = self._door.refusal(request)
        if refusal is not None or "Upgrade" in request.headers:
            return refusal
        if request.path != "/":
            return answer(HTTPStatus.NOT_FOUND)
        return answer(HTTPStatus.OK, self._page)

    async def talk(self, connection: ServerConnection) -> None:
        """Serve a WebSocket until it ends."""
        try:
            if await self._door.recognise(connection, self._own):
                await self._wheel.hold(connection)
        except ConnectionClosed:
            pass

    def _own(self, token: str) -> bool | None:
        return secrets.compare_digest(token.encode(), self.token.encode()) or None


@contextmanager
def quick_switching() -> Iterator[None]:
    """While races run on threads of this process that must keep time."""
    before_s = sys.getswitchinterval()
    sys.setswitchinterval(SWITCH_S)
    try:
        yield
    finally:
        sys.setswitchinterval(before_s)


async def serve_drives(
    make_room: Callable[[], Room], port: int, on_open: Callable[[DriveServer], None]
) -> None:
    """Serve until the task is cancelled.

    Args:
        make_room: the room, made on the event loop.
        port: to listen on; 0 for any that is free.
        on_open: told when the page can be opened.

    Raises:
        InputError: if the port cannot be had.
    """
    with quick_switching():
        room = make_room()
        drive = DriveServer(room)
        async with await drive.open_at(port):
            on_open(drive)
            try:
                await asyncio.get_running_loop().create_future()
            finally:
                await room.leave()
