"""The server of a test drive: one page and one WebSocket, on the loopback interface alone."""

from __future__ import annotations

import asyncio
import errno
import secrets
import sys
import time
from collections.abc import Callable
from http import HTTPStatus

from websockets.asyncio.server import Server, ServerConnection, serve
from websockets.datastructures import Headers
from websockets.exceptions import ConnectionClosed
from websockets.http11 import Request, Response

from nathlon.driving.page import drive_page
from nathlon.driving.room import Letterbox, Room, Words
from nathlon.policies.sources.strict_json import parse_json
from nathlon.reports.web_viewer import LOOPBACK
from nathlon.sim.errors import InputError

LARGEST_FRAME = 4096
"""Bytes that the page may send at once."""
MOST_FRAMES = 240
"""Frames that the page may send in a second: it sends 60."""
GREETING_S = 5.0
"""In which a connection must give the token."""
CLOSING_S = 1.0
"""In which the other side must answer that a connection ends."""
MOST_CONNECTIONS = 8
SWITCH_S = 0.0005
"""After which a thread that holds Python's lock lets another one have it: a tick must not wait for long."""

TAKEN_OVER = 4000
UNKNOWN = 4001


class _Rate:
    """Counts frames, second by second."""

    def __init__(self) -> None:
        self._second, self._frames = 0, 0

    def exceeded(self) -> bool:
        """Whether one more frame is too many."""
        second = int(time.monotonic())
        if second != self._second:
            self._second, self._frames = second, 0
        self._frames += 1
        return self._frames > MOST_FRAMES


class DriveServer:
    """Serves the page, and lets the one that has the token drive.

    Attributes:
        port: on which it listens.
        token: by which it knows its own page.

    Args:
        room: in which the person drives.
    """

    def __init__(self, room: Room) -> None:
        self._room = room
        self.token = secrets.token_urlsafe(32)
        self._driver: ServerConnection | None = None
        self._connections = 0

    def open_at(self, port: int) -> None:
        """Make the page for the port on which the server listens."""
        self.port = port
        self._page = drive_page(f"ws://{LOOPBACK}:{port}", self.token).encode()

    @property
    def url(self) -> str:
        """Of the page."""
        return f"http://{LOOPBACK}:{self.port}/"

    def admit(self, connection: ServerConnection, request: Request) -> Response | None:
        """Answer a request; None lets it become a WebSocket.

        Another name for this machine may be a stranger's page that has found the port, and so may another
        origin.
        """
        here = f"{LOOPBACK}:{self.port}"
        if request.headers.get_all("Host") != [here]:
            return _answer(HTTPStatus.FORBIDDEN)
        if "Upgrade" not in request.headers:
            return self._page_at(request.path)
        if request.headers.get_all("Origin") != [f"http://{here}"]:
            return _answer(HTTPStatus.FORBIDDEN)
        if self._connections >= MOST_CONNECTIONS:
            return _answer(HTTPStatus.SERVICE_UNAVAILABLE)
        return None

    def _page_at(self, path: str) -> Response:
        if path != "/":
            return _answer(HTTPStatus.NOT_FOUND)
        return _answer(HTTPStatus.OK, self._page)

    async def talk(self, connection: ServerConnection) -> None:
        """Serve a WebSocket until it ends."""
        self._connections += 1
        try:
            if not await self._knows(connection):
                await connection.close(UNKNOWN, "wrong token")
                return
            before, self._driver = self._driver, connection
            if before is not None:
                await before.close(TAKEN_OVER, "another window drives")
            letters = self._room.enter()
            sending = asyncio.create_task(_send(connection, letters))
            try:
                await self._listen(connection, letters)
            finally:
                sending.cancel()
                self._room.go_away(letters)
        except ConnectionClosed:
            pass
        finally:
            self._connections -= 1
            if self._driver is connection:
                self._driver = None

    async def _knows(self, connection: ServerConnection) -> bool:
        try:
            async with asyncio.timeout(GREETING_S):
                first = await connection.recv()
        except TimeoutError:
            return False
        return isinstance(first, str) and secrets.compare_digest(first.encode(), self.token.encode())

    async def _listen(self, connection: ServerConnection, letters: Letterbox) -> None:
        rate = _Rate()
        async for message in connection:
            if rate.exceeded():
                await connection.close(1008, f"more than {MOST_FRAMES} frames a second")
                return
            try:
                if isinstance(message, bytes):
                    self._room.desk.put(message)
                else:
                    await self._room.hear(_words(message))
            except InputError as error:
                letters.say({"type": "refused", "why": str(error)})
            except ValueError as error:
                await connection.close(1008, str(error)[:100])
                return


async def _send(connection: ServerConnection, letters: Letterbox) -> None:
    while True:
        await connection.send(await letters.take())


def _words(message: str) -> Words:
    words = parse_json(message)
    if not isinstance(words, dict):
        raise ValueError("a message is no object")
    return words


def _answer(status: HTTPStatus, body: bytes = b"") -> Response:
    headers = Headers()
    headers["Content-Type"] = "text/html; charset=utf-8"
    headers["Content-Length"] = str(len(body))
    # The rest of its policy stands in the page, where this has no effect.
    headers["Content-Security-Policy"] = "frame-ancestors 'none'"
    headers["X-Content-Type-Options"] = "nosniff"
    headers["Referrer-Policy"] = "no-referrer"
    headers["Cache-Control"] = "no-store"
    headers["Connection"] = "close"
    return Response(status.value, status.phrase, headers, body)


async def listen(drive: DriveServer, port: int) -> Server:
    """Listen on a port of the loopback interface, 0 for any that is free.

    Raises:
        InputError: if it cannot be had.
    """
    try:
        server = await serve(
            drive.talk,
            LOOPBACK,
            port,
            process_request=drive.admit,
            compression=None,
            max_size=LARGEST_FRAME,
            max_queue=32,
            close_timeout=CLOSING_S,
            server_header=None,
        )
    except OSError as error:
        if error.errno not in (errno.EADDRINUSE, errno.EACCES):
            raise
        raise InputError(f"--port: {port} is taken or not to be had, expected a free one") from None
    drive.open_at(server.sockets[0].getsockname()[1])
    return server


async def serve_drives(
    make_room: Callable[[], Room], port: int, on_open: Callable[[DriveServer], None]
) -> None:
    """Serve until the task is cancelled.

    Args:
        make_room: the room, made on the event loop.
        port: as for `listen`.
        on_open: told when the page can be opened.

    Raises:
        InputError: if the port cannot be had.
    """
    before_s = sys.getswitchinterval()
    sys.setswitchinterval(SWITCH_S)
    room = make_room()
    drive = DriveServer(room)
    async with await listen(drive, port):
        on_open(drive)
        try:
            await asyncio.get_running_loop().create_future()
        finally:
            await room.leave()
            sys.setswitchinterval(before_s)
