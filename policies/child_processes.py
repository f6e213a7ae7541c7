"""What processes begin with that this one starts."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from multiprocessing.context import SpawnContext, SpawnProcess
from types import ModuleType

BLAS_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
"""Variables of the environment that are 1 there."""


@contextmanager
def starting_processes() -> Iterator[None]:
    """Processes started meanwhile have one thread of BLAS, and do not run the user's script again.

    They take the number from their environment before they load BLAS. `multiprocessing` would have them
    import the main module, for what is defined there. Nothing of that is ever sent to them.
    """
    before = {name: os.environ.get(name) for name in BLAS_THREADS}
    os.environ.update(dict.fromkeys(BLAS_THREADS, "1"))
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


class FreshProcess(SpawnProcess):
    """A process that begins with nothing of this one."""

    def start(self) -> None:
        with starting_processes():
            super().start()


class FreshProcesses(SpawnContext):
    """What makes such processes, whoever asks for them, and whenever."""

    Process = FreshProcess
