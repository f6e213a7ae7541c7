"""Files that are written whole or not at all."""

from __future__ import annotations

import os
import re
import tempfile
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from nathlon.sim.errors import InputError
from nathlon.sim.process import OWNER, owner, owner_has_ended

PARTIAL = re.compile(rf"\..*\.({OWNER})\.partial", re.DOTALL)

_swept: set[Path] = set()
_sweeping = threading.Lock()


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """A path beside `path` to write to; at the end of the block what is there takes the place of `path`.

    Whoever reads `path` finds what was there before or what is there after, never a part. After an exception
    it is as it was, and nothing is left beside it. Processes that write the same file at once do not disturb
    each other: it is that of the last one to finish. What a process that was killed has left in the folder is
    removed by the next one that writes there.

    Raises:
        OSError: if it cannot take its place.
    """
    _sweep(path.parent)
    partial = path.with_name(f".{path.name}.{owner()}.partial")
    try:
        yield partial
        os.replace(partial, path)
    finally:
        partial.unlink(missing_ok=True)


def write_whole(path: Path, content: str | bytes) -> None:
    """Replace a file by a text, in UTF-8, or bytes; see `whole_file`.

    Raises:
        OSError: if it cannot take its place.
    """
    with whole_file(path) as partial:
        partial.write_bytes(content.encode() if isinstance(content, str) else content)


@contextmanager
def writing(path: Path, what: str = "") -> Iterator[None]:
    """While something is written to a path, the circuit, say, or the map.

    Raises:
        InputError: instead of an OSError, naming the path.
    """
    try:
        yield
    except OSError as error:
        said = f"the {what} cannot" if what else "cannot"
        raise InputError(f"{path}: {said} be written: {error.strerror or error}") from None


def check_output(path: Path, is_file: bool = False) -> None:
    """Make sure, before the work for it begins, that output can be written; nothing is left of the attempt.

    Args:
        path: a folder, which will be made if it is not there, or a file in a folder that is there.
        is_file: whether it is a file.

    Raises:
        InputError: if nothing can be written there.
    """
    with writing(path):
        if is_file and path.is_dir():
            raise InputError(f"{path}: is a folder, expected a file to write")
        folders = [path.parent] if is_file else [path, *path.absolute().parents]
        with tempfile.TemporaryFile(dir=next(filter(os.path.lexists, folders), folders[0])):
            pass


def _sweep(folder: Path) -> None:
    """Remove partial files of processes that are gone, before this process makes its first one there."""
    with _sweeping, suppress(OSError):
        place = folder.resolve()
        if place in _swept:
            return
        _swept.add(place)
        for file in place.iterdir():
            found = PARTIAL.fullmatch(file.name)
            if found and owner_has_ended(found[1]):
                file.unlink(missing_ok=True)
