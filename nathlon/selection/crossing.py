"""Policies and strategies of entrants: what a composite is made of."""

from __future__ import annotations

from collections.abc import Container, Sequence
from pathlib import Path

from nathlon.arena.entrant import Entrant
from nathlon.arena.naming import stem
from nathlon.policies.sources import COMPOSITE, ROLES
from nathlon.policies.sources.composite import CompositeFile, CompositeSource
from nathlon.policies.sources.identity import policy_id
from nathlon.tournament.two_way import CrossedEntrant

NO_STRATEGY = CompositeFile.model_construct(part=()).strategy_label


def cells(entrants: Sequence[Entrant], references: Container[str] = ()) -> dict[str, CrossedEntrant]:
    """Policy and strategy of the entrants, by id.

    Policies go by the names of their files; where two of these are alike, by the beginning of their ids too.

    Args:
        entrants: who races.
        references: ids of those that are no candidates, and are left out.
    """
    known = {e.id: _parts(e) for e in entrants if e.id not in references}
    names: dict[str, set[str]] = {}
    for policy, name, _ in known.values():
        names.setdefault(name, set()).add(policy)
    return {
        entrant: CrossedEntrant(name if len(names[name]) == 1 else f"{name}-{policy[:6]}", strategy)
        for entrant, (policy, name, strategy) in known.items()
    }


def _parts(entrant: Entrant) -> tuple[str, str, str]:
    """Id and name of an entrant's policy, and its strategy."""
    source = entrant.source
    if not source.endswith(COMPOSITE) or source.endswith(ROLES):
        return entrant.id, stem(source), NO_STRATEGY
    composite = CompositeSource.read(Path(source))
    if len(composite.file.part) > 1:
        plain = composite.file.model_copy(update={"stint": (), "planner": None, "strategist": None})
        ids = [policy_id(part) for part in composite.sources]
        policy = CompositeSource(composite.path, plain).identity(ids)
        return policy, composite.file.name, composite.file.strategy_label
    [source] = composite.sources
    return policy_id(source), stem(source), composite.file.strategy_label
