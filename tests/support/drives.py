"""Test drives for the tests: choices, races as fast as they can be computed, and the server in a thread."""

from __future__ import annotations

import asyncio
import threading
import time
from collections.abc import Callable, Coroutine, Iterator
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from nathlon.lab.drive.aids import Aids
from nathlon.lab.drive.blind import BlindTest
from nathlon.lab.drive.choice import Choice, DriveOpponent, DrivePlan, Offer, plan
from nathlon.lab.drive.clock import Clock
from nathlon.lab.drive.heat import DrivenHeat, Heat
from nathlon.lab.drive.input_buffer import INPUT, InputBuffer
from nathlon.lab.drive.room import Room
from nathlon.lab.drive.server import DriveServer, serve_drives
from nathlon.selection.publish.output import OutputFolder

ServerT = TypeVar("ServerT")

CIRCUITS = ("porto-sereno", "lindenring", "grandes-landes")
STOP = 600
"""Frames after which a person stops."""
MARKED = 300
"""Frames after which a person marks the moment."""
OPPONENTS = ("driver:pace=0.9", "driver:pace=0.8")


def offer(circuit: str | None = None) -> Offer:
    return Offer.of([DriveOpponent.of(source) for source in OPPONENTS], circuit)


def choice(**other: Any) -> Choice:
    facts: dict[str, Any] = {
        "name": "Ada",
        "circuit": "lindenring",
        "car": "gt3",
        "cars": 3,
        "seat": 2,
        "laps": 1,
        "opponents": (0, 1),
        "aids": Aids(),
        "seed": 5,
    }
    return Choice(**(facts | other))


def inputs(number: int, steering: float = 0.0, throttle: float = 0.0, brake: float = 0.0) -> bytes:
    """A frame of inputs by an analogue device."""
    return INPUT.pack(number, False, steering, throttle, brake)


class Hurry:
    """A clock that is as late as it is told, and waits for nothing."""

    def __init__(self) -> None:
        self.now_s = 100.0

    def clock(self) -> Clock:
        return Clock(lambda: self.now_s, self.sleep)

    def sleep(self, seconds: float) -> None:
        self.now_s += seconds


def drive(made: DrivePlan, seed: int = 1) -> tuple[DrivenHeat, list[bytes]]:
    """A race to its end, and its frames: inputs are drawn for a while, then the person stops for good."""
    driven, frames = _driven(made, seed)
    assert driven is not None
    return driven, frames


def opening(made: DrivePlan, seed: int) -> list[bytes]:
    """The frames of a race for as long as inputs are drawn; then the person leaves it."""
    return _driven(made, seed, leaves=STOP)[1]


def _driven(made: DrivePlan, seed: int, leaves: int | None = None) -> tuple[DrivenHeat | None, list[bytes]]:
    rng, buffer = np.random.default_rng(seed), InputBuffer()
    frames: list[bytes] = []
    ended: list[DrivenHeat | None] = []

    def on_frame(frame: bytes) -> None:
        frames.append(frame)
        if len(frames) == MARKED:
            heat.mark()
        if len(frames) == leaves:
            heat.leave()
        elif len(frames) > STOP:
            buffer.put(inputs(len(frames), brake=1.0))
        elif len(frames) % 7 == 0:
            buffer.put(inputs(len(frames), rng.uniform(-0.2, 0.2), rng.uniform(0.4, 1.0)))

    heat = Heat(
        made, buffer, on_frame, lambda incident: None, lambda mark: None, ended.append, Hurry().clock()
    )
    heat.run()
    [driven] = ended
    return driven, frames


def planned(**other: Any) -> DrivePlan:
    return plan(choice(**other), offer())


def fast(pace: float) -> Clock:
    """A clock by which races run so many times as fast as time."""
    return Clock(lambda: pace * time.monotonic(), lambda seconds: time.sleep(seconds / pace))


@contextmanager
def in_a_thread(serve: Callable[[Callable[[ServerT], None]], Coroutine[Any, Any, None]]) -> Iterator[ServerT]:
    """A server in a thread of its own; `serve` serves until it is cancelled, and hands the server out."""
    opened = threading.Event()
    made: dict[str, Any] = {}

    def on_open(server: ServerT) -> None:
        made["server"] = server
        opened.set()

    async def served() -> None:
        made["loop"], made["task"] = asyncio.get_running_loop(), asyncio.current_task()
        await serve(on_open)

    def run() -> None:
        with suppress(asyncio.CancelledError):
            asyncio.run(served())

    thread = threading.Thread(target=run)
    thread.start()
    try:
        assert opened.wait(60.0)
        yield made["server"]
    finally:
        stop: Callable[[], object] = partial(made["loop"].call_soon_threadsafe, made["task"].cancel)
        stop()
        thread.join(60.0)


@contextmanager
def served(
    folder: Path,
    pace: float = 1.0,
    blind: BlindTest | None = None,
    clock: Clock | None = None,
    circuit: str | None = None,
) -> Iterator[tuple[DriveServer, Room]]:
    """A server on a free port, in a thread of its own, whose races run so many times as fast as time.

    With a clock they run by it.
    """
    made: dict[str, Room] = {}
    new_clock = partial(fast, pace) if clock is None else lambda: clock

    def make_room() -> Room:
        if blind is None:
            made["room"] = Room(offer(circuit), OutputFolder(folder), new_clock)
        else:
            made["room"] = Room(blind.offer, blind.output, new_clock, blind)
        return made["room"]

    def serve(on_open: Callable[[DriveServer], None]) -> Coroutine[Any, Any, None]:
        return serve_drives(make_room, 0, on_open)

    with in_a_thread(serve) as server:
        yield server, made["room"]
