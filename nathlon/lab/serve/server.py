"""The server of the committee's room: its page, a WebSocket for each window, and test drives."""

from __future__ import annotations

import asyncio
import json
import ssl
from collections.abc import AsyncIterator, Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from contextlib import asynccontextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import ParamSpec, TypeVar
from urllib.parse import unquote

from nathlon.lab.drive.blind import BlindTest
from nathlon.lab.drive.clock import Clock
from nathlon.lab.drive.room import Mailbox, Room
from nathlon.lab.drive.server import quick_switching
from nathlon.lab.drive.wheel import WheelSocket, deliver
from nathlon.lab.serve.files import Files
from nathlon.lab.serve.record import RunsRecord
from nathlon.lab.serve.tokens import Tokens
from nathlon.lab.serve.wishes import WISH, Look
from nathlon.lab.web.access import Access
from nathlon.lab.web.address import Address
from nathlon.lab.web.connection import TOO_MUCH, Connection, Rate
from nathlon.lab.web.server import listen
from nathlon.sim.errors import InputError

AnswerT = TypeVar("AnswerT")
ArgumentsP = ParamSpec("ArgumentsP")

LARGEST_MESSAGE = 1 << 16
"""Bytes that a page may send at once: a ballot names some hundred entrants."""
MOST_MESSAGES = 20
"""That a page may send in a second."""
MOST_STRANGERS = 32
MOST_WINDOWS = 8
"""That a member may have open."""
LOOK_EVERY_S = 1.0
"""After which it is looked what others have added to the store."""
CLOSING_S = 2.0
"""In which the other side must answer that a connection ends."""
FULL = 4002
"""Code with which a connection ends whose member has too many windows."""


@dataclass(eq=False)
class OpenPage:
    """A page that a member has open.

    Attributes:
        member: whose it is.
        run: that it looks at; None for the last.
        shown: how the run stands, as it was told last.
        letters: what it is to be told.
    """

    member: str
    run: str | None = None
    shown: str = ""
    letters: Mailbox = field(default_factory=Mailbox)
    rate: Rate = field(default_factory=lambda: Rate(MOST_MESSAGES))


class MeetingServer:
    """Serves a committee's room.

    Args:
        record: of the store; used on one thread of the server's own.
        store: path or URL.
        tokens: of the members.
        new_clock: makes the clock of each test drive.
    """

    def __init__(
        self,
        record: RunsRecord,
        store: str,
        tokens: Tokens,
        new_clock: Callable[[], Clock] = Clock,
    ) -> None:
        self._record, self._store, self._tokens = record, store, tokens
        self._clerk = ThreadPoolExecutor(1)
        self._new_clock = new_clock
        self._windows: set[OpenPage] = set()
        self._wheels: dict[tuple[str, str, str | None], WheelSocket] = {}
        self._preparing = asyncio.Lock()

    @asynccontextmanager
    async def open_at(self, address: Address, tls: ssl.SSLContext | None) -> AsyncIterator[None]:
        """Serve the room at an address, with port 0 at any that is free.

        Raises:
            InputError: if it cannot be had.
        """
        async with listen(address, self._furnish, LARGEST_MESSAGE, CLOSING_S, tls):
            yield

    def _furnish(self, address: Address) -> Access:
        self.address = address
        files = Files(address, self._store, self._tokens, self._folder, self._version)
        self._access = Access(address, MOST_STRANGERS, files.answer, self._talk)
        return self._access

    def url(self, member: str) -> str:
        """What a member opens. The token stands where browsers never send it."""
        return f"{self.address.origin}/#{self._tokens.by_member[member]}"

    async def _talk(self, connection: Connection) -> None:
        member = await self._access.recognise(connection, self._tokens.member)
        if member is None:
            return
        match connection.path:
            case ["room"]:
                await self._receive(connection, member)
            case ["drive", run]:
                await self._drive(connection, member, unquote(run))

    async def _receive(self, connection: Connection, member: str) -> None:
        if sum(window.member == member for window in self._windows) >= MOST_WINDOWS:
            await connection.close(FULL, f"more than {MOST_WINDOWS} windows")
            return
        window = OpenPage(member)
        self._windows.add(window)
        window.letters.say({"type": "welcome", "you": member})
        sending = asyncio.create_task(deliver(connection, window.letters))
        try:
            async for message in connection:
                if window.rate.exceeded():
                    await connection.close(TOO_MUCH, f"more than {MOST_MESSAGES} messages a second")
                    return
                try:
                    await self._hear(window, message)
                except InputError as error:
                    window.letters.say({"type": "refused", "why": str(error)})
                except ValueError:
                    await connection.close(TOO_MUCH, "no message of this version's page")
                    return
        finally:
            sending.cancel()
            self._windows.discard(window)

    async def _hear(self, window: OpenPage, message: str | bytes) -> None:
        """Do what a page asks.

        Raises:
            ValueError: if it asks for nothing that there is.
            InputError: if it cannot be done.
        """
        if isinstance(message, bytes):
            raise ValueError("no text")
        wish = WISH.validate_json(message)
        if isinstance(wish, Look):
            window.run = wish.run
            await self._show([window])
            return
        last = await self._clerked(self._record.last)
        await self._clerked(self._record.add, window.run or last, window.member, wish)
        window.letters.say({"type": "done", "what": wish.type})
        await self._show(self._windows)

    async def _show(self, windows: Iterable[OpenPage]) -> None:
        """Tell windows how what they look at stands, if they have not been told so."""
        told: dict[str | None, str] = {}
        for window in list(windows):
            if window.run not in told:
                told[window.run] = json.dumps(await self._clerked(self._record.state, window.run))
            if window.shown != told[window.run]:
                window.shown = told[window.run]
                # Of those that wait for a slow page, only the last is sent.
                window.letters.show(window.shown.encode())

    async def watch(self) -> None:
        """Tell what others add to the store, until the task is cancelled."""
        trouble = ""
        while True:
            await asyncio.sleep(LOOK_EVERY_S)
            try:
                await self._show(self._windows)
                trouble = ""
            except InputError as error:
                if str(error) != trouble:
                    trouble = str(error)
                    for window in self._windows:
                        window.letters.say({"type": "refused", "why": trouble})

    async def _drive(self, connection: Connection, member: str, run: str) -> None:
        try:
            async with self._preparing:
                wheel = await self._wheel(member, run)
        except InputError as error:
            await connection.send(json.dumps({"type": "refused", "why": str(error)}))
            await connection.ended()
            return
        await wheel.hold(connection)

    async def _wheel(self, member: str, run: str) -> WheelSocket:
        """Where a member drives a run's finalists; it stays while the question is the same."""
        folder = await self._folder(run)
        if folder is None:
            raise InputError(f"{run}: there is no folder of this run, expected --out to lead to it")
        decision = await self._clerked(self._record.selection, run)
        key = member, run, decision
        if key not in self._wheels:
            test = await asyncio.to_thread(BlindTest, folder, self._store, member)
            self._wheels[key] = WheelSocket(Room(test.offer, test.output, self._new_clock, test))
        return self._wheels[key]

    async def leave(self) -> None:
        """End all test drives that are under way."""
        for wheel in self._wheels.values():
            await wheel.room.leave()
        self._clerk.shutdown()

    async def _folder(self, run: str) -> Path | None:
        return await self._clerked(self._record.folder, run)

    async def _version(self, run: str) -> str:
        return await self._clerked(self._record.version, run)

    async def _clerked(
        self,
        what: Callable[ArgumentsP, AnswerT],
        *arguments: ArgumentsP.args,
        **named: ArgumentsP.kwargs,
    ) -> AnswerT:
        """What the record answers, on its thread."""
        loop = asyncio.get_running_loop()
        return await loop.run_in_executor(self._clerk, lambda: what(*arguments, **named))


async def serve_meeting(
    record: RunsRecord,
    store: str,
    tokens: Tokens,
    address: Address,
    tls: ssl.SSLContext | None,
    on_open: Callable[[MeetingServer], None],
    new_clock: Callable[[], Clock] = Clock,
) -> None:
    """Serve until the task is cancelled.

    Args:
        record, store, tokens, new_clock: as for `MeetingServer`.
        address, tls: as for `MeetingServer.open_at`.
        on_open: told when the room can be entered.

    Raises:
        InputError: if the address cannot be had.
    """
    with quick_switching():
        meeting = MeetingServer(record, store, tokens, new_clock)
        async with meeting.open_at(address, tls):
            on_open(meeting)
            try:
                await meeting.watch()
            finally:
                await meeting.leave()
