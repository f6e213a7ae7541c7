"""Who stands at the start of a night: the checkpoints in the watched folders that no night has judged."""

from __future__ import annotations

from collections.abc import Callable, Container, Mapping
from dataclasses import dataclass, replace
from typing import Any

from nathlon.arena.entrance import enter_each
from nathlon.arena.entrant import Entrant, named_apart
from nathlon.arena.naming import short_names
from nathlon.arena.pool import Pool, quietly
from nathlon.arena.worlds.registry import RACING
from nathlon.selection.watching import Watched
from nathlon.sim.errors import InputError
from nathlon.sim.names import printable


@dataclass(frozen=True)
class Exclusion:
    """A file or plugin that is set aside, and why.

    Attributes:
        digest: its id as far as it can be known without opening it; None where it cannot be read.
    """

    source: str
    reason: str
    digest: str | None

    @property
    def key(self) -> str:
        """By which it is known again as long as it has not changed."""
        return self.digest or self.source


@dataclass(frozen=True)
class Field:
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
    excluded: tuple[Exclusion, ...] = ()
    notes: tuple[str, ...] = ()

    @property
    def entrants(self) -> list[Entrant]:
        """All of them, each once."""
        together = (*self.newcomers, *self.incumbents, *self.anchors)
        return list({entrant.id: entrant for entrant in together}.values())

    @classmethod
    def from_plan(cls, plan: Mapping[str, Any]) -> Field:
        """The field of a night, from what its run was begun with."""
        stored = plan["field"]
        groups = {
            name: tuple(
                Entrant(**entrant | {"also": tuple(entrant.get("also", ()))}) for entrant in stored[name]
            )
            for name in ("newcomers", "incumbents", "anchors")
        }
        excluded = tuple(Exclusion(**item) for item in stored["excluded"])
        return cls(**groups, excluded=excluded, notes=tuple(stored.get("notes", ())))


def newcomers(
    pool: Pool,
    watched: Watched,
    circuit: str,
    car: str,
    known: Mapping[str, str],
    refused: Container[str] = (),
    world: str = RACING,
    on_opened: Callable[[int, int], None] = quietly,
) -> tuple[list[Entrant], list[Exclusion]]:
    """The entrants among what is watched that are not known yet, and what is set aside.

    Files with the same contents are one entrant, which knows them all. Names are unique, also among those
    known.

    Args:
        pool: opens them.
        watched: folders, files and plugins.
        circuit, car: what they must be able to drive.
        known: names by entrant ids.
        refused: keys of what was set aside before.
        world: simulator in which they must be able to play.
        on_opened: told how many have been opened, of how many.
    """
    found: dict[str, Entrant] = {}
    excluded: list[Exclusion] = []
    new = watched.unjudged(known, refused)
    for source, answer in zip(new, enter_each(pool, list(new), circuit, car, world, on_opened), strict=True):
        if isinstance(answer, InputError):
            excluded.append(Exclusion(printable(source), str(answer), new[source]))
        elif answer.id not in known:
            same = [printable(other) for other in watched.sources(answer.id) if other != source]
            found.setdefault(answer.id, replace(answer, also=tuple(same)))
    return named_apart(list(found.values()), short_names(watched.digests), set(known.values())), excluded
