"""Access to a server for browsers: tokens and origins."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Awaitable, Callable
from http import HTTPStatus
from typing import TypeVar

from starlette.requests import HTTPConnection, Request
from starlette.responses import Response
from starlette.types import Receive, Scope, Send
from starlette.websockets import WebSocket

from nathlon.lab.web.address import Address
from nathlon.lab.web.connection import Connection, Gone

log = logging.getLogger(__name__)

KnownT = TypeVar("KnownT")
Answer = Callable[[Request], Awaitable[Response]]
Talk = Callable[[Connection], Awaitable[None]]

GREETING_S = 5.0
"""In which a connection must give its token."""
UNKNOWN = 4001
"""Code with which a connection ends that has no token."""
READING = ("GET", "HEAD")
"""Methods of requests. Whoever wants something done says so on a WebSocket."""


class Access:
    """Lets in pages of the server's own, and of those who have a token: an ASGI application.

    Args:
        address: of the server.
        most_strangers: connections at a time that have not given a token yet.
        answer: answers a request that has been let in.
        talk: serves a WebSocket that has been let in until it ends.
    """

    def __init__(self, address: Address, most_strangers: int, answer: Answer, talk: Talk) -> None:
        self.address = address
        self._most_strangers, self._strangers = most_strangers, 0
        self._answer, self._talk = answer, talk

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve a request or a WebSocket to its end."""
        if scope["type"] == "websocket":
            await self._open(WebSocket(scope, receive, send))
        else:
            response = await self._answered(Request(scope, receive))
            await response(scope, receive, send)

    async def _answered(self, request: Request) -> Response:
        refusal = self._refusal(request)
        if refusal is not None:
            return refusal
        try:
            return await self._answer(request)
        except Exception:
            log.exception("%s cannot be answered", request.scope["path"])
            return answer(HTTPStatus.INTERNAL_SERVER_ERROR)

    async def _open(self, socket: WebSocket) -> None:
        refusal = self._refusal(socket)
        if refusal is not None:
            await socket.send_denial_response(refusal)
            return
        await socket.accept()
        try:
            await self._talk(Connection(socket, path_of(socket)))
        except Gone:
            pass
        except Exception:
            log.exception("%s has failed", socket.scope["path"])

    def _refusal(self, asked: Request | WebSocket) -> Response | None:
        """Why a request is not let in; None if it is.

        Another name for this machine may be a stranger's page that has found the port, and so may another
        origin.
        """
        if asked.headers.getlist("Host") != [self.address.authority]:
            return answer(HTTPStatus.FORBIDDEN)
        if isinstance(asked, Request):
            return None if asked.method in READING else answer(HTTPStatus.METHOD_NOT_ALLOWED)
        if asked.headers.getlist("Origin") != [self.address.origin]:
            return answer(HTTPStatus.FORBIDDEN)
        if self._strangers >= self._most_strangers:
            return answer(HTTPStatus.SERVICE_UNAVAILABLE)
        return None

    async def recognise(self, connection: Connection, whose: Callable[[str], KnownT | None]) -> KnownT | None:
        """Whose token a connection gives, with which it must begin; it has ended if it gives none.

        Args:
            connection: has just been opened.
            whose: tells by a token; None for one that nobody has.

        Raises:
            Gone: if the connection has ended by itself.
        """
        self._strangers += 1
        try:
            known = await self._known(connection, whose)
            if known is None:
                await connection.close(UNKNOWN, "wrong token")
                await connection.ended()
            return known
        finally:
            self._strangers -= 1

    async def _known(self, connection: Connection, whose: Callable[[str], KnownT | None]) -> KnownT | None:
        try:
            async with asyncio.timeout(GREETING_S):
                first = await connection.receive()
        except TimeoutError:
            return None
        return whose(first) if isinstance(first, str) else None


def path_of(asked: HTTPConnection) -> list[str]:
    """The path of an address that was asked for, as it stands there, by its parts: one part of `/a%2Fb`."""
    raw: bytes = asked.scope["raw_path"]
    return raw.decode("ascii").split("/")[1:]


def headers(frames: str = "'none'", **more: str) -> dict[str, str]:
    """Headers of an answer that nobody keeps, and that no stranger's page shows.

    Args:
        frames: pages that may show it in a frame, as a policy names them; or a whole policy after that.
        **more: further headers, with _ for -.
    """
    return {
        # The rest of its policy stands in the page, where this has no effect.
        "Content-Security-Policy": f"frame-ancestors {frames}",
        "X-Content-Type-Options": "nosniff",
        "Referrer-Policy": "no-referrer",
        "Cache-Control": "no-store",
        "Connection": "close",
        **{name.replace("_", "-"): value for name, value in more.items()},
    }


def answer(status: HTTPStatus, body: bytes = b"", frames: str = "'none'", **more: str) -> Response:
    """An answer of one page.

    Args:
        status: of the answer.
        body: HTML.
        frames, **more: as for `headers`.
    """
    return Response(body, status, headers(frames, **more), "text/html; charset=utf-8")
