"""Standard output and standard error of a command: results are written or missed, remarks may get lost."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any, TextIO, cast

from nathlon.sim.errors import InputError


class Stream:
    """A standard stream that remembers what was said.

    Attributes:
        last: the last line that was written, or empty.
    """

    def __init__(self, stream: TextIO) -> None:
        self._stream, self.last = stream, ""

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)

    def write(self, text: str) -> int:
        """See `TextIO.write`."""
        self.last = text.rstrip().rpartition("\n")[2] or self.last
        with self._watched():
            self._stream.write(text)
        return len(text)

    def flush(self) -> None:
        """See `TextIO.flush`."""
        with self._watched():
            self._stream.flush()

    @contextmanager
    def _watched(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            # Python writes what is left once more as it ends.
            with suppress(OSError), _nowhere() as nowhere:
                os.dup2(nowhere.fileno(), self._stream.fileno())
            self.on_lost(error)

    def on_lost(self, error: OSError) -> None:
        """What was written is lost, and nobody misses it."""


class Results(Stream):
    """Standard output."""

    def __init__(self, stream: TextIO) -> None:
        super().__init__(stream)
        self._lost: InputError | None = None

    def flush(self) -> None:
        """See `TextIO.flush`.

        Raises:
            InputError: if something has been lost; also if whoever wrote it took no notice.
        """
        super().flush()
        lost, self._lost = self._lost, None
        if lost:
            raise lost

    def on_lost(self, error: OSError) -> None:
        """Raise InputError."""
        self._lost = InputError(
            f"standard output: cannot be written: {error.strerror}; expected room, and a reader that stays"
        )
        raise self._lost from None


@contextmanager
def standard_streams() -> Iterator[tuple[Results, Stream]]:
    """While `sys.stdout` and `sys.stderr` are watched: InputError where results cannot be written.

    Python has none where the shell has closed one. What is opened next, a store perhaps, would then get its
    number, and what others print there.
    """
    own = sys.stdout, sys.stderr
    results, remarks = Results(own[0] or _nowhere()), Stream(own[1] or _nowhere())
    sys.stdout, sys.stderr = cast(TextIO, results), cast(TextIO, remarks)
    try:
        yield results, remarks
    finally:
        sys.stdout, sys.stderr = own


def _nowhere() -> TextIO:
    return open(os.devnull, "w", encoding="utf-8")
