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
    files = {s: os.path.split(os.path.abspath(s)) for s in sources if s and is_path(s)}
    stems = {file: stem(file[1]) for file in files.values()}
    alike = Counter((folder, name) for (folder, _), name in stems.items())
    last = {file: file[1] if alike[file[0], name] > 1 else name for file, name in stems.items()}
    folders: dict[str, set[str]] = {}
    for (folder, _), name in last.items():
        folders.setdefault(name, set()).add(folder)
    parts = {folder: Path(folder).parts for folder, _ in stems}
    needed: Counter[str] = Counter()
    for places in folders.values():
        depth = next(k for k in count() if len({_end(parts[place], k) for place in places}) == len(places))
        for place in places:
            needed[place] = max(needed[place], depth)
    before = {folder: _end(parts[folder], needed[folder]) for folder in parts}
    return {s: "/".join((*before[file[0]], last[file])) for s, file in files.items()}


def longer(source: str, name: str) -> str:
    """A name with one more folder of the path before it; as it is where there is none."""
    if not is_path(source):
        return name
    parts = Path(os.path.abspath(source)).parent.parts[1:]
    above = parts[: len(parts) - name.count("/")]
    return f"{above[-1]}/{name}" if above else name


def _end(parts: tuple[str, ...], depth: int) -> tuple[str, ...]:
    """The last folders of a path, from the outermost on."""
    return parts[max(len(parts) - depth, 0) :]
