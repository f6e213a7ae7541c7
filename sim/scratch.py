"""Temporary folders of this process: those that a killed one has left are removed by the next."""

from __future__ import annotations

import re
import shutil
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory, gettempdir

from nathlon.sim.process import OWNER, owner, owner_has_ended

LEFT = re.compile(rf"nathlon-({OWNER})-.*")


def scratch_folder() -> TemporaryDirectory[str]:
    """A folder that goes with the object that is given, or with this process."""
    _sweep(gettempdir())
    return TemporaryDirectory(prefix=f"nathlon-{owner()}-", ignore_cleanup_errors=True)


@cache
def _sweep(place: str) -> None:
    """Remove folders of processes that are gone, before this process makes its first one there."""
    for folder in Path(place).glob("nathlon-*"):
        found = LEFT.fullmatch(folder.name)
        if found and owner_has_ended(found[1]):
            shutil.rmtree(folder, ignore_errors=True)
