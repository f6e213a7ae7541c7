"""Worlds by name: our own, those that installed packages offer, and those in a module or file.

They are foreign code: `nathlon.arena.world_registry` gives what is found here its type.
"""

from __future__ import annotations

import sys
from contextlib import redirect_stdout
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
        name: `racing`, the name of an entry point of the group `nathlon.worlds`, `MODULE:NAME`, or
            `PATH.py:NAME`. What it stands for is a world, or a function without arguments that makes one.
            A file may import the modules beside it.
        circuit, car: of our own simulator; others have none.

    Raises:
        InputError: if there is no such world, or it cannot be loaded.
    """
    if name == RACING:
        place, attribute = _OWN
        return getattr(import_module(place), attribute)(circuit, car)
    # It is foreign code: what it prints is no output of ours, and whatever it raises, the user wants to know
    # whose it is.
    with redirect_stdout(sys.stderr):
        try:
            world = _found(name)
            world = world() if callable(world) and not hasattr(world, "scenarios") else world
        except (MemoryError, InputError):
            raise
        except (Exception, SystemExit) as error:
            raise InputError(
                f"world {name!r}: cannot be loaded: {type(error).__name__} ({error}), expected a world"
            ) from error
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


def offered_worlds() -> list[str]:
    """The worlds known by name: ours, and those of installed packages."""
    return [RACING, *sorted(entry_points(group=WORLDS).names)]


def _found(name: str) -> Any:
    if name in entry_points(group=WORLDS).names:
        (point,) = entry_points(group=WORLDS, name=name)
        return point.load()
    place, colon, attribute = name.rpartition(":")
    if not colon or not attribute:
        raise InputError(
            f"world {name!r}: expected {', '.join(offered_worlds())}, MODULE:NAME or PATH.py:NAME"
        )
    module = _from_file(Path(place)) if place.endswith(".py") else import_module(place)
    if not hasattr(module, attribute):
        raise InputError(f"world {name!r}: {place} has no {attribute!r}")
    return getattr(module, attribute)


def _file(name: str) -> Path | None:
    """The file of the module in which a world that is loaded was found."""
    if name in entry_points(group=WORLDS).names:
        (point,) = entry_points(group=WORLDS, name=name)
        name = point.value
    place, _, _ = name.rpartition(":")
    if place.endswith(".py"):
        return Path(place).absolute()
    found = getattr(sys.modules.get(place), "__file__", None)
    return None if found is None else Path(found)


def _from_file(path: Path) -> ModuleType:
    if not path.is_file():
        raise InputError(f"{path}: no such file, expected a world")
    spec = spec_from_file_location(f"nathlon_world_{path.stem}", path)
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
