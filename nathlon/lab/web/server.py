"""Listening for browsers: uvicorn's connections, each of which is waited for so long and no longer."""

from __future__ import annotations

import asyncio
import errno
import ssl
from asyncio import BaseTransport, TimerHandle, Transport
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager, suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

from h11 import LocalProtocolError
from h11 import Request as Head
from uvicorn import Config
from uvicorn.protocols.http.h11_impl import H11Protocol
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol
from uvicorn.server import ServerState
from websockets.exceptions import InvalidState
from websockets.http11 import Request as Opening

from nathlon.lab.web.access import Access
from nathlon.lab.web.address import Address
from nathlon.sim.errors import InputError

ASKING_S = 10.0
"""In which a connection must have asked for something."""
TAKING_S = 60.0
"""In which the next part of an answer must have been taken: members may be far away."""
MOST_ASKING = 64
"""Connections at a time that have not asked for anything yet: one more takes the place of the oldest."""
MOST_CONNECTIONS = 256
"""At a time; one more is told to come back later."""
LARGEST_HEAD = 1 << 14
"""Bytes of a request's headers."""


class _State(ServerState):
    """What the connections of a server share.

    Attributes:
        asking: those that have not asked for anything yet, the oldest first.
        closing_s: as for `listen`.
    """

    def __init__(self, closing_s: float) -> None:
        super().__init__()
        self.asking: dict[_Request, None] = {}
        self.closing_s = closing_s


class _Deadline:
    """Cuts a connection whose other side does not do what is waited for."""

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        self._loop = loop
        self._timer: TimerHandle | None = None

    def begin(self, transport: Transport, seconds: float) -> None:
        self.end()
        self._timer = self._loop.call_later(seconds, transport.abort)

    def end(self) -> None:
        if self._timer is not None:
            self._timer.cancel()


class _Request(H11Protocol):
    """A connection with one request. Uvicorn waits for its head, and for a reader of the answer, for ever."""

    server_state: _State

    def __init__(self, config: Config, server_state: ServerState, app_state: dict[str, Any]) -> None:
        super().__init__(config, server_state, app_state)
        self._deadline = _Deadline(self.loop)

    def connection_made(self, transport: Transport) -> None:  # type: ignore[override]
        super().connection_made(transport)
        self._deadline.begin(transport, ASKING_S)
        asking = self.server_state.asking
        asking[self] = None
        if len(asking) > MOST_ASKING:
            oldest = next(iter(asking))
            del asking[oldest]
            oldest.transport.abort()

    def data_received(self, data: bytes) -> None:
        asking = self.cycle is None
        try:
            super().data_received(data)
        except LocalProtocolError:
            # Nonsense after a request that is being answered: uvicorn cannot refuse it any more.
            self.transport.abort()
        if asking and self.cycle is not None:
            self.cycle.keep_alive = False
            self._asked()

    def handle_websocket_upgrade(self, event: Head) -> None:
        self._asked()
        super().handle_websocket_upgrade(event)

    def _asked(self) -> None:
        self._deadline.end()
        self.server_state.asking.pop(self, None)

    def connection_lost(self, exc: Exception | None) -> None:
        self._asked()
        super().connection_lost(exc)

    def pause_writing(self) -> None:
        super().pause_writing()
        self._deadline.begin(self.transport, TAKING_S)

    def resume_writing(self) -> None:
        super().resume_writing()
        self._deadline.end()

    def on_response_complete(self) -> None:
        super().on_response_complete()
        self._deadline.begin(self.transport, TAKING_S)


class _Socket(WebSocketsSansIOProtocol):
    """A WebSocket. Uvicorn waits for an opening that can be read, and for a reader of messages, for ever."""

    def __init__(self, config: Config, server_state: _State, app_state: dict[str, Any]) -> None:
        super().__init__(config, server_state, app_state)
        self._deadline = _Deadline(self.loop)
        self.close_timeout = server_state.closing_s

    def connection_made(self, transport: BaseTransport) -> None:
        super().connection_made(transport)
        self._deadline.begin(self.transport, ASKING_S)

    def handle_connect(self, event: Opening) -> None:
        super().handle_connect(event)
        self._deadline.end()

    def connection_lost(self, exc: Exception | None) -> None:
        self._deadline.end()
        super().connection_lost(exc)

    def pause_writing(self) -> None:
        super().pause_writing()
        self._deadline.begin(self.transport, TAKING_S)

    def resume_writing(self) -> None:
        super().resume_writing()
        self._deadline.end()


@asynccontextmanager
async def listen(
    address: Address,
    make_access: Callable[[Address], Access],
    largest: int,
    closing_s: float,
    tls: ssl.SSLContext | None = None,
) -> AsyncIterator[None]:
    """Serve an application, where a server is to be reached.

    Args:
        address: with port 0 for any that is free.
        make_access: makes the application of an address that has been found.
        largest: message that may come on a WebSocket, bytes.
        closing_s: in which the other side must answer that a connection ends.
        tls: how to speak it.

    Raises:
        InputError: if the port cannot be had.
    """
    state = _State(closing_s)
    listener = await _listener(address, lambda: _Request(config, state, {}), closing_s, tls)
    config = Config(
        make_access(replace(address, port=listener.sockets[0].getsockname()[1])),
        http=_Request,
        ws=_Socket,
        ws_max_size=largest,
        ws_per_message_deflate=False,
        lifespan="off",
        log_config=None,
        # What strangers send must not fill the terminal. `Access` tells of faults of our own.
        log_level="critical",
        access_log=False,
        proxy_headers=False,
        server_header=False,
        limit_concurrency=MOST_CONNECTIONS,
        h11_max_incomplete_event_size=LARGEST_HEAD,
    )
    config.load()
    await listener.start_serving()
    try:
        yield
    finally:
        listener.close()
        await _close(state)


async def _listener(
    address: Address,
    protocol: Callable[[], asyncio.Protocol],
    closing_s: float,
    tls: ssl.SSLContext | None,
) -> asyncio.Server:
    try:
        return await asyncio.get_running_loop().create_server(
            protocol,
            address.interface,
            address.port,
            ssl=tls,
            ssl_handshake_timeout=ASKING_S if tls else None,
            ssl_shutdown_timeout=closing_s if tls else None,
            start_serving=False,
        )
    except OSError as error:
        if error.errno == errno.EADDRNOTAVAIL:
            raise InputError(f"--host: {address.host} is no address of this machine") from None
        if error.errno not in (errno.EADDRINUSE, errno.EACCES):
            raise
        raise InputError(f"--port: {address.port} is taken or not to be had, expected a free one") from None


async def _close(state: _State) -> None:
    """End all connections; who does not listen to it is cut off."""
    for connection in list(state.connections):
        # One whose other side is just taking leave cannot be told.
        with suppress(InvalidState):
            connection.shutdown()
    if state.tasks:
        _, left = await asyncio.wait(state.tasks, timeout=state.closing_s)
        for task in left:
            task.cancel()
        await asyncio.gather(*left, return_exceptions=True)
    for connection in list(state.connections):
        connection.transport.abort()


def tls_context(cert: Path, key: Path) -> ssl.SSLContext:
    """How a server speaks TLS.

    Args:
        cert: its certificate, with those between it and the root, PEM.
        key: that belongs to it, PEM, not encrypted.

    Raises:
        InputError: if they cannot be used.
    """
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.minimum_version = ssl.TLSVersion.TLSv1_2
    try:
        context.load_cert_chain(cert, key, password="")
    except OSError as error:
        raise InputError(
            f"--cert {cert}, --key {key}: cannot be used ({error.strerror or error}), expected a certificate "
            "and its key, PEM, not encrypted"
        ) from None
    return context
