"""Finding policies in what a user has given: paths, names, and folders of checkpoints."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from pathlib import Path

from nathlon.policies.bundled import generalist
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
    check_source,
    suffix_of,
)
from nathlon.sim.errors import InputError
from nathlon.sim.names import printable


def checkpoints_below(folder: Path) -> list[Path]:
    """The checkpoints in a folder and those below it, without the states of training runs.

    Links to folders are followed. What is hidden (`.NAME`) is passed over, as caches and half-written files
    are. Files that a file of roles there names are no checkpoints of their own. A folder that cannot be
    looked into is one of them, so that whoever opens it says so.
    """
    closed: list[Path] = []
    found = [
        Path(place) / name
        for place, names in _looked_into(folder, lambda error: closed.append(Path(error.filename)))
        for name in names
        if (suffix_of(name) in SUFFIXES and name.lower() not in TRAINING_STATE) or name.endswith(ROLES)
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


def find_sources(given: Iterable[str | Path], people: bool = False) -> list[str]:
    """The sources among what a user has given.

    A folder stands for all checkpoints below it, `generalist` for the one that comes with nathlon.

    Args:
        given: paths and names.
        people: whether what a person did is one of them.

    Raises:
        InputError: if there is no such policy, or a folder holds none.
    """
    found: list[str] = []
    for one in map(str, given):
        if not one:
            raise InputError("'': names no policy, expected a path or name")
        if one == GENERALIST:
            found.append(str(generalist()))
        elif one.partition(":")[0] not in (DRIVER, PLUGIN, OBJECT, HUMAN, MPPI) and Path(one).is_dir():
            inside = checkpoints_below(Path(one))
            if not inside:
                raise InputError(f"{one}: holds no checkpoint, expected files of {', '.join(SUFFIXES)}")
            found.extend(map(str, inside))
        else:
            check_source(one)
            if one.startswith(f"{HUMAN}:") and not people:
                raise InputError(f"{printable(one)}: is a person, expected a policy")
            found.append(one)
    return found
