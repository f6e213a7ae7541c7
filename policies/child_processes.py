"""What processes begin with that this one starts, and how they end."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from multiprocessing import parent_process
from multiprocessing.context import SpawnContext, SpawnProcess
from threading import Thread
from types import ModuleType

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
    # Ctrl-C reaches the whole group; the process that started this one decides what it means.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    parent = parent_process()
    if parent is None:
        return
    parent.join()
    if os.name == "posix" and os.getpgrp() == os.getpid():
        os.killpg(0, signal.SIGKILL)  # with all that it has started
    os._exit(1)


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
