"""A loader that is called by a name: for our own simulator, which has no mapping that could hold one."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from functools import cached_property, lru_cache
from importlib.metadata import PackageNotFoundError, packages_distributions, version
from modulefinder import ModuleFinder
from pathlib import Path
from typing import Any

from nathlon.arena.world import Loader
from nathlon.arena.world_finding import find_loader
from nathlon.arena.worlds.host import hashes
from nathlon.arena.worlds.loaded import by_ending
from nathlon.sim.errors import InputError


class NamedLoader:
    """Loaders by the endings of files, and what decides what they make.

    Attributes:
        by_ending: the loaders.
    """

    def __init__(self, name: str) -> None:
        """Of `PATH.py:NAME` or `MODULE:NAME`: a function, or functions by endings.

        Raises:
            InputError: if there is none, or it cannot be loaded.
        """
        found, self._file = find_loader(name)
        try:
            self.by_ending: Mapping[str, Loader] = by_ending(found)
        except ValueError as error:
            raise InputError(f"loader {name!r}: {error}") from None

    @cached_property
    def identity(self) -> dict[str, Any]:
        """Hashes of its file and of the modules beside it, and versions of the packages that they import."""
        if self._file is None:
            return {}
        return {"files": hashes(str(self._file)), "packages": _packages(self._file)}


@lru_cache
def named_loader(name: str) -> NamedLoader:
    """The loader of a name; one object a process."""
    return NamedLoader(name)


def _packages(path: Path) -> dict[str, str]:
    """Versions of the installed packages that a file imports, or a module beside it."""
    finder = ModuleFinder([str(path.absolute().parent)])
    finder.run_script(str(path))
    # Those that do not lie beside it have not been looked for.
    tops = {name.partition(".")[0] for name in finder.badmodules} - sys.stdlib_module_names
    return {top: told for top in sorted(tops) if (told := _version(top))}


def _version(module: str) -> str:
    """Of the package that a module belongs to; '' where none is installed."""
    for distribution in (module, *_distributions().get(module, ())):
        try:
            return version(distribution)
        except PackageNotFoundError:
            continue
    return ""


@lru_cache
def _distributions() -> Mapping[str, list[str]]:
    return packages_distributions()
