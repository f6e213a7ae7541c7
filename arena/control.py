"""What people have said of the work on a store: that it pauses, and which matches go first.

It is in the store's log, so that every machine heeds it and everybody can see who said it.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from typing import Any

from nathlon.arena.store import Store

KIND = "control"
"""Of the log's entries."""


@dataclass(frozen=True)
class Control:
    """How work goes on.

    Attributes:
        paused: whether nobody begins a match; those under way end.
        first: digest of the surroundings whose matches go before others; None where they go as they came.
        by: who said so; '' where nobody has said anything.
        at: when, UTC, ISO 8601; None likewise.
    """

    paused: bool = False
    first: str | None = None
    by: str = ""
    at: str | None = None


def control(store: Store) -> Control:
    """What was said last."""
    said = store.last_of(KIND)
    return Control() if said is None else Control(**said.entry, at=said.at)


def steer(store: Store, by: str, **changed: Any) -> Control:
    """Say how work goes on, in the name of somebody.

    Args:
        store: whose work it is.
        by: who says so.
        **changed: `paused` or `first`, as of `Control`; what is not given stays as it is.
    """
    said = replace(control(store), by=by, **changed)
    entry = asdict(said)
    del entry["at"]
    return replace(said, at=store.append(KIND, entry).at)
