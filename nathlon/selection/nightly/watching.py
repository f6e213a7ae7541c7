"""What lies in the folders that nights watch, known by its contents without opening it."""

from __future__ import annotations

from collections.abc import Container, Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from nathlon.policies.remote import local
from nathlon.policies.sources import PLUGIN
from nathlon.policies.sources.finding import checkpoints_below
from nathlon.policies.sources.identity import policy_id
from nathlon.sim.errors import InputError
from nathlon.sim.names import printable


@dataclass(frozen=True)
class Watched:
    """Files and plugins that are watched.

    Attributes:
        digests: id of each source, in their order; None where it cannot be read.
        empty: folders without any checkpoint.
    """

    digests: Mapping[str, str | None]
    empty: tuple[Path, ...] = ()

    def unjudged(self, known: Container[str], refused: Container[str] = ()) -> dict[str, str | None]:
        """The sources that are not known yet, and their ids.

        Args:
            known: ids.
            refused: ids, and what sources that cannot be read are called, of what was set aside before.
        """
        return {
            source: digest
            for source, digest in self.digests.items()
            if digest not in known and (digest or printable(source)) not in refused
        }

    def sources(self, identity: str) -> list[str]:
        """All sources of a policy by its id, in their order; none where it is not watched any more."""
        return self._sources.get(identity, [])

    @cached_property
    def _sources(self) -> dict[str, list[str]]:
        found: dict[str, list[str]] = {}
        for source, digest in self.digests.items():
            if digest is not None:
                found.setdefault(digest, []).append(source)
        return found


def watch(watched: Iterable[str], endings: Iterable[str] = ()) -> Watched:
    """Look into folders and at addresses, and at files and `plugin:NAME`.

    Files with the endings are checkpoints besides those that nathlon reads itself.

    Raises:
        InputError: if a path does not exist, or an address cannot be reached.
    """
    sources: list[str] = []
    empty: list[Path] = []
    loaded = tuple(endings)
    for source in watched:
        path = Path(local(source, loaded))
        if source.partition(":")[0] == PLUGIN:
            sources.append(source)
        elif not path.exists():
            raise InputError(f"{source}: no such file or folder, expected checkpoints to watch")
        elif path.is_dir():
            found = checkpoints_below(path, loaded)
            sources += map(str, found)
            empty += [] if found else [path]
        else:
            sources.append(source)
    return Watched({source: _digest(source) for source in sources}, tuple(empty))


def _digest(source: str) -> str | None:
    try:
        return policy_id(source)
    except InputError:
        return None
