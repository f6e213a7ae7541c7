"""A server of one page, on the loopback interface alone, and of the WebSocket that the page opens."""

from __future__ import annotations

import secrets
from collections.abc import Awaitable, Callable
from http import HTTPStatus

from websockets.asyncio.server import Server, ServerConnection
from websockets.exceptions import ConnectionClosed
from websockets.http11 import Request, Response

from nathlon.door import Address, Door, answer, listen
from nathlon.reports.web_viewer import LOOPBACK

CLOSING_S = 1.0
"""In which the other side must answer that a connection ends."""
MOST_STRANGERS = 8


class OnePage:
    """Serves the page, and whoever has its token.

    Attributes:
        token: by which it knows its own page.

    Args:
        make_page: the page, for the server's address and the token.
        hold: serves a connection of the page until it ends.
        largest: message that may come, bytes.
    """

    def __init__(
        self,
        make_page: Callable[[Address, str], str],
        hold: Callable[[ServerConnection], Awaitable[None]],
        largest: int,
    ) -> None:
        self._make_page, self._hold, self._largest = make_page, hold, largest
        self.token = secrets.token_urlsafe(32)

    async def open_at(self, port: int) -> Server:
        """Listen on a port, 0 for any that is free, and make the page for it.

        Raises:
            InputError: if the port cannot be had.
        """
        server, address = await listen(
            self.talk, self.admit, Address(LOOPBACK, port), self._largest, CLOSING_S
        )
        self._door = Door(address, MOST_STRANGERS)
        self._page = self._make_page(address, self.token).encode()
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
                await self._hold(connection)
        except ConnectionClosed:
            pass

    def _own(self, token: str) -> bool | None:
        return secrets.compare_digest(token.encode(), self.token.encode()) or None
