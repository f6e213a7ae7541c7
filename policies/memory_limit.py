"""How much memory a process may take, as the operating system enforces it."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from nathlon.sim.errors import InputError

if sys.platform == "linux":
    import resource

OPENING_BYTES = 2 << 30
"""What opening a file may take beyond what the process has already."""


class OutOfMemoryError(InputError, MemoryError):
    """A file needs more memory than there is: its own fault only if nobody else has taken it."""


_DATA = 5


def data_bytes(process: int | None = None) -> int:
    """Private memory that a process has asked for and may write, in bytes; 0 where Linux does not tell.

    Args:
        process: its number; None for this one.

    Raises:
        FileNotFoundError: if there is no such process.
    """
    if sys.platform != "linux":
        return 0
    statm = Path(f"/proc/{process or 'self'}/statm").read_bytes()
    return int(statm.split()[_DATA]) * resource.getpagesize()


@contextmanager
def memory_limit(more: int = OPENING_BYTES, process: int | None = None) -> Iterator[None]:
    """While a process may take at most `more` bytes beyond what it has; beyond that an allocation fails.

    Linux enforces it (`RLIMIT_DATA`); elsewhere there is no limit.

    Args:
        more: see above.
        process: its number; None for this one.

    Raises:
        FileNotFoundError, ProcessLookupError: if there is no such process.
    """
    if sys.platform != "linux":
        yield
        return
    number = process or 0
    soft, hard = resource.prlimit(number, resource.RLIMIT_DATA)
    wanted = data_bytes(process) + more
    bounds = [limit for limit in (soft, hard, wanted) if limit != resource.RLIM_INFINITY]
    resource.prlimit(number, resource.RLIMIT_DATA, (min(bounds), hard))
    try:
        yield
    finally:
        with suppress(ProcessLookupError):  # another one may have ended meanwhile
            resource.prlimit(number, resource.RLIMIT_DATA, (soft, hard))
