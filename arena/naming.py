"""What entrants are called: by the shortest part of the path that tells their files apart."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Iterable
from itertools import count
from pathlib import Path

from nathlon.policies.sources import ROLES, is_path, stem_of


def stem(source: str) -> str:
    """The name of a file without what all files of its kind end with."""
    name = Path(source).name
    return name.removesuffix(ROLES) if name.endswith(ROLES) else stem_of(name)


def short_names(sources: Iterable[str]) -> dict[str, str]:
    """By source the shortest part of its path that no other of the files ends with, without suffix.

    If one file of a folder needs folders before its name, all files of this folder have as many: they are of
    one run, and so will be those that it leaves tomorrow. Only files in one folder that differ in nothing but
    their suffixes have these. What is no path has no such name.
    """
    paths = {s: Path(os.path.abspath(s)) for s in sources if s and is_path(s)}
    alike = Counter((path.parent, stem(path.name)) for path in set(paths.values()))
    last = {p: p.name if alike[p.parent, stem(p.name)] > 1 else stem(p.name) for p in paths.values()}
    folders: dict[str, set[Path]] = {}
    for path, name in last.items():
        folders.setdefault(name, set()).add(path.parent)
    needed: Counter[Path] = Counter()
    for places in folders.values():
        depth = next(k for k in count() if len({_end(place, k) for place in places}) == len(places))
        for place in places:
            needed[place] = max(needed[place], depth)
    return {s: "/".join((*_end(p.parent, needed[p.parent]), last[p])) for s, p in paths.items()}


def longer(source: str, name: str) -> str:
    """A name with one more folder of the path before it; as it is where there is none."""
    if not is_path(source):
        return name
    parts = Path(os.path.abspath(source)).parent.parts[1:]
    above = parts[: len(parts) - name.count("/")]
    return f"{above[-1]}/{name}" if above else name


def _end(folder: Path, depth: int) -> tuple[str, ...]:
    """The last folders of a path, from the outermost on."""
    return folder.parts[max(len(folder.parts) - depth, 0) :]
