"""A process of its own for foreign code: one that hangs, exits or prints harms nobody."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import weakref
from collections.abc import Mapping, Sequence
from contextlib import suppress
from typing import TYPE_CHECKING, Any

from nathlon.policies.hosting.incoming import CHUNK_BYTES, SIZE
from nathlon.policies.hosting.programs import Program, end, start
from nathlon.policies.hosting.spawned import BLAS_THREADS
from nathlon.policies.hosting.wire import pack, unpack
from nathlon.policies.patience import LOOK_S, Waiting

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from nathlon.policies.hosting.wire import Arrays


MOST_BYTES = 1 << 28
"""Of an answer: a picture or an observation has some megabytes."""


class ChildError(Exception):
    """A process has not answered as it should, and is ended; says how, without naming it."""


class LateError(ChildError):
    """It has not answered in time."""


class RaisedError(Exception):
    """What it was asked for raised there, which this says; it still answers."""


class Child:
    """A process that answers messages; it ends with this object or with this process, and so do its own.

    See `nathlon.policies.hosting.wire` for its end.

    What it prints goes to this process's stderr.

    Attributes:
        process: the process.
    """

    def __init__(self, command: Sequence[str], environment: Mapping[str, str] = {}) -> None:
        """Start a process.

        Args:
            command: to run; `{pipe}` in it stands for the descriptor of the pipe that it answers through.
            environment: variables that it has besides, or instead of, those of this process.

        Raises:
            OSError: if there is no such program.
        """
        self._socket, theirs = socket.socketpair()
        # Not a process of multiprocessing: those of daemons may have none, and some would start the
        # user's script once more.
        try:
            self.process = start(
                [word.replace("{pipe}", str(theirs.fileno())) for word in command],
                stdin=subprocess.PIPE,  # is closed with this process, however that ends
                stdout=sys.__stderr__,
                env={**os.environ, **dict.fromkeys(BLAS_THREADS, "1"), **environment},
                pass_fds=[theirs.fileno()],
            )
        finally:
            theirs.close()
        self.end = weakref.finalize(self, _end, self.process, self._socket)

    def ask(
        self, message: dict[str, Any], arrays: Arrays | None = None, *, limit_s: float
    ) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
        """What it answers to a message with arrays.

        Raises:
            ChildError: if it does not answer in time, ends, or answers with something else. It is ended then.
            RaisedError: see there.
        """
        self._socket.settimeout(min(LOOK_S, limit_s))
        waiting, packed = Waiting(self.process.pid), pack(message, arrays)
        try:
            self._send(SIZE.pack(len(packed)) + packed, waiting, limit_s)
            [size] = SIZE.unpack(self._read(SIZE.size, waiting, limit_s))
            if not 0 <= size <= MOST_BYTES:
                raise self.failed(f"answers with a message of more than {MOST_BYTES} bytes")
            answer, brought = unpack(self._read(size, waiting, limit_s))
        except (EOFError, OSError):
            raise self.failed("ended its process") from None
        except ValueError as error:
            raise self.failed(f"answers with no message ({error})") from None
        if "raised" in answer:
            raise RaisedError(str(answer["raised"]))
        return answer, brought

    def _send(self, content: bytes, waiting: Waiting, limit_s: float) -> None:
        left = memoryview(content)
        while left:
            with suppress(TimeoutError):
                left = left[self._socket.send(left) :]
            if left:
                self._check(waiting, limit_s)

    def _read(self, size: int, waiting: Waiting, limit_s: float) -> bytes:
        """So many bytes, however slowly they come: the limit is for all together."""
        read: list[bytes] = []
        while size:
            with suppress(TimeoutError):
                chunk = self._socket.recv(min(size, CHUNK_BYTES))
                if not chunk:
                    raise EOFError
                read.append(chunk)
                size -= len(chunk)
            if size:
                self._check(waiting, limit_s)
        return b"".join(read)

    def _check(self, waiting: Waiting, limit_s: float) -> None:
        if waiting.look() >= limit_s:
            self.end()
            raise LateError(f"has not answered in {limit_s:g} s")

    def failed(self, reason: str) -> ChildError:
        """End it; the error to raise."""
        self.end()
        return ChildError(reason)


def _end(process: Program, pipe: socket.socket) -> None:
    end(process)
    assert process.stdin is not None
    process.stdin.close()
    pipe.close()
