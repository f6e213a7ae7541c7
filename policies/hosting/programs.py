"""Programs that this process starts."""

from __future__ import annotations

import os
import signal
import subprocess
from collections.abc import Sequence
from contextlib import suppress
from typing import Any

Program = subprocess.Popen[bytes]


def start(command: Sequence[str], **options: Any) -> Program:
    """Start a program in a session of its own, so that `end` ends what it starts as well.

    Args:
        command: program and arguments.
        options: as of `subprocess.Popen`.

    Raises:
        OSError: if it cannot be started.
    """
    return subprocess.Popen(command, start_new_session=True, **options)


def end(process: Program) -> None:
    """End a program that `start` has started."""
    end_group(process.pid)
    process.wait()


def end_group(process: int) -> None:
    """End the process that is the first of its group, and all others of that; nothing if there is none."""
    if os.name == "posix":
        with suppress(ProcessLookupError):
            os.killpg(process, signal.SIGKILL)


def complaint(command: Sequence[str], otherwise: str) -> str:
    """Run a program to its end: the last line that it has written to stderr if it failed, and '' if not.

    Args:
        command: program and arguments.
        otherwise: what is said of one that fails without a word.

    Raises:
        OSError: if it cannot be started.
    """
    done = subprocess.run(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, check=False)
    return (done.stderr.strip().splitlines() or [otherwise])[-1] if done.returncode else ""
