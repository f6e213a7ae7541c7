"""Which of many new checkpoints are judged first: the newest of the training runs that promise most."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from nathlon.arena.store import RunRecord, Store
from nathlon.policies.sources import is_path
from nathlon.selection.field import EntryList

UNKNOWN = 1.0
"""Promise of a training run of which nothing was judged: one has to look before one can tell."""
OLDER = 0.5
"""Share of its promise that a run's next older checkpoint has."""
SETTLED_S = 10.0
"""A file that was changed more recently may still be written."""

Choice = Callable[[Sequence[str]], list[str]]
"""Which of some new sources are judged now, in their order."""


def training_run(source: str) -> str:
    """What the checkpoints of one training run have in common: their folder."""
    return str(Path(source).parent) if is_path(source) else source


@dataclass(frozen=True)
class Promising:
    """Chooses so many of the new sources.

    Attributes:
        most: that are judged together.
        promise: of training runs that were judged, from 0 to 1.
    """

    most: int
    promise: Mapping[str, float]

    def __call__(self, sources: Sequence[str]) -> list[str]:
        """See `Choice`. What is no file, or cannot be looked at, is as new as can be."""
        changed = {source: _changed(source) for source in sources}
        now = time.time()
        # Also one whose date is in the future, by another machine's clock: it would wait for that day.
        settled = [
            source for source in sources if abs(now - changed[source]) > SETTLED_S or not is_path(source)
        ]
        seen: Counter[str] = Counter()
        promise: dict[str, float] = {}
        for source in sorted(settled, key=lambda one: -changed[one]):
            run = training_run(source)
            promise[source] = self.promise.get(run, UNKNOWN) * OLDER ** seen[run]
            seen[run] += 1
        return sorted(settled, key=lambda one: (-promise[one], -changed[one]))[: self.most]


def promise_of_runs(store: Store, nights: Iterable[RunRecord]) -> dict[str, float]:
    """Of each training run the greatest probability that one of its checkpoints was on the filter's front."""
    found: dict[str, float] = {}
    for night in nights:
        front = store.table(night.name, "pareto").select("entrant", "nondominated_probability")
        probability = dict(front.iter_rows())
        for entrant in EntryList.from_plan(night.config).newcomers:
            run, own = training_run(entrant.source), probability.get(entrant.id) or 0.0
            found[run] = max(found.get(run, 0.0), own)
    return found


def _changed(source: str) -> float:
    try:
        return Path(source).stat().st_mtime
    except OSError:
        return time.time()
