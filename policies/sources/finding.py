"""Finding policies in what a user has given: paths, names, and folders of checkpoints."""

from __future__ import annotations

import logging
import os
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

from nathlon.policies.bundled import generalist
from nathlon.policies.policy_file import open_policy_file
from nathlon.policies.sources import (
    DRIVER,
    GENERALIST,
    HUMAN,
    MPPI,
    OBJECT,
    PLUGIN,
    ROLES,
    SUFFIXES,
    TRAINING_STATE,
    WEIGHTS,
    check_source,
    is_path,
    suffix_of,
)
from nathlon.policies.sources.recognised import EITHER
from nathlon.sim.errors import InputError, together
from nathlon.sim.names import printable

log = logging.getLogger(__name__)


def checkpoints_below(folder: Path, endings: Iterable[str] = ()) -> list[Path]:
    """The checkpoints in a folder and those below it, without the states of training runs.

    Files with the endings, in small letters, are checkpoints too.

    Links to folders are followed. What is hidden (`.NAME`) is passed over, as caches and half-written files
    are. Files that a file of roles there names are no checkpoints of their own. A folder that cannot be
    looked into is one of them, so that whoever opens it says so.
    """
    closed: list[Path] = []
    loaded = tuple(endings)
    found = [
        Path(place) / name
        for place, names in _looked_into(folder, lambda error: closed.append(Path(error.filename)))
        for name in names
        if name.endswith(ROLES)
        or name.lower().endswith(loaded)
        or (name.lower() not in TRAINING_STATE and suffix_of(Path(place) / name) in SUFFIXES)
    ]
    parts: set[str] = set()
    for path in found:
        if path.name.endswith(ROLES):
            from nathlon.policies.sources.roles import RolesSource  # pydantic takes long to load

            with suppress(InputError):  # whoever opens it says what is wrong
                parts |= {os.path.abspath(source) for source in RolesSource.read(path).sources.values()}
    return sorted([*(path for path in found if os.path.abspath(path) not in parts), *closed])


def _looked_into(root: Path, on_error: Callable[[OSError], None]) -> Iterator[tuple[str, list[str]]]:
    """Every folder from `root` downward that is not hidden, once, with the names of the files in it.

    Links come last, so that a folder goes by its own path where it has one below the root.
    """
    waiting, seen = [str(root)], set()
    while waiting:
        for place, folders, names in os.walk(waiting.pop(0), onerror=on_error):
            if (real := os.path.realpath(place)) in seen:
                folders.clear()
                continue
            seen.add(real)
            folders[:] = sorted(name for name in folders if not name.startswith("."))
            waiting += [path for name in folders if os.path.islink(path := os.path.join(place, name))]
            yield place, [name for name in names if not name.startswith(".")]


def check_given(given: Iterable[str | Path]) -> None:
    """Raise an InputError that names all that is neither a folder nor can be a policy."""
    refused: list[InputError] = []
    for one in map(str, given):
        if one != GENERALIST and not _is_folder(one):
            try:
                check_source(one)
            except InputError as error:
                refused.append(error)
    if refused:
        raise together(refused)


def _is_folder(one: str) -> bool:
    return one.partition(":")[0] not in (DRIVER, PLUGIN, OBJECT, HUMAN, MPPI) and Path(one).is_dir()


@dataclass
class Found:
    """Policies among what a user has given.

    Attributes:
        sources: of them.
        named: those that were given themselves, and did not lie in a folder.
        set_aside: why files in folders are no policies, by their paths.
    """

    sources: list[str] = field(default_factory=list)
    named: set[str] = field(default_factory=set)
    set_aside: dict[str, InputError] = field(default_factory=dict)

    def add(self, other: Found) -> None:
        """Add what else was given."""
        self.sources += other.sources
        self.named |= other.named
        self.set_aside |= other.set_aside

    def warned(self) -> list[str]:
        """The sources, with a warning of what is set aside."""
        if self.set_aside:
            log.warning("set aside: %s", together(list(self.set_aside.values())))
        return self.sources


def find_sources(given: Iterable[str | Path], people: bool = False, endings: Iterable[str] = ()) -> list[str]:
    """The sources among what a user has given, with a warning of what is set aside; see `find`."""
    return find(given, people, endings).warned()


def find(given: Iterable[str | Path], people: bool = False, endings: Iterable[str] = ()) -> Found:
    """What a user has given.

    A folder stands for all checkpoints below it, `generalist` for the one that comes with nathlon. What a
    folder holds and cannot be read is set aside, before it is opened.

    Args:
        given: paths and names.
        people: whether what a person did is one of them.
        endings: of files in folders that are checkpoints besides those that nathlon reads itself.

    Raises:
        InputError: if some are no such policies or cannot be read, which are all named, or a folder is empty.
    """
    loaded = tuple(endings)
    found = Found()
    refused: list[InputError] = []
    for one in map(str, given):
        if not one:
            raise InputError("'': names no policy, expected a path or name")
        if one == GENERALIST:
            found.sources.append(str(generalist()))
        elif _is_folder(one):
            inside = checkpoints_below(Path(one), loaded)
            if not inside:
                raise _without_checkpoint(one, loaded)
            looked = {str(path): _fault(path) for path in inside}
            faults = {source: fault for source, fault in looked.items() if fault}
            if len(faults) == len(looked):
                refused += faults.values()
            found.set_aside |= faults
            found.sources += [source for source in looked if source not in faults]
        else:
            try:
                check_source(one)
                if one.startswith(f"{HUMAN}:") and not people:
                    raise InputError(f"{printable(one)}: is a person, expected a policy")
                if is_path(one) and (fault := _fault(Path(one))):
                    raise fault
            except InputError as error:
                refused.append(error)
            found.sources.append(one)
            found.named.add(one)
    if refused:
        raise together(refused)
    return found


def _without_checkpoint(folder: str, loaded: tuple[str, ...]) -> InputError:
    others = [path.name for path in checkpoints_below(Path(folder), WEIGHTS)]
    known = ", ".join((*SUFFIXES, *loaded))
    if others and loaded != WEIGHTS:
        return InputError(
            f"{folder}: holds {len(others)} files such as {printable(others[0])!r}, which only the code that "
            f"trained them can read, {EITHER}; or files of {known}"
        )
    return InputError(f"{folder}: holds no checkpoint, expected files of {known}")


def _fault(path: Path) -> InputError | None:
    """Why a file cannot be read, as far as that is known without opening what it holds."""
    try:
        with open_policy_file(path):
            return None
    except InputError as error:
        return error
