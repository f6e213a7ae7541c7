"""The event log: all that is ever said in a committee, append-only. Its decisions are a fold over them."""

from __future__ import annotations

from collections.abc import Iterable

from nathlon.arena.store import Store
from nathlon.selection.committee.decision import CommitteeDecision
from nathlon.selection.committee.events import EVENT, Entry, Event, Opened
from nathlon.selection.committee.rules import Question

LOG = "committee"
"""The kind of its entries in the store's log."""


class EventLog:
    """The event log of a run; entries are added and never changed."""

    def __init__(self, store: Store, run: str) -> None:
        self._store, self._run = store, run

    def add(self, event: Event) -> None:
        """Add an entry, whoever else may be adding one."""
        self._store.append(LOG, event.model_dump(mode="json"), self._run)

    def entries(self) -> list[Entry]:
        """All entries in their order."""
        return [
            Entry(entry.id, entry.at, EVENT.validate_python(entry.entry))
            for entry in self._store.log(LOG, self._run)
        ]

    def decisions(self) -> dict[Question, CommitteeDecision]:
        """The last decision on each question; one on other evidence takes the place of the one before."""
        return fold(self.entries())


def fold(entries: Iterable[Entry]) -> dict[Question, CommitteeDecision]:
    """The last decision on each question, after all entries."""
    decisions: dict[Question, CommitteeDecision] = {}
    for entry in entries:
        if isinstance(entry.event, Opened):
            current = decisions.get(entry.event.question)
            if current is None or current.opened != entry.event:
                decisions[entry.event.question] = CommitteeDecision(entry.event)
        else:
            for decision in decisions.values():
                decision.apply(entry)
    return decisions
