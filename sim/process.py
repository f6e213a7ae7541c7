"""Other processes of this machine."""

from __future__ import annotations

import os
import socket
from pathlib import Path

HOST = socket.gethostname()


def has_ended(process: int) -> bool:
    """Whether no process of this machine has this number; False where that cannot be told."""
    if os.name != "posix":
        return False
    try:
        os.kill(process, 0)
    except (ProcessLookupError, OverflowError):
        return True
    except PermissionError:
        pass
    return False


def start_of(process: int) -> int:
    """When a process of this machine started, in clock ticks since the machine did; 0 where it does not tell.

    Together with its number this is its alone, whatever is done to the clock. See
    https://man7.org/linux/man-pages/man5/proc_pid_stat.5.html, field 22.
    """
    try:
        return int(Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[19])
    except (OSError, LookupError, ValueError):
        return 0
