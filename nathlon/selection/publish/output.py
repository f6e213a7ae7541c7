"""The folder that a selection leaves."""

from __future__ import annotations

import errno
import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from nathlon.sim.errors import InputError

NO_ROOM = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EROFS, errno.EACCES)
"""What a disk says that takes no more."""


SUMMARY = "summary.json"
REPORT, RACES, REPLAYS = "report", "races", "replays"
"""Folders of a run: its page and tables; recordings; what plays them."""
POLICY_LOG = "policies.log"
"""What policies print that are code, beside the report's folder."""


class OutputFolder:
    """Where each part of a run goes."""

    def __init__(self, root: Path, store: str | None = None) -> None:
        """Make the folder and those in it.

        Args:
            root: the folder.
            store: that of the run, path or URL; a file in the folder by default.

        Raises:
            InputError: if it cannot be written.
        """
        self.root = root
        self.report, self.races, self.replays = root / REPORT, root / RACES, root / REPLAYS
        self.store: Path | str = store or root / "store.sqlite"
        try:
            for folder in (self.report, self.races, self.replays):
                folder.mkdir(parents=True, exist_ok=True)
            with tempfile.NamedTemporaryFile(dir=root):
                pass
        except OSError as error:
            raise InputError(f"{root}: output folder cannot be written: {error.strerror}") from None

    def named(self, store: str) -> str:
        """A store as commands are told of it that are typed in this folder: a URL, or a path from here."""
        return store if "://" in store else os.path.relpath(store, self.root)

    @contextmanager
    def filling(self) -> Iterator[None]:
        """While something is written into it; an InputError says so if there is no room."""
        try:
            yield
        except OSError as error:
            if error.errno not in NO_ROOM:
                raise
            raise InputError(
                f"{self.root}: cannot be written: {error.strerror}; expected room for a report"
            ) from None
