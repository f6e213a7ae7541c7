"""A WebSocket that a page has opened."""

from __future__ import annotations

import time
from collections.abc import AsyncIterator
from contextlib import suppress

from starlette.websockets import WebSocket, WebSocketDisconnect

TOO_MUCH = 1008
"""Code with which a connection ends that sends too often, or what is no message."""
LONGEST_REASON = 123
"""Bytes that a reason for closing may have."""


class Gone(Exception):
    """The connection has ended, from one side or the other."""


class Connection:
    """A WebSocket that has been accepted.

    Attributes:
        path: of the address that was asked for, as it stands there, by its parts.
    """

    def __init__(self, socket: WebSocket, path: list[str]) -> None:
        self._socket = socket
        self.path = path

    async def receive(self) -> str | bytes:
        """The next message, once it is there.

        Raises:
            Gone: if the connection has ended.
        """
        try:
            message = await self._socket.receive()
        except RuntimeError:
            raise Gone from None
        if message["type"] == "websocket.disconnect":
            raise Gone
        text: str | None = message.get("text")
        return message["bytes"] if text is None else text

    async def __aiter__(self) -> AsyncIterator[str | bytes]:
        """All messages until the connection ends."""
        with suppress(Gone):
            while True:
                yield await self.receive()

    async def send(self, message: str | bytes) -> None:
        """Send a message, once the other side has taken enough of those before.

        Raises:
            Gone: if the connection has ended.
        """
        try:
            if isinstance(message, str):
                await self._socket.send_text(message)
            else:
                await self._socket.send_bytes(message)
        except (WebSocketDisconnect, RuntimeError):
            raise Gone from None

    async def close(self, code: int, reason: str) -> None:
        """End the connection, unless it has ended."""
        said = reason.encode()[:LONGEST_REASON].decode(errors="ignore")
        with suppress(WebSocketDisconnect, RuntimeError):
            await self._socket.close(code, said)

    async def ended(self) -> None:
        """Wait until the connection has ended; what comes until then is not heard."""
        async for _ in self:
            pass


class Rate:
    """Counts what comes, second by second.

    Args:
        most: that may come in a second.
    """

    def __init__(self, most: int) -> None:
        self._most = most
        self._second, self._came = 0, 0

    def exceeded(self) -> bool:
        """Whether one more is too many."""
        second = int(time.monotonic())
        if second != self._second:
            self._second, self._came = second, 0
        self._came += 1
        return self._came > self._most
