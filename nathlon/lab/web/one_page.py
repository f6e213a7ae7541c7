"""A server of one page, on the loopback interface alone, and of the WebSocket that the page opens."""

from __future__ import annotations

import secrets
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager
from http import HTTPStatus

from starlette.requests import Request
from starlette.responses import Response

from nathlon.lab.web.access import Access, answer, path_of
from nathlon.lab.web.address import Address
from nathlon.lab.web.connection import Connection
from nathlon.lab.web.server import listen
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
        hold: Callable[[Connection], Awaitable[None]],
        largest: int,
    ) -> None:
        self._make_page, self._hold, self._largest = make_page, hold, largest
        self.token = secrets.token_urlsafe(32)

    @asynccontextmanager
    async def open_at(self, port: int) -> AsyncIterator[None]:
        """Make the page for a port, 0 for any that is free, and serve it there.

        Raises:
            InputError: if the port cannot be had.
        """
        async with listen(Address(LOOPBACK, port), self._furnish, self._largest, CLOSING_S):
            yield

    def _furnish(self, address: Address) -> Access:
        self._access = Access(address, MOST_STRANGERS, self._answer, self._talk)
        self._page = self._make_page(address, self.token).encode()
        return self._access

    @property
    def port(self) -> int:
        """On which it listens."""
        return self._access.address.port

    @property
    def url(self) -> str:
        """Of the page."""
        return f"{self._access.address.origin}/"

    async def _answer(self, request: Request) -> Response:
        if path_of(request) != [""]:
            return answer(HTTPStatus.NOT_FOUND)
        return answer(HTTPStatus.OK, self._page)

    async def _talk(self, connection: Connection) -> None:
        if await self._access.recognise(connection, self._own):
            await self._hold(connection)

    def _own(self, token: str) -> bool | None:
        return secrets.compare_digest(token.encode(), self.token.encode()) or None
