"""What a server for browsers bears of connections that ask for nothing, take nothing or talk nonsense."""

from __future__ import annotations

import asyncio
from asyncio import StreamReader, StreamWriter
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager, suppress
from http import HTTPStatus

import pytest
from starlette.requests import Request
from starlette.responses import Response, StreamingResponse

from nathlon.lab.web import server
from nathlon.lab.web.access import Access, answer, path_of
from nathlon.lab.web.address import Address
from nathlon.lab.web.connection import Connection, Gone
from tests.support.sockets import PATIENCE_S

MANY = 300
PART = bytes(1 << 16)
CLOSE = b"\x88\x80\0\0\0\0"
"""A frame that ends a WebSocket, masked."""


class Asked:
    """A server whose answers depend on what is asked for.

    Attributes:
        cut: set when somebody who takes nothing is waited for no longer.
        sent: parts that a WebSocket has taken.
    """

    def __init__(self) -> None:
        self.cut, self.sent = asyncio.Event(), 0

    async def answer(self, request: Request) -> Response:
        match path_of(request):
            case ["endless"]:
                return StreamingResponse(self._endless())
            case ["fault"]:
                raise ZeroDivisionError("a fault of our own")
        return answer(HTTPStatus.OK, b"<p>here</p>")

    async def _endless(self) -> AsyncIterator[bytes]:
        try:
            while True:
                yield PART
                await asyncio.sleep(0.0)
        finally:
            self.cut.set()

    async def talk(self, connection: Connection) -> None:
        with suppress(Gone):
            while True:
                await connection.send(PART)
                self.sent += 1
                await asyncio.sleep(0.0)
        self.cut.set()


class Site:
    """The server, as somebody sees it who connects."""

    def __init__(self, address: Address, asked: Asked) -> None:
        self.address, self.asked = address, asked

    async def dial(self, said: bytes = b"") -> tuple[StreamReader, StreamWriter]:
        reader, writer = await asyncio.open_connection(self.address.host, self.address.port)
        writer.write(said)
        return reader, writer

    def head(self, path: str = "/", method: str = "GET", **more: str) -> bytes:
        lines = [f"{name.replace('_', '-')}: {value}" for name, value in more.items()]
        return "\r\n".join(
            [f"{method} {path} HTTP/1.1", f"Host: {self.address.authority}", *lines, "", ""]
        ).encode()

    def opening(self, **more: str) -> bytes:
        facts = {"Connection": "Upgrade", "Upgrade": "websocket", "Origin": self.address.origin}
        key = {"Sec_WebSocket_Version": "13", "Sec_WebSocket_Key": "dGhlIHNhbXBsZSBub25jZQ=="}
        return self.head("/", **facts, **key, **more)

    async def told(self, said: bytes) -> bytes:
        """All that comes back until the connection ends."""
        reader, writer = await self.dial(said)
        try:
            async with asyncio.timeout(PATIENCE_S):
                return await reader.read()
        except ConnectionError:
            return b""
        finally:
            writer.close()


def on_site(check: Callable[[Site], Awaitable[None]]) -> None:
    """Look at a server while it listens."""

    async def look() -> None:
        asked = Asked()
        async with opened(asked) as address:
            await check(Site(address, asked))

    asyncio.run(look())


@asynccontextmanager
async def opened(asked: Asked) -> AsyncIterator[Address]:
    doors: list[Access] = []

    def make(address: Address) -> Access:
        doors.append(Access(address, 8, asked.answer, asked.talk))
        return doors[0]

    async with server.listen(Address("127.0.0.1", 0), make, 1 << 16, 0.2):
        yield doors[0].address


def silent(caplog: pytest.LogCaptureFixture, capfd: pytest.CaptureFixture[str]) -> bool:
    return not caplog.text + "".join(capfd.readouterr())


def test_connections_that_ask_for_nothing_keep_nobody_away(
    caplog: pytest.LogCaptureFixture, capfd: pytest.CaptureFixture[str]
) -> None:
    async def check(site: Site) -> None:
        half = [await site.dial(site.head()[:-2]) for _ in range(MANY)]
        assert b"<p>here</p>" in await site.told(site.head())
        # One more takes the place of the oldest.
        async with asyncio.timeout(PATIENCE_S):
            with suppress(ConnectionError):
                assert await half[0][0].read() == b""
        for _, writer in half:
            writer.close()
        assert b"<p>here</p>" in await site.told(site.head())

    on_site(check)
    assert silent(caplog, capfd)


def test_who_does_not_ask_in_time_is_cut(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(server, "ASKING_S", 0.05)

    async def check(site: Site) -> None:
        assert await site.told(b"") == b""
        assert await site.told(site.head()[:-2]) == b""
        # An opening with more headers than a WebSocket may have.
        assert await site.told(site.opening(**{f"X{number}": "1" for number in range(200)})) == b""

    on_site(check)


@pytest.mark.parametrize("of", ["answer", "socket"])
def test_who_takes_nothing_is_cut(of: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(server, "TAKING_S", 0.05)

    async def check(site: Site) -> None:
        _, writer = await site.dial(site.head("/endless") if of == "answer" else site.opening())
        async with asyncio.timeout(PATIENCE_S):
            await site.asked.cut.wait()
        writer.close()

    on_site(check)


def test_nonsense_is_refused_and_not_told(
    caplog: pytest.LogCaptureFixture, capfd: pytest.CaptureFixture[str]
) -> None:
    async def check(site: Site) -> None:
        for nonsense, expected in (
            (b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03\r\n\r\n", b" 400 "),
            (b"GET / HTTP/9.9\r\n\r\n", b" 403 "),
            (site.head(method="POST", Content_Length="1000000"), b" 405 "),
            (site.head() * 3, b" 200 "),
            (site.head("/../../%2e%2e/%00"), b" 200 "),
            (site.head(Connection="Upgrade", Upgrade="h2c"), b" 200 "),
            (site.opening()[:-2] + b"Sec-WebSocket-Key: no\r\n\r\n", b" 400 "),
        ):
            first = (await site.told(nonsense)).partition(b"\r\n")[0]
            assert expected in first, (nonsense, first)
        assert b" 200 " not in await site.told(site.head(X="x" * 600_000))
        for after in (b"zz\r\n", b"5\r\nabcdefgh\r\n"):
            await site.told(site.head(method="POST", Transfer_Encoding="chunked") + after)
        for frame in (b"\xff\xff", b"\x81\xfe", b"\x81\x82abcd\x00\x00", b"\x88\x80abcd", b"\x00"):
            _, writer = await site.dial(site.opening())
            writer.write(frame)
            writer.close()
        assert b"<p>here</p>" in await site.told(site.head())

    on_site(check)
    assert silent(caplog, capfd)


def test_a_fault_of_our_own_is_an_answer_and_told_once(caplog: pytest.LogCaptureFixture) -> None:
    async def check(site: Site) -> None:
        said = await site.told(site.head("/fault"))
        assert b" 500 " in said
        assert b"ZeroDivisionError" not in said

    on_site(check)
    assert [record.message for record in caplog.records] == ["/fault cannot be answered"]


def test_a_page_that_takes_leave_does_not_hinder_the_end() -> None:
    async def look() -> None:
        asked = Asked()
        async with opened(asked) as address:
            site = Site(address, asked)
            reader, writer = await site.dial(site.opening())
            async with asyncio.timeout(PATIENCE_S):
                await reader.readuntil(b"\r\n\r\n")
                # What it does not take keeps its connection open.
                sent = -1
                while sent != asked.sent:
                    sent = asked.sent
                    await asyncio.sleep(0.2)
                writer.write(CLOSE)
                await asyncio.sleep(0.2)
        writer.close()

    asyncio.run(look())
