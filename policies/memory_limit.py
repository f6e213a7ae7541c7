"""How much memory this process may take, as the operating system enforces it."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from nathlon.sim.errors import InputError

if sys.platform == "linux":
    import resource

OPENING_BYTES = 2 << 30
"""What opening a file may take beyond what the process has already."""


class OutOfMemoryError(InputError, MemoryError):
    """A file needs more memory than there is: its own fault only if nobody else has taken it."""


_STATM = Path("/proc/self/statm")
_DATA = 5


def data_bytes() -> int:
    """Private memory that this process has asked for and may write, in bytes; 0 where Linux does not tell."""
    if sys.platform != "linux":
        return 0
    return int(_STATM.read_bytes().split()[_DATA]) * resource.getpagesize()


@contextmanager
def memory_limit(more: int = OPENING_BYTES) -> Iterator[None]:
    """While this process may take at most `more` bytes beyond what it has; beyond that an allocation fails.

    Linux enforces it (`RLIMIT_DATA`); elsewhere there is no limit.
    """
    if sys.platform != "linux":
        yield
        return
    soft, hard = resource.getrlimit(resource.RLIMIT_DATA)
    wanted = data_bytes() + more
    bounds = [limit for limit in (soft, hard, wanted) if limit != resource.RLIM_INFINITY]
    resource.setrlimit(resource.RLIMIT_DATA, (min(bounds), hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_DATA, (soft, hard))
