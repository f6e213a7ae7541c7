"""Messages from processes that hold foreign code, read as they come: half a message holds nobody up."""

from __future__ import annotations

import os
import pickle
import struct
from collections.abc import Iterator
from multiprocessing.connection import Connection
from typing import Any

from nathlon.policies.patience import FIRST_ANSWER_S, Waiting

SIZE = struct.Struct("!i")
"""What comes before a message, see `multiprocessing.connection.Connection`; longer ones than fit have -1."""
CHUNK_BYTES = 1 << 20
"""That are read at once."""


class UnreadableError(Exception):
    """What a process has sent is no message, or the rest of one does not come."""


class Incoming:
    """Whole messages from the other end of a pipe.

    `Connection.recv` waits for the rest of a message for ever, and foreign code may have written the
    beginning.
    """

    def __init__(self, pipe: Connection, process: int | None, limit_s: float = FIRST_ANSWER_S) -> None:
        """Of a process with this number, which has so long for a message that it has begun."""
        self._pipe, self._limit_s = pipe, limit_s
        self._read = bytearray()
        self._waiting = Waiting(process)

    def messages(self) -> Iterator[Any]:
        """Those that have come; to be asked for every LOOK_S or more often.

        Raises:
            EOFError: when all are taken, if the process has closed its end.
            UnreadableError: see there.
        """
        while True:
            while (end := self._end()) <= len(self._read):
                message = bytes(self._read[SIZE.size : end])
                del self._read[:end]
                self._waiting.begin()
                yield _unpickled(message)
            if self._read and self._waiting.look() >= self._limit_s:
                raise UnreadableError(f"the rest of a message has not come in {self._limit_s:g} s")
            if not self._pipe.poll():
                return
            chunk = self._chunk()
            if not self._read:
                self._waiting.begin()
            self._read += chunk

    def _chunk(self) -> bytes:
        if os.name != "posix":  # pipes of Windows give whole messages
            message = self._pipe.recv_bytes()
            return SIZE.pack(len(message)) + message
        chunk = os.read(self._pipe.fileno(), CHUNK_BYTES)
        if not chunk:
            raise EOFError
        return chunk

    def _end(self) -> int:
        """How many bytes there must be for the first message, as far as is known."""
        if len(self._read) < SIZE.size:
            return SIZE.size + 1
        [size] = SIZE.unpack_from(self._read)
        if size < 0:
            raise UnreadableError("a message is too long")
        return SIZE.size + int(size)


def _unpickled(message: bytes) -> Any:
    try:
        return pickle.loads(message)
    except Exception as error:
        raise UnreadableError(f"a message cannot be unpickled ({type(error).__name__})") from error
