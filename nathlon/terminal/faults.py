"""Faults of nathlon itself: their traceback goes into a file, to be reported with it."""

from __future__ import annotations

import sys
from datetime import UTC, datetime
from tempfile import NamedTemporaryFile
from traceback import format_exception

FAULT = 70
"""Exit code, as of EX_SOFTWARE in sysexits.h: no code of a verdict."""


def note_fault(error: BaseException) -> str:
    """Write the traceback of an unexpected error into a file of its own; a sentence that names it."""
    told = f"{type(error).__name__} {error}".strip().partition("\n")[0]
    command = " ".join(sys.argv)
    traceback = f"{datetime.now(UTC):%Y-%m-%d %H:%M:%S} UTC\n{command!a}\n{''.join(format_exception(error))}"
    try:
        with NamedTemporaryFile(
            "w", prefix="nathlon-fault-", suffix=".log", delete=False, errors="backslashreplace"
        ) as log:
            log.write(traceback)
    except OSError:
        return f"a fault of nathlon itself ({told}); its traceback cannot be written:\n{traceback}"
    return f"a fault of nathlon itself ({told}): please report it with {log.name}"
