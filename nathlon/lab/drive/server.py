"""The server of a test drive: one page and one WebSocket, on the loopback interface alone."""

from __future__ import annotations

import asyncio
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from nathlon.lab.drive.page import drive_page
from nathlon.lab.drive.room import Room
from nathlon.lab.drive.wheel import LARGEST_FRAME, WheelSocket
from nathlon.lab.web.one_page import OnePage

SWITCH_S = 0.0005
"""After which a thread that holds Python's lock lets another one have it: a tick must not wait for long."""


class DriveServer(OnePage):
    """Serves the page, and lets the one that has the token drive.

    Args:
        room: in which the person drives.
    """

    def __init__(self, room: Room) -> None:
        super().__init__(
            lambda address, token: drive_page(address.socket, address.socket, token),
            WheelSocket(room).hold,
            LARGEST_FRAME,
        )


@contextmanager
def quick_switching() -> Iterator[None]:
    """While races run on threads of this process that must keep time."""
    before_s = sys.getswitchinterval()
    sys.setswitchinterval(SWITCH_S)
    try:
        yield
    finally:
        sys.setswitchinterval(before_s)


async def serve_drives(
    make_room: Callable[[], Room], port: int, on_open: Callable[[DriveServer], None]
) -> None:
    """Serve until the task is cancelled.

    Args:
        make_room: the room, made on the event loop.
        port: to listen on; 0 for any that is free.
        on_open: told when the page can be opened.

    Raises:
        InputError: if the port cannot be had.
    """
    with quick_switching():
        room = make_room()
        drive = DriveServer(room)
        async with drive.open_at(port):
            on_open(drive)
            try:
                await asyncio.get_running_loop().create_future()
            finally:
                await room.leave()
