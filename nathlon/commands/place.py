"""Where a command finds a run."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Place:
    """Where the committee's record is: the store, and the name of the run, or the last one."""

    store: str
    run: str | None
