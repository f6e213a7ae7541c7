"""Who stands at the start of a night: the checkpoints in the watched folders that no night has judged."""

from __future__ import annotations

import hashlib
from collections.abc import Container, Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from arena.entrant import Entrant, checkpoints_below, enter
from policies.plugin import PLUGIN
from sim.errors import InputError


@dataclass(frozen=True)
class Exclusion:
    """A file that is set aside, and why.

    Attributes:
        digest: SHA-256 of its bytes; None where it cannot be read.
    """

    source: str
    reason: str
    digest: str | None


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
    watched: Iterable[str],
    circuit: str,
    car: str,
    known: Mapping[str, str],
    refused: Container[str | None] = (),
) -> tuple[list[Entrant], list[Exclusion]]:
    """The entrants among the watched folders and files that are not known yet, and what is set aside.

    Files with the same contents are one entrant. Names are unique, also among those known.

    Args:
        watched: folders, files and `plugin:NAME`.
        circuit, car: what they must be able to drive.
        known: names by entrant ids.
        refused: digests of files that were set aside before.

    Raises:
        InputError: if a watched path does not exist.
    """
    found: dict[str, Entrant] = {}
    excluded: list[Exclusion] = []
    for source in _sources(watched):
        digest = _digest(source)
        if digest in known or digest in refused:
            continue
        try:
            entrant = enter(source, circuit, car)
        except InputError as error:
            excluded.append(Exclusion(source, str(error), digest))
            continue
        if entrant.id not in known:
            found.setdefault(entrant.id, entrant)
    taken = set(known.values())
    named = []
    for entrant in found.values():
        name = entrant.name if entrant.name not in taken else f"{_folder(entrant)}/{entrant.name}"
        name = name if name not in taken else f"{name}-{entrant.id[:6]}"
        taken.add(name)
        named.append(replace(entrant, name=name))
    return named, excluded


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
    """The id that a file of weights has, without reading what is in it; None for anything else."""
    try:
        with Path(source).open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError:
        return None


def _folder(entrant: Entrant) -> str:
    return Path(entrant.source).resolve().parent.name
