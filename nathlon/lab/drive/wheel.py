"""The place at the wheel: of the pages that come, the last one drives."""

from __future__ import annotations

import asyncio
from contextlib import suppress

from nathlon.lab.drive.room import Mailbox, Room, Words
from nathlon.lab.web.connection import TOO_MUCH, Connection, Gone, Rate
from nathlon.policies.strict_json import parse_json
from nathlon.sim.errors import InputError

LARGEST_FRAME = 4096
"""Bytes that the page may send at once."""
MOST_FRAMES = 240
"""Frames that the page may send in a second: it sends 60."""
TAKEN_OVER = 4000


class WheelSocket:
    """Lets one connection at a time drive in a room."""

    def __init__(self, room: Room) -> None:
        self.room = room
        self._driver: Connection | None = None

    async def hold(self, connection: Connection) -> None:
        """Let a connection drive until it ends; the one before ends at once."""
        before, self._driver = self._driver, connection
        try:
            if before is not None:
                await before.close(TAKEN_OVER, "another window drives")
            letters = self.room.enter()
            sending = asyncio.create_task(deliver(connection, letters))
            try:
                await self._listen(connection, letters)
            finally:
                sending.cancel()
                self.room.go_away(letters)
        finally:
            if self._driver is connection:
                self._driver = None

    async def _listen(self, connection: Connection, letters: Mailbox) -> None:
        rate = Rate(MOST_FRAMES)
        async for message in connection:
            if rate.exceeded():
                await connection.close(TOO_MUCH, f"more than {MOST_FRAMES} frames a second")
                return
            try:
                if isinstance(message, bytes):
                    self.room.buffer.put(message)
                else:
                    await self.room.hear(_words(message))
            except InputError as error:
                letters.say({"type": "refused", "why": str(error)})
            except ValueError as error:
                await connection.close(TOO_MUCH, str(error)[:100])
                return


async def deliver(connection: Connection, letters: Mailbox) -> None:
    """Send what is to be sent, until the task is cancelled or the connection ends."""
    with suppress(Gone):
        while True:
            await connection.send(await letters.take())


def _words(message: str) -> Words:
    words = parse_json(message)
    if not isinstance(words, dict):
        raise ValueError("a message is no object")
    return words
