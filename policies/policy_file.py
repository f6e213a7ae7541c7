"""The file that holds a policy: opened without trust, read once, known by its bytes.

Everything that is said of a policy, its id and what it does, comes from one reading, so that a file that
changes meanwhile cannot give the name of one policy to another.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

from nathlon.policies.memory_limit import OutOfMemoryError
from nathlon.sim.errors import InputError
from nathlon.sim.untrusted_file import open_regular

MOST_BYTES = 1 << 29
"""Size of a file, and of all that is packed in it."""

POINTER = b"version https://git-lfs.github.com/spec/"
"""How the pointer begins that stands for a file which git-lfs has not fetched; see
https://github.com/git-lfs/git-lfs/blob/main/docs/spec.md."""

_LONGEST_REASON = 300


def read_policy_file(path: Path) -> bytes:
    """The bytes of a file.

    Raises:
        InputError: if it is no regular file, cannot be read, is empty, has more than `MOST_BYTES` or is a
            pointer of git-lfs.
    """
    with opening(path), open_policy_file(path) as (file, size):
        content = file.read(size + 1)
    if len(content) != size:
        raise InputError(f"{path}: changed while it was read")
    return content


@contextmanager
def open_policy_file(path: Path) -> Iterator[tuple[BinaryIO, int]]:
    """A file and its size in bytes, to read no more of it than is needed.

    Raises:
        InputError: as `read_policy_file`.
    """
    with open_regular(path, "policy") as file:
        found = os.fstat(file.fileno())
        if found.st_size == 0:
            raise InputError(f"{path}: the file is empty, expected a policy")
        if found.st_size > MOST_BYTES:
            raise InputError(f"{path}: has {found.st_size} bytes, expected at most {MOST_BYTES}")
        try:
            if file.read(len(POINTER)) == POINTER:
                raise InputError(f"{path}: git-lfs pointer, expected a policy: run git lfs pull")
            file.seek(0)
            yield file, found.st_size
        except OSError as error:
            raise InputError(f"{path}: cannot be read ({error.strerror})") from None


def content_id(content: bytes) -> str:
    """SHA-256 of a file's bytes, in hexadecimal: the name of a policy wherever it lies."""
    return hashlib.sha256(content).hexdigest()


@contextmanager
def opening(path: Path) -> Iterator[None]:
    """Has whatever the block says of the file at `path` fit on one line of a terminal.

    Raises:
        InputError: as the block does, what it quotes from the file cut and freed of control characters; and
            if the stack runs out.
        OutOfMemoryError: if the memory does.
    """
    try:
        yield
    except MemoryError:
        raise OutOfMemoryError(f"{path}: needs more memory than opening a policy may take") from None
    except RecursionError:
        raise InputError(f"{path}: nested too deeply, expected a policy") from None
    except InputError as error:
        before, found, reason = str(error).partition(f"{path}: ")
        if before or not found:
            raise
        raise InputError(f"{path}: {_legible(reason)}") from None


def _legible(reason: str) -> str:
    if len(reason) > _LONGEST_REASON:
        half = _LONGEST_REASON // 2
        reason = f"{reason[:half]} ... {reason[-half:]}"
    return " ".join("".join(c if c.isprintable() else " " for c in reason).split())
