"""Worlds by name: our own, those that installed packages offer, and those in a module or file.

They are foreign code: `nathlon.arena.world_registry` gives what is found here its type.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout
from functools import lru_cache
from importlib import import_module
from importlib.metadata import entry_points
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType
from typing import Any

from nathlon.sim.errors import InputError

RACING = "racing"
"""Name of our own simulator."""
WITH = "+"
"""Begins what follows in that name: the loader by which it reads files that nathlon cannot."""
_OWN = ("nathlon.arena.worlds.racing", "Racing")
"""Where it is, by name as any other world."""
WORLDS = "nathlon.worlds"
"""Group of the entry points by which packages offer worlds."""
_NEEDED = ("scenarios", "measures", "baseline", "setup", "check", "facts", "enter", "policy", "run")
_DEFAULTS = {"episode": "episode", "circuits": False, "loaders": {}}
"""Of attributes that a world need not have."""


@lru_cache
def find_world(name: str, circuit: str = "", car: str = "") -> Any:
    """The world of a name, see `nathlon.arena.world.World`.

    Args:
        name: `racing` or `racing+LOADER`, the name of an entry point of the group `nathlon.worlds`,
            `MODULE:NAME`, or `PATH.py:NAME`. What it stands for is a world, or a function without arguments
            that makes one. A file may import the modules beside it.
        circuit, car: of our own simulator; others have none.

    Raises:
        InputError: if there is no such world, or it cannot be loaded.
    """
    # Results name their world, and reports of them have to be written.
    if name.encode("utf-8", "replace").decode() != name:
        raise InputError(f"world {name!r}: expected a name in UTF-8")
    if is_racing(name):
        place, attribute = _OWN
        return getattr(import_module(place), attribute)(circuit, car, name.partition(WITH)[2])
    with _loading(name, "world"):
        world = _found(name)
        world = world() if callable(world) and not hasattr(world, "scenarios") else world
    for attribute in _NEEDED:
        if not hasattr(world, attribute):
            raise InputError(f"world {name!r}: has no {attribute}, expected a world")
    for attribute, default in _DEFAULTS.items():
        if not hasattr(world, attribute):
            setattr(world, attribute, default)
    world.name = name
    if hasattr(world, "file"):
        world.file = _file(name)
    return world


def is_racing(name: str) -> bool:
    """Whether a world is our own simulator."""
    return name == RACING or name.startswith(RACING + WITH)


def with_loader(world: str, loader: str) -> str:
    """The name of our own simulator that reads files by a loader, `PATH.py:NAME` or `MODULE:NAME`.

    Raises:
        InputError: if it is another world.
    """
    if not is_racing(world):
        raise InputError(f"world {world!r}: has no --loader, expected load=function in its mapping")
    return f"{RACING}{WITH}{loader}"


def in_folder(world: str, folder: Path) -> str:
    """The name of a world with its file by an absolute path, if it has one that starts from a folder."""
    own, plus, place = world.partition(WITH) if is_racing(world) else ("", "", world)
    return own + plus + (os.path.abspath(folder / place) if ".py:" in place else place)


def find_loader(name: str) -> tuple[Any, Path | None]:
    """What a loader is called by, `PATH.py:NAME` or `MODULE:NAME`, and the file of its module.

    Raises:
        InputError: if there is none, or it cannot be loaded.
    """
    with _loading(name, "loader"):
        return _at(name, "loader"), _file_at(name)


@contextmanager
def _loading(name: str, what: str) -> Iterator[None]:
    """What is loaded is foreign code: what it prints is no output of ours.

    Whatever it raises, the user wants to know whose it is.
    """
    with redirect_stdout(sys.stderr):
        try:
            yield
        except (MemoryError, InputError):
            raise
        except (Exception, SystemExit) as error:
            raise InputError(
                f"{what} {name!r}: cannot be loaded: {type(error).__name__} ({error}), expected a {what}"
            ) from error


def offered_worlds() -> list[str]:
    """The worlds known by name: ours, and those of installed packages."""
    return [RACING, *sorted(entry_points(group=WORLDS).names)]


def _found(name: str) -> Any:
    if name in entry_points(group=WORLDS).names:
        (point,) = entry_points(group=WORLDS, name=name)
        return point.load()
    return _at(name, "world", *offered_worlds())


def _at(name: str, what: str, *others: str) -> Any:
    """What `PATH.py:NAME` or `MODULE:NAME` stands for."""
    place, colon, attribute = name.rpartition(":")
    if not colon or not attribute:
        raise InputError(f"{what} {name!r}: expected {', '.join([*others, 'MODULE:NAME'])} or PATH.py:NAME")
    module = _from_file(Path(place), what) if place.endswith(".py") else import_module(place)
    if not hasattr(module, attribute):
        raise InputError(f"{what} {name!r}: {place} has no {attribute!r}")
    return getattr(module, attribute)


def _file(name: str) -> Path | None:
    """The file of the module in which a world that is loaded was found."""
    if name in entry_points(group=WORLDS).names:
        (point,) = entry_points(group=WORLDS, name=name)
        name = point.value
    return _file_at(name)


def _file_at(name: str) -> Path | None:
    """The file of the module of `PATH.py:NAME` or `MODULE:NAME`, which is loaded."""
    place, _, _ = name.rpartition(":")
    if place.endswith(".py"):
        return Path(place).absolute()
    found = getattr(sys.modules.get(place), "__file__", None)
    return None if found is None else Path(found)


def _from_file(path: Path, what: str) -> ModuleType:
    if not path.is_file():
        raise InputError(f"{path}: no such file, expected a {what}")
    spec = spec_from_file_location(f"nathlon_{what}_{path.stem}", path)
    assert spec is not None
    assert spec.loader is not None
    folder = str(path.parent.absolute())
    if folder not in sys.path:
        # The last, for modules beside it: others of this process shall find none of them by mistake.
        sys.path.append(folder)
    module = module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module
