"""Who takes part in a selection."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from nathlon.arena.entrant import Entrant
from nathlon.results.summary import SetAside
from nathlon.sim.names import printable

GONE = "is gone, has changed or cannot be opened any more since the selection began, so it was not judged"


@dataclass(frozen=True)
class EntryList:
    """Who takes part in a selection.

    Attributes:
        newcomers: who must survive the filter and be shortlisted.
        incumbents: the best of earlier nights, who go through every stage again to compare with.
        anchors: who race every night, so that nights compare, and are never sent.
        excluded: files that are set aside.
        notes: what else is to be said of the files, in sentences.
    """

    newcomers: tuple[Entrant, ...]
    incumbents: tuple[Entrant, ...] = ()
    anchors: tuple[Entrant, ...] = ()
    excluded: tuple[SetAside, ...] = ()
    notes: tuple[str, ...] = ()

    @property
    def entrants(self) -> list[Entrant]:
        """All of them, each once."""
        together = (*self.newcomers, *self.incumbents, *self.anchors)
        return list({entrant.id: entrant for entrant in together}.values())

    def without(self, gone: Mapping[str, Entrant]) -> EntryList:
        """The field with those set aside, by id, that could not be opened any more to be judged."""
        newcomers, incumbents, anchors = (
            tuple(entrant for entrant in group if entrant.id not in gone)
            for group in (self.newcomers, self.incumbents, self.anchors)
        )
        excluded = (SetAside(printable(each.source), GONE, each.id) for each in gone.values())
        return EntryList(newcomers, incumbents, anchors, (*self.excluded, *excluded), self.notes)

    @classmethod
    def from_plan(cls, plan: Mapping[str, Any]) -> EntryList:
        """The field of a night, from what its run was begun with."""
        stored = plan["field"]
        groups = {
            name: tuple(
                Entrant(**entrant | {"also": tuple(entrant.get("also", ()))}) for entrant in stored[name]
            )
            for name in ("newcomers", "incumbents", "anchors")
        }
        excluded = tuple(SetAside(**item) for item in stored["excluded"])
        return cls(**groups, excluded=excluded, notes=tuple(stored.get("notes", ())))
