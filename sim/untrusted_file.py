"""Files that users name, opened without trust: regular ones only, and no larger than they can sensibly be."""

from __future__ import annotations

import os
import stat
from pathlib import Path
from typing import BinaryIO

from nathlon.sim.errors import InputError

TEXT_MIB = 1
"""The most that a text file may hold, unless more is allowed: ten times the largest that is shipped."""


def open_regular(path: Path, what: str = "file") -> BinaryIO:
    """Open a file for reading its bytes; anything but a regular file is refused, and never waited for.

    Args:
        path: the file.
        what: what it is, for the error: `car file`.

    Raises:
        InputError: if it cannot be opened, or is a folder, a pipe, a device or a socket.
    """
    try:
        # A pipe would be waited for until somebody writes to it.
        descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
    except OSError as error:
        raise InputError(f"{path}: cannot read the {what}: {error.strerror}") from None
    except ValueError:
        raise InputError(f"{path}: cannot read the {what}: a name has no zero byte") from None
    mode = os.fstat(descriptor).st_mode
    if not stat.S_ISREG(mode):
        os.close(descriptor)
        found = "Is a directory" if stat.S_ISDIR(mode) else "a pipe or a device, expected a file"
        raise InputError(f"{path}: cannot read the {what}: {found}")
    return open(descriptor, "rb")


def read_bytes(path: Path, most_mib: int, what: str = "file") -> bytes:
    """The contents of a file.

    Args:
        path: the file.
        most_mib: the most that it may hold, MiB.
        what: what it is, for the error.

    Raises:
        InputError: if it cannot be read, is no regular file, or is larger.
    """
    with open_regular(path, what) as file:
        try:
            # Asked for one byte more than there may be: sizes that the system tells can be wrong.
            content = file.read((most_mib << 20) + 1)
        except OSError as error:
            raise InputError(f"{path}: cannot read the {what}: {error.strerror}") from None
    if len(content) > most_mib << 20:
        raise InputError(f"{path}: cannot read the {what}: larger than {most_mib:,} MiB")
    return content


def read_text(path: Path, what: str = "file", most_mib: int = TEXT_MIB) -> str:
    """The text of a UTF-8 file, without a byte order mark.

    Args:
        path: the file.
        what: what it is, for the error.
        most_mib: the most that it may hold, MiB.

    Raises:
        InputError: if it cannot be read, is no regular file, is larger, or is not UTF-8.
    """
    try:
        return read_bytes(path, most_mib, what).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: cannot read the {what}: byte {error.start} is not UTF-8") from None
