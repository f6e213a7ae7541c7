"""Who stands at the start of a night: the checkpoints in the watched folders that no night has judged."""

from __future__ import annotations

from collections.abc import Callable, Container, Mapping
from dataclasses import replace

from nathlon.arena.entrance import enter_each
from nathlon.arena.entrant import Entrant, named_apart
from nathlon.arena.naming import short_names
from nathlon.arena.pool import Pool, quietly
from nathlon.arena.world_finding import RACING
from nathlon.results.summary import SetAside
from nathlon.selection.nightly.promise import Choice
from nathlon.selection.nightly.watching import Watched
from nathlon.sim.errors import InputError
from nathlon.sim.names import printable


def newcomers(
    pool: Pool,
    watched: Watched,
    circuit: str,
    car: str,
    known: Mapping[str, str],
    refused: Container[str] = (),
    world: str = RACING,
    on_opened: Callable[[int, int], None] = quietly,
    choose: Choice = list,
) -> tuple[list[Entrant], list[SetAside]]:
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
        choose: which of those that are new are looked at; all by default.
    """
    found: dict[str, Entrant] = {}
    excluded: list[SetAside] = []
    unjudged = watched.unjudged(known, refused)
    new = {source: unjudged[source] for source in choose(list(unjudged))}
    for source, answer in zip(new, enter_each(pool, list(new), circuit, car, world, on_opened), strict=True):
        if isinstance(answer, InputError):
            excluded.append(SetAside(printable(source), str(answer), new[source]))
        elif answer.id not in known:
            same = [printable(other) for other in watched.sources(answer.id) if other != source]
            found.setdefault(answer.id, replace(answer, also=tuple(same)))
    short = short_names(watched.digests) if found else {}
    return named_apart(list(found.values()), short, set(known.values())), excluded
