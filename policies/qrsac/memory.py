"""What becomes of memory that the process has freed."""

from __future__ import annotations

import ctypes
import sys

# Of mallopt(3).
TRIM_THRESHOLD, MMAP_THRESHOLD = -1, -3
NEVER = 2**31 - 1


def keep_freed_memory() -> None:
    """Has glibc keep what is freed for what comes next; does nothing with another C library.

    An update frees as much as it takes, and the system would clear and map every page of it anew: a tenth
    and more of the update's time. The process then holds on to the most that it has had.
    """
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None) if sys.platform == "linux" else None
    if mallopt is not None:
        mallopt(MMAP_THRESHOLD, 2**30)
        mallopt(TRIM_THRESHOLD, NEVER)
