"""Other processes of this machine."""

from __future__ import annotations

import os
import shlex
import socket
import sys
import zlib
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple


def _namespace() -> str:
    """What tells containers apart that have the same host's name: each counts its processes anew."""
    with suppress(OSError):
        return os.readlink("/proc/self/ns/pid")
    return ""


HOST = socket.gethostname()
PLACE = f"{HOST}{_namespace()}"
"""Where the numbers of processes hold."""
MACHINE = f"{zlib.crc32(PLACE.encode()):08x}"
OWNER = r"[0-9a-f]{8}\.[0-9]+\.[1-9][0-9]*"
"""Pattern of what `owner` gives."""


def command_of(module: str, *arguments: object) -> list[str]:
    """Runs a module in this interpreter, where nothing is imported from the current folder."""
    return [sys.executable, "-P", "-m", module, *map(str, arguments)]


def typed(*words: object) -> str:
    """A command of nathlon as somebody types it into a shell, to be printed as a hint."""
    return shlex.join(["nathlon", *map(str, words)])


def has_ended(process: int) -> bool:
    """Whether no process of this machine has this number; False where that cannot be told.

    One that has ended and that its parent has not asked after does nothing any more: it counts as ended.
    """
    if os.name != "posix":
        return False
    if _stat(process)[:1] in (["Z"], ["X"]):
        return True
    try:
        os.kill(process, 0)
    except (ProcessLookupError, OverflowError):
        return True
    except PermissionError:
        pass
    return False


def owner() -> str:
    """This process, for the names of what it would leave if it were killed.

    Its machine, when it started, and its number: a number is given again, to another process.
    """
    process = os.getpid()
    return f"{MACHINE}.{start_of(process)}.{process}"


def owner_has_ended(name: str) -> bool:
    """Whether the process is gone that `owner` has named so; False for one of another machine."""
    machine, start, process = name.split(".")
    if machine != MACHINE:
        return False
    return has_ended(int(process)) or start_of(int(process)) not in (int(start), 0)


class Scheduled(NamedTuple):
    """What a process has had of the processors.

    Attributes:
        ran_s: for which its main thread ran, s.
        queued_s: for which that could have run and had to wait, as others did, s.
    """

    ran_s: float
    queued_s: float


def scheduled(process: int) -> Scheduled | None:
    """What a process of this machine has had of the processors; None where the system does not tell.

    See https://docs.kernel.org/scheduler/sched-stats.html, `/proc/<pid>/schedstat`.
    """
    try:
        ran_ns, queued_ns, _ = Path(f"/proc/{process}/schedstat").read_text().split()
        return Scheduled(int(ran_ns) / 1e9, int(queued_ns) / 1e9)
    except (OSError, ValueError):
        return None


def start_of(process: int) -> int:
    """When a process of this machine started, in clock ticks since the machine did; 0 where it does not tell.

    Together with its number this is its alone, whatever is done to the clock. See
    https://man7.org/linux/man-pages/man5/proc_pid_stat.5.html, field 22.
    """
    try:
        return int(_stat(process)[19])
    except (LookupError, ValueError):
        return 0


def _stat(process: int) -> list[str]:
    """What the system tells of a process, from its state on; nothing where it does not tell."""
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return []
