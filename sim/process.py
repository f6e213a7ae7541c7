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


def started_at(process: int) -> float | None:
    """When a process of this machine started, s since 1970, to a second; None where that cannot be told.

    See https://man7.org/linux/man-pages/man5/proc_pid_stat.5.html, field 22.
    """
    try:
        ticks = int(Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[19])
        facts = dict(line.split(maxsplit=1) for line in Path("/proc/stat").read_text().splitlines())
        return int(facts["btime"]) + ticks / os.sysconf("SC_CLK_TCK")
    except (OSError, LookupError, ValueError):
        return None
