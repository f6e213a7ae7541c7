"""What the processes print in which foreign policies run: into a bounded log, never into our own output."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

LOG_BYTES = 1 << 20
"""Of a log; what is printed beyond it is dropped."""
DROPPED = b"\n[what was printed after this was dropped]\n"
_CHUNK = 1 << 16
_REST_S = 1.0


class OutputLog:
    """A pipe that processes print into, and as much of it as is kept.

    Attributes:
        sink: the end to write to, a connection that can be passed to a process.
    """

    def __init__(self, make_pipe: Callable[[], tuple[Any, Any]]) -> None:
        """An empty log; `make_pipe` gives the reading and the writing end of a pipe."""
        self._source, self.sink = make_pipe()
        self._kept = bytearray()
        self._path: Path | None = None
        self._lock = threading.Lock()
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def keep_in(self, path: Path) -> None:
        """Have a file hold what is printed, after what it holds already; none is made while there is nothing.

        Raises:
            OSError: if it cannot be written.
        """
        with self._lock:
            self._path = path
            before = path.read_bytes()[:LOG_BYTES] if path.is_file() else b""
            printed, self._kept = bytes(self._kept), bytearray(before)
            self._add(printed)

    @property
    def text(self) -> str:
        """What has been printed, as far as it is kept."""
        with self._lock:
            return self._kept.decode("utf-8", "replace")

    def add(self, text: str) -> None:
        """Add what was printed on another machine."""
        with self._lock:
            self._add(text.encode())

    def close(self) -> None:
        """Read the rest; what processes print that those of ours have left behind is not waited for."""
        self.sink.close()
        self._reader.join(_REST_S)

    def _read(self) -> None:
        while chunk := os.read(self._source.fileno(), _CHUNK):
            with self._lock:
                self._add(chunk)

    def _add(self, printed: bytes) -> None:
        room = LOG_BYTES - len(self._kept)
        if room <= 0 or not printed:
            return
        added = printed if len(printed) <= room else printed[:room] + DROPPED
        self._kept += added
        if self._path is not None:
            with self._path.open("ab") as file:
                file.write(added)


def print_into(sink: Any) -> None:
    """Have all that this process prints from now on, by whatever means, go to a log's `sink`."""
    for stream in (1, 2):
        os.dup2(sink.fileno(), stream)
    sink.close()
