"""Folders that one process at a time writes to."""

from __future__ import annotations

import errno
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from nathlon.sim.errors import InputError

if sys.platform != "win32":
    import fcntl

LOCK_FILE = ".lock"
NO_LOCKS = (errno.ENOLCK, errno.ENOTSUP, errno.EINVAL, errno.ENOSYS)
"""What file systems say that know no locks."""


@contextmanager
def sole_user(folder: Path) -> Iterator[None]:
    """While this process is the only one that writes to a folder, which is made if it is not there.

    The system lets go of the lock when the process ends, however it does. Where there are no locks nothing is
    refused: on Windows, and on some network drives.

    Raises:
        InputError: if another one is at work there, or the folder cannot be written.
    """
    is_new = not folder.exists()
    path = folder / LOCK_FILE
    try:
        folder.mkdir(parents=True, exist_ok=True)
        lock = _locked(path)
    except BlockingIOError:
        raise InputError(
            f"{folder}: another process is at work there, expected a folder of its own"
        ) from None
    except OSError as error:
        raise InputError(f"{folder}: cannot be written: {error.strerror}") from None
    try:
        yield
    finally:
        path.unlink(missing_ok=True)
        os.close(lock)
        if is_new:
            with suppress(OSError):  # what is not empty stays
                folder.rmdir()


def _locked(path: Path) -> int:
    """The descriptor of a file that is locked as long as it is open; BlockingIOError if another has it."""
    while True:
        lock = os.open(path, os.O_RDWR | os.O_CREAT, 0o644)
        try:
            if sys.platform != "win32":
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            # Whoever had the lock may have removed the file meanwhile.
            if path.exists() and path.stat().st_ino == os.fstat(lock).st_ino:
                return lock
        except OSError as error:
            if error.errno in NO_LOCKS:
                return lock
            os.close(lock)
            raise
        os.close(lock)
