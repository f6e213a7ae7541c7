"""What becomes of old nights' folders: their results stay in the store, which makes a report again."""

from __future__ import annotations

import logging
import os
import shutil
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

from nathlon.arena.store import RunRecord, Store
from nathlon.selection.publish.output import POLICY_LOG, RACES, REPLAYS, REPORT, SUMMARY
from nathlon.selection.run import DONE

log = logging.getLogger(__name__)

GOES = (REPORT, RACES, REPLAYS, POLICY_LOG)
"""What does not stay in the folder of an old night. What was sent may be needed for ever, people's drives
cannot be driven again, and what others have put there is theirs."""


def thin_out(store: Store, nights: list[RunRecord], out: Path, days: int, now: datetime) -> list[Path]:
    """Remove reports, recordings and replays of nights that ended long ago; the folders that were thinned.

    The last night keeps everything, and so does one that nobody has been told of yet. What cannot be removed
    stays and is warned of.

    Args:
        store: that has the nights.
        nights: all of them, in order.
        out: folder of their folders.
        days: for which they keep everything.
        now: UTC.
    """
    outcomes: Any = store.fact_of_runs("outcome")
    before = (now - timedelta(days=days)).isoformat()
    thinned = []
    for night in nights[:-1]:
        told = (outcomes.get(night.name) or {}).get("told", True)
        ended = night.status == DONE and told and night.ended_at is not None and night.ended_at < before
        folder = out / night.name
        if ended and not folder.is_symlink() and (folder / SUMMARY).is_file() and _thin(folder):
            thinned.append(folder)
    return thinned


def _thin(folder: Path) -> bool:
    """Remove what goes; whether there was anything that could be removed."""
    removed = False
    for path in (folder / name for name in GOES):
        if not os.path.lexists(path):
            continue
        try:
            if path.is_dir() and not path.is_symlink():
                shutil.rmtree(path)
            else:
                path.unlink()
            removed = True
        except OSError as error:
            log.warning("%s: cannot be removed: %s", path, error.strerror)
    return removed
