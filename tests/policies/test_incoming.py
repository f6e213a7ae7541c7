"""What comes through a pipe is read whole, or not waited for."""

from __future__ import annotations

import os
import struct
from collections.abc import Iterator
from itertools import islice
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from multiprocessing.reduction import ForkingPickler

import pytest

from nathlon.policies.hosting.incoming import Incoming, UnreadableError

pytestmark = pytest.mark.skipif(os.name != "posix", reason="pipes of Windows give whole messages")

PATIENT_S = 1e6


@pytest.fixture
def pipe() -> Iterator[tuple[Connection, Connection]]:
    """Both ends."""
    here, there = Pipe()
    with here, there:
        yield here, there


def packed(message: object) -> bytes:
    content = ForkingPickler.dumps(message)
    return struct.pack("!i", len(content)) + bytes(content)


def test_messages_come_whole_and_in_order(pipe: tuple[Connection, Connection]) -> None:
    here, there = pipe
    incoming = Incoming(here, None, PATIENT_S)
    assert list(incoming.messages()) == []
    for message in (1, None, "x" * 50_000):
        there.send(message)
    assert list(islice(incoming.messages(), 1)) == [1]
    assert list(incoming.messages()) == [None, "x" * 50_000]
    there.send("last")
    there.close()
    with pytest.raises(EOFError):
        [*incoming.messages()]


def test_the_rest_of_a_message_is_not_waited_for(pipe: tuple[Connection, Connection]) -> None:
    here, there = pipe
    incoming = Incoming(here, None, PATIENT_S)
    came: list[object] = []
    content = packed([1, 2]) + packed("next")
    for place in range(len(content)):
        os.write(there.fileno(), content[place : place + 1])
        came += incoming.messages()
    assert came == [[1, 2], "next"]


@pytest.mark.parametrize(
    "sent",
    [
        pytest.param(packed("all but the end")[:-1], id="half"),
        pytest.param(b"\0", id="half a size"),
        pytest.param(packed("one") + b"\0\0\0\1", id="half after a whole one"),
    ],
)
def test_a_message_that_is_not_ended_in_time_is_refused(
    sent: bytes, pipe: tuple[Connection, Connection]
) -> None:
    here, there = pipe
    incoming = Incoming(here, None, 0.0)
    os.write(there.fileno(), sent)
    with pytest.raises(UnreadableError, match="the rest of a message has not come in 0 s"):
        [*incoming.messages()]


@pytest.mark.parametrize(
    ("sent", "why"),
    [
        pytest.param(struct.pack("!i", -1), "too long", id="longer than any"),
        pytest.param(struct.pack("!i", 3) + b"abc", "unpickled", id="no pickle"),
        pytest.param(struct.pack("!i", 0), "unpickled", id="nothing"),
    ],
)
def test_what_is_no_message_is_refused(sent: bytes, why: str, pipe: tuple[Connection, Connection]) -> None:
    here, there = pipe
    os.write(there.fileno(), sent)
    with pytest.raises(UnreadableError, match=why):
        [*Incoming(here, None, PATIENT_S).messages()]
