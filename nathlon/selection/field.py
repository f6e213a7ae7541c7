"""Who stands at the start of a night: the checkpoints in the watched folders that no night has judged."""

from __future__ import annotations

from collections.abc import Container, Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from nathlon.arena.entrance import enter_each
from nathlon.arena.entrant import Entrant
from nathlon.arena.pool import Pool
from nathlon.arena.worlds.registry import RACING
from nathlon.policies.sources import PLUGIN
from nathlon.policies.sources.finding import checkpoints_below
from nathlon.policies.sources.identity import policy_id
from nathlon.sim.errors import InputError
from nathlon.sim.names import printable, proper_name


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
    """

    newcomers: tuple[Entrant, ...]
    incumbents: tuple[Entrant, ...] = ()
    anchors: tuple[Entrant, ...] = ()
    excluded: tuple[Exclusion, ...] = ()

    @property
    def entrants(self) -> list[Entrant]:
        """All of them, each once."""
        together = (*self.newcomers, *self.incumbents, *self.anchors)
        return list({entrant.id: entrant for entrant in together}.values())


def newcomers(
    pool: Pool,
    watched: Iterable[str],
    circuit: str,
    car: str,
    known: Mapping[str, str],
    refused: Container[str] = (),
    world: str = RACING,
) -> tuple[list[Entrant], list[Exclusion]]:
    """The entrants among the watched folders and files that are not known yet, and what is set aside.

    Files with the same contents are one entrant. Names are unique, also among those known.

    Args:
        pool: opens them.
        watched: folders, files and `plugin:NAME`.
        circuit, car: what they must be able to drive.
        known: names by entrant ids.
        refused: keys of what was set aside before.
        world: simulator in which they must be able to play.

    Raises:
        InputError: if a watched path does not exist.
    """
    found: dict[str, Entrant] = {}
    excluded: list[Exclusion] = []
    new = unjudged(watched, known, refused)
    for source, answer in zip(new, enter_each(pool, list(new), circuit, car, world), strict=True):
        if isinstance(answer, InputError):
            excluded.append(Exclusion(printable(source), str(answer), new[source]))
        elif answer.id not in known:
            found.setdefault(answer.id, answer)
    taken = set(known.values())
    named = []
    for entrant in found.values():
        name = entrant.name if entrant.name not in taken else f"{_folder(entrant)}/{entrant.name}"
        name = name if name not in taken else f"{name}-{entrant.id[:6]}"
        taken.add(name)
        named.append(replace(entrant, name=name))
    return named, excluded


def unjudged(
    watched: Iterable[str], known: Container[str], refused: Container[str] = ()
) -> dict[str, str | None]:
    """The watched files and plugins that are not known yet, unopened, and their ids; see `newcomers`.

    Raises:
        InputError: if a watched path does not exist.
    """
    digests = {source: _digest(source) for source in _sources(watched)}
    return {
        source: digest
        for source, digest in digests.items()
        if digest not in known and (digest or printable(source)) not in refused
    }


def _sources(watched: Iterable[str]) -> list[str]:
    sources: list[str] = []
    for source in watched:
        path = Path(source)
        if source.partition(":")[0] == PLUGIN:
            sources.append(source)
        elif not path.exists():
            raise InputError(f"{source}: no such file or folder, expected checkpoints to watch")
        else:
            sources += [str(found) for found in (checkpoints_below(path) if path.is_dir() else [path])]
    return sources


def _digest(source: str) -> str | None:
    try:
        return policy_id(source)
    except InputError:
        return None


def _folder(entrant: Entrant) -> str:
    return proper_name(Path(entrant.source).resolve().parent.name)
