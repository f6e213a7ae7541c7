"""Files that are written whole or not at all."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """A path beside `path` to write to; at the end of the block what is there takes the place of `path`.

    Whoever reads `path` finds what was there before or what is there after, never a part. After an exception
    it is as it was, and nothing is left beside it. Processes that write the same file at once do not disturb
    each other: it is that of the last one to finish.

    Raises:
        OSError: if it cannot take its place.
    """
    partial = path.with_name(f".{path.name}.{os.getpid()}.partial")
    try:
        yield partial
        os.replace(partial, path)
    finally:
        partial.unlink(missing_ok=True)
