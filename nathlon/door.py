"""The door of a server for browsers: who is let in, and how much they may send."""

from __future__ import annotations

import asyncio
import errno
import ipaddress
import ssl
import time
from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from http import HTTPStatus
from pathlib import Path
from typing import TypeVar

from websockets.asyncio.server import Server, ServerConnection, serve
from websockets.datastructures import Headers
from websockets.http11 import Request, Response

from nathlon.reports.web_viewer import LOOPBACK
from nathlon.sim.errors import InputError

KnownT = TypeVar("KnownT")
Talk = Callable[[ServerConnection], Awaitable[None]]
Admit = Callable[[ServerConnection, Request], Awaitable[Response | None] | Response | None]

GREETING_S = 5.0
"""In which a connection must give its token."""
UNKNOWN = 4001
"""Code with which a connection ends that has no token."""
TOO_MUCH = 1008
"""Code with which a connection ends that sends too often, or what is no message."""
DEFAULT_PORTS = {False: 80, True: 443}
"""Which browsers do not name, with TLS and without."""


@dataclass(frozen=True)
class Address:
    """Where a server is reached.

    Attributes:
        host: name or IP address by which browsers call it.
        port: on which it listens.
        tls: whether it speaks TLS.
    """

    host: str
    port: int
    tls: bool = False

    @property
    def authority(self) -> str:
        """As browsers write it into the header Host."""
        host = f"[{self.host}]" if ":" in self.host else self.host
        return host if self.port == DEFAULT_PORTS[self.tls] else f"{host}:{self.port}"

    @property
    def origin(self) -> str:
        """Of its pages."""
        return f"http{'s' if self.tls else ''}://{self.authority}"

    @property
    def socket(self) -> str:
        """Of its WebSockets."""
        return f"ws{'s' if self.tls else ''}://{self.authority}"


def is_loopback(host: str) -> bool:
    """Whether a name or address is that of this machine for itself."""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def is_unspecified(host: str) -> bool:
    """Whether it stands for all addresses of a machine, and so is none by which it is reached."""
    try:
        return ipaddress.ip_address(host).is_unspecified
    except ValueError:
        return False


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


class Door:
    """Lets in pages of the server's own, and of those who have a token.

    Args:
        address: of the server.
        most_strangers: connections at a time that have not given a token yet.
    """

    def __init__(self, address: Address, most_strangers: int) -> None:
        self.address = address
        self._most_strangers, self._strangers = most_strangers, 0

    def refusal(self, request: Request) -> Response | None:
        """Why a request is not let in; None if it is.

        Another name for this machine may be a stranger's page that has found the port, and so may another
        origin.
        """
        if request.headers.get_all("Host") != [self.address.authority]:
            return answer(HTTPStatus.FORBIDDEN)
        if "Upgrade" not in request.headers:
            return None
        if request.headers.get_all("Origin") != [self.address.origin]:
            return answer(HTTPStatus.FORBIDDEN)
        if self._strangers >= self._most_strangers:
            return answer(HTTPStatus.SERVICE_UNAVAILABLE)
        return None

    async def recognise(
        self, connection: ServerConnection, whose: Callable[[str], KnownT | None]
    ) -> KnownT | None:
        """Whose token a connection gives, with which it must begin; it is closed if it gives none.

        Args:
            connection: has just been opened.
            whose: tells by a token; None for one that nobody has.
        """
        self._strangers += 1
        try:
            async with asyncio.timeout(GREETING_S):
                first = await connection.recv()
            known = whose(first) if isinstance(first, str) else None
        except TimeoutError:
            known = None
        finally:
            self._strangers -= 1
        if known is None:
            await connection.close(UNKNOWN, "wrong token")
        return known


def answer(
    status: HTTPStatus,
    body: bytes = b"",
    kind: str = "text/html; charset=utf-8",
    frames: str = "'none'",
    **more: str,
) -> Response:
    """An answer that nobody keeps, and that no stranger's page shows.

    Args:
        status: of the answer.
        body: what it brings.
        kind: of the body.
        frames: pages that may show it in a frame, as a policy names them; or a whole policy after that.
        **more: further headers, with _ for -.
    """
    headers = Headers()
    headers["Content-Type"] = kind
    headers["Content-Length"] = str(len(body))
    # The rest of its policy stands in the page, where this has no effect.
    headers["Content-Security-Policy"] = f"frame-ancestors {frames}"
    headers["X-Content-Type-Options"] = "nosniff"
    headers["Referrer-Policy"] = "no-referrer"
    headers["Cache-Control"] = "no-store"
    headers["Connection"] = "close"
    for name, value in more.items():
        headers[name.replace("_", "-")] = value
    return Response(status.value, status.phrase, headers, body)


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


async def listen(
    talk: Talk,
    admit: Admit,
    address: Address,
    largest: int,
    closing_s: float,
    tls: ssl.SSLContext | None = None,
    opening_s: float = 10.0,
) -> tuple[Server, Address]:
    """Listen where a server is to be reached: a name that is not this machine's own, on all interfaces.

    Args:
        talk: serves a WebSocket until it ends.
        admit: answers a request; None lets it become a WebSocket.
        address: with port 0 for any that is free.
        largest: message that may come, bytes.
        closing_s: in which the other side must answer that a connection ends, or have taken a page.
        tls: how to speak it.
        opening_s: in which a request must have come, and been answered.

    Returns:
        the server, and its address with the port.

    Raises:
        InputError: if the port cannot be had.
    """
    try:
        server = await serve(
            talk,
            _interface(address.host),
            address.port,
            process_request=admit,
            compression=None,
            max_size=largest,
            max_queue=32,
            open_timeout=opening_s,
            close_timeout=closing_s,
            server_header=None,
            ssl=tls,
        )
    except OSError as error:
        if error.errno == errno.EADDRNOTAVAIL:
            raise InputError(f"--host: {address.host} is no address of this machine") from None
        if error.errno not in (errno.EADDRINUSE, errno.EACCES):
            raise
        raise InputError(f"--port: {address.port} is taken or not to be had, expected a free one") from None
    port = server.sockets[0].getsockname()[1]
    return server, Address(address.host, port, address.tls)


def _interface(host: str) -> str | None:
    if host == "localhost":
        return LOOPBACK
    try:
        return str(ipaddress.ip_address(host))
    except ValueError:
        return None
