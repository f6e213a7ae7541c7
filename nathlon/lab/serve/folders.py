"""Where the files of a store's runs are, and which of them are shown."""

from __future__ import annotations

from pathlib import Path
from urllib.parse import unquote

from nathlon.arena.store import Store
from nathlon.selection.publish.output import POLICY_LOG, RACES, REPLAYS, REPORT

NIGHTS = "nights"
"""Where nights leave their folders if they are not told."""
KINDS = {
    ".html": "text/html; charset=utf-8",
    ".xlsx": "application/vnd.openxmlformats-officedocument.spreadsheetml.sheet",
    ".csv": "text/csv; charset=utf-8",
    ".parquet": "application/octet-stream",
    ".mcap": "application/octet-stream",
    ".rrd": "application/octet-stream",
    ".webm": "video/webm",
    ".log": "text/plain; charset=utf-8",
}
"""Files that are shown, by their endings."""
SHOWN = ((REPORT,), (RACES,), (REPLAYS,), ("drives", RACES))
"""Folders of a run with such files."""


class Folders:
    """The folders of runs.

    Args:
        store: path or URL.
        out: folder of the folders of the runs, or that of the last run; that of the store by default.
    """

    def __init__(self, store: str, out: Path | None) -> None:
        self._out = out if out is not None or "://" in store else Path(store).parent

    def of(self, runs: list[str], run: str) -> Path | None:
        """The folder of a run; None where there is none.

        Args:
            runs: names of all, in their order.
            run: one of them.
        """
        if self._out is None:
            return None
        places = [self._out / run, self._out / NIGHTS / run]
        if run == runs[-1]:
            places.append(self._out)
        return next((place for place in places if (place / REPORT).is_dir()), None)


def runs_of(store: Store) -> list[str]:
    """Names of all runs, in their order."""
    return [record.name for record in store.runs()]


def shown_file(folder: Path, parts: list[str]) -> tuple[Path, str] | None:
    """A file of a run's folder and its kind; None if there is none that is shown.

    Args:
        folder: of the run.
        parts: of the path from there, as they stand in an address.
    """
    names = [unquote(part) for part in parts]
    if any(name in ("", ".", "..") or set(name) & set("/\\\0") for name in names):
        return None
    if tuple(names) != (POLICY_LOG,) and not any(tuple(names[: len(begin)]) == begin for begin in SHOWN):
        return None
    path = folder.joinpath(*names)
    kind = KINDS.get(path.suffix)
    try:
        # A link may lead out of the folder.
        shown = kind and path.is_file() and path.resolve().is_relative_to(folder.resolve())
    except OSError:
        # No file can have this name.
        return None
    return (path, kind) if kind and shown else None
