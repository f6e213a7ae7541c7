"""The best of the nights before, wherever their files lie by now: contents make a policy, not paths."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path

from nathlon.arena.entrance import intact
from nathlon.arena.entrant import Entrant
from nathlon.arena.pool import Pool
from nathlon.policies.sources.identity import is_still
from nathlon.selection.nightly.watching import Watched
from nathlon.selection.publish.sent import kept_copies
from nathlon.sim.names import printable

SHOWN = 3
"""Names in a sentence on those that are gone."""


def incumbents(
    pool: Pool, best: Iterable[Entrant], count: int, watched: Watched, nights: Path
) -> tuple[list[Entrant], tuple[str, ...]]:
    """The first `count` of the best whose files are anywhere, and what is to be said of those before them.

    Args:
        pool: opens them.
        best: of the nights before, the best first.
        count: how many, at most.
        watched: where to look for a file that is not where it was.
        nights: folder of all nights, which keep what they have sent.
    """
    there: list[Entrant] = []
    gone: list[Entrant] = []
    for entrant in best:
        if len(there) == count:
            break
        found = located(entrant, watched, nights)
        if found is not None and intact(pool, [found]) == [True]:
            there.append(found)
        else:
            gone.append(entrant)
    return there, _told(gone)


def located(entrant: Entrant, watched: Watched, nights: Path) -> Entrant | None:
    """An entrant with the place where its contents lie now; None where nobody has them.

    They are looked for where they were, among what is watched, and in what nights have sent.
    """
    same = watched.sources(entrant.id)
    if is_still(entrant.source, entrant.id):
        places = [entrant.source]
    else:
        places = same or kept_copies(nights, entrant)
    if not places:
        return None
    others = tuple(printable(source) for source in same if source != places[0])
    return replace(entrant, source=places[0], also=others)


def _told(gone: Sequence[Entrant]) -> tuple[str, ...]:
    if not gone:
        return ()
    listed = [f"{entrant.name} ({entrant.source})" for entrant in gone[:SHOWN]]
    more = len(gone) - len(listed)
    shown = ", ".join(listed) + (f" and {more} more" if more > 0 else "")
    return (f"Missing among the best of the nights before: {shown}. No watched file has the same contents.",)
