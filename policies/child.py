"""A process of its own for foreign code: one that hangs, exits or prints harms nobody."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import weakref
from collections.abc import Mapping, Sequence
from contextlib import suppress
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from typing import TYPE_CHECKING, Any

from nathlon.policies.child_processes import BLAS_THREADS
from nathlon.policies.patience import LOOK_S, Waiting
from nathlon.sim.wire import pack, unpack

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from nathlon.sim.wire import Arrays


class ChildError(Exception):
    """A process has not answered as it should, and is ended; says how, without naming it."""


class Child:
    """A process that answers messages; it ends with this object or with this process, and so do its own.

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
        self._pipe, theirs = Pipe()
        # Not a process of multiprocessing: those of daemons may have none, and some would start the
        # user's script once more.
        try:
            self.process = subprocess.Popen(
                [word.replace("{pipe}", str(theirs.fileno())) for word in command],
                stdin=subprocess.PIPE,  # is closed with this process, however that ends
                stdout=sys.__stderr__,
                env={**os.environ, **dict.fromkeys(BLAS_THREADS, "1"), **environment},
                pass_fds=[theirs.fileno()],
                start_new_session=True,  # so that its own processes can be ended with it
            )
        finally:
            theirs.close()
        self.end = weakref.finalize(self, _end, self.process, self._pipe)

    def ask(
        self, message: dict[str, Any], arrays: Arrays | None = None, *, limit_s: float
    ) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
        """What it answers to a message with arrays; see `nathlon.sim.wire`.

        Raises:
            ChildError: if it does not answer in time, ends, or answers with something else. It is ended then.
        """
        try:
            self._pipe.send_bytes(pack(message, arrays))
            waiting = Waiting(self.process.pid)
            while not self._pipe.poll(min(LOOK_S, limit_s)):
                if waiting.look() >= limit_s:
                    raise self.failed(f"has not answered in {limit_s:g} s")
            return unpack(self._pipe.recv_bytes())
        except (EOFError, OSError):
            raise self.failed("ended its process") from None
        except ValueError as error:
            raise self.failed(f"answers with no message ({error})") from None

    def failed(self, reason: str) -> ChildError:
        """End it; the error to raise."""
        self.end()
        return ChildError(reason)


def _end(process: subprocess.Popen[bytes], pipe: Connection) -> None:
    with suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)
    process.wait()
    assert process.stdin is not None
    process.stdin.close()
    pipe.close()
