"""What policies need that are raced elsewhere: their files, known by the SHA-256 of their contents."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Set
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol

from nathlon.arena.match import Match
from nathlon.policies.sources import COMPOSITE, DRIVER, MPPI, OBJECT, PLUGIN, RANDOM, SUFFIXES, suffix_of
from nathlon.policies.sources.normalisation import companions
from nathlon.policies.sources.planned import PlannedSource
from nathlon.sim.errors import InputError
from nathlon.sim.scratch import scratch_folder
from nathlon.sim.whole_file import write_whole


def labels(match: Match, shared: bool) -> list[str] | None:
    """What to write on a match's policies so that they are found elsewhere; None where one stays here.

    A driver and a plugin go by name. A file goes by its path on this machine, and to others by its contents:
    its label is its suffix then, for its id is their digest.

    Args:
        match: the match.
        shared: whether it may be run on another machine.
    """
    written = [_label(source, shared) for source in match.sources]
    return None if None in written else [label for label in written if label is not None]


def _label(source: str, shared: bool) -> str | None:
    kind = source.partition(":")[0]
    if kind in (DRIVER, PLUGIN) or source == RANDOM:
        return source
    if kind == OBJECT or (shared and (kind == MPPI or source.endswith(COMPOSITE))):
        return None
    if kind == MPPI:
        return PlannedSource.read(source).absolute
    if not shared:
        return str(Path(source).absolute())
    # Others are read by a world's own code, or with what lies beside them.
    beside = any(companions(Path(source)))
    return suffix if (suffix := suffix_of(source)) in SUFFIXES and not beside else None


class FilesByDigest(Protocol):
    """Where files lie by the SHA-256 of their contents: a store, or a payload."""

    @property
    def name(self) -> str:
        """For messages."""
        ...

    def files(self, digests: Iterable[str]) -> set[str]:
        """Which of them are there; they are about to be used."""
        ...

    def put_file(self, digest: str, content: bytes) -> None:
        """Put a file there."""
        ...

    def file(self, digest: str) -> bytes:
        """A file's contents, or a KeyError."""
        ...


@dataclass
class Payload:
    """`FilesByDigest` that are sent to somebody who has some already.

    Attributes:
        name: of whom they are sent to.
        contents: by digest.
        there: digests of what need not be sent.
    """

    name: str
    contents: dict[str, bytes] = field(default_factory=dict)
    there: Set[str] = frozenset()

    def files(self, digests: Iterable[str]) -> set[str]:
        """As of `FilesByDigest`."""
        return set(digests) & (self.there | self.contents.keys())

    def put_file(self, digest: str, content: bytes) -> None:
        """As of `FilesByDigest`."""
        self.contents[digest] = content

    def file(self, digest: str) -> bytes:
        """As of `FilesByDigest`."""
        return self.contents[digest]


def send(store: FilesByDigest, matches: Iterable[Match]) -> None:
    """Put the files of matches into a store, those that are not there.

    One that has changed since it was entered, or is gone, stays away: whoever races it says so.
    """
    files = {
        identity: source
        for match in matches
        for identity, source in zip(match.entrants, match.sources, strict=True)
        if _label(source, shared=True) in SUFFIXES
    }
    for digest in files.keys() - store.files(files):
        try:
            content = Path(files[digest]).read_bytes()
        except OSError:
            continue
        if _digest(content) == digest:
            store.put_file(digest, content)


class Arrivals:
    """Files that have come from somewhere, in a folder that goes with this object."""

    def __init__(self, store: FilesByDigest) -> None:
        self._store = store
        self._folder = scratch_folder()

    def source(self, identity: str, label: str) -> str:
        """Where to load an entrant from by its label, see `labels`.

        Raises:
            InputError: if its file is not in the store, or is another one there.
        """
        if label not in SUFFIXES:
            return label
        path = Path(self._folder.name) / f"{identity}{label}"
        where = f"{self._store.name}: checkpoint {identity[:12]}"
        if not path.exists():
            try:
                content = self._store.file(identity)
            except KeyError:
                raise InputError(f"{where} is missing, expected it beside its matches") from None
            if (found := _digest(content)) != identity:
                raise InputError(
                    f"{where} has the contents of {found[:12]}, expected those that it is named after"
                )
            write_whole(path, content)
        return str(path)


def _digest(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()
