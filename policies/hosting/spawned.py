"""Processes of `multiprocessing`: what they begin with, the pipe to one, and how they end."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from multiprocessing import parent_process
from multiprocessing.context import SpawnContext, SpawnProcess
from types import ModuleType
from typing import Any

from nathlon.policies.hosting.incoming import Incoming
from nathlon.policies.hosting.programs import end_group
from nathlon.policies.hosting.wire import end_after
from nathlon.policies.patience import FIRST_ANSWER_S

BLAS_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
"""Variables of the environment that are 1 there."""
SAFE_PATH, OURS = "PYTHONSAFEPATH", "nathlon"
"""With it Python imports nothing from the current folder; and its value where we have set it."""


@contextmanager
def starting_processes() -> Iterator[None]:
    """Processes started meanwhile have one thread of BLAS, and run neither the user's script nor other files.

    They take the number from their environment before they load BLAS. `multiprocessing` would have them
    import the main module, for what is defined there. Nothing of that is ever sent to them. It would also
    have them begin in the current folder, whose `queue.py` they would import for Python's own.
    """
    before = {name: os.environ.get(name) for name in (*BLAS_THREADS, SAFE_PATH)}
    os.environ.update(dict.fromkeys(BLAS_THREADS, "1"))
    os.environ[SAFE_PATH] = before[SAFE_PATH] or OURS  # empty, it would not be heeded
    main = sys.modules["__main__"]
    sys.modules["__main__"] = ModuleType("__main__")
    try:
        yield
    finally:
        sys.modules["__main__"] = main
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value


def forget_safe_path() -> None:
    """In a process started so: have those that foreign code starts from here find their own files."""
    if os.environ.get(SAFE_PATH) == OURS:
        del os.environ[SAFE_PATH]


def obey_parent() -> None:
    """In a process of multiprocessing: leave Ctrl-C to the one that started it, and end with that one."""
    parent = parent_process()
    if parent is not None:
        end_after(parent.join)


class FreshProcess(SpawnProcess):
    """A process that begins with nothing of this one."""

    def start(self) -> None:
        with starting_processes():
            super().start()

    def run(self) -> None:
        forget_safe_path()
        super().run()


class FreshProcesses(SpawnContext):
    """What makes such processes, whoever asks for them, and whenever."""

    Process = FreshProcess


class Spawned:
    """A process of multiprocessing that does something for this one, and the pipe to it.

    Attributes:
        process: the process.
        pipe: this one's end of the pipe.
        incoming: what comes through it.
    """

    def __init__(
        self, context: Any, serve: Callable[..., None], *arguments: object, limit_s: float = FIRST_ANSWER_S
    ) -> None:
        """Start a process.

        Args:
            context: of multiprocessing.
            serve: called there with the other end of the pipe and the arguments.
            limit_s: time for the rest of a message that has begun.
        """
        self.pipe, theirs = context.Pipe()
        self.process = context.Process(target=serve, args=(theirs, *arguments), daemon=True)
        with starting_processes():
            self.process.start()
        theirs.close()
        self.incoming = Incoming(self.pipe, self.process.pid, limit_s)

    def kill(self) -> None:
        """End it at once, with all that it has started; what it has sent can still be read."""
        end_group(self.process.pid)
        self.process.kill()  # it may have no group of its own, or not yet
        self.process.join()
