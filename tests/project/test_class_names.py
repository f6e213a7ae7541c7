"""A class name has one meaning in the whole package."""

from __future__ import annotations

import ast
from collections import defaultdict
from pathlib import Path

import nathlon

ALLOWED = {"World"}
"""What a user's simulator offers, and nathlon's own simulator: both are the word of their readers."""


def test_no_class_name_has_two_meanings() -> None:
    package = Path(nathlon.__file__).parent
    places = defaultdict(list)
    for room in [package, *filter(Path.is_dir, package.iterdir())]:
        for path in room.glob("*.py") if room == package else room.rglob("*.py"):
            for node in ast.walk(ast.parse(path.read_text("utf-8"))):
                if isinstance(node, ast.ClassDef):
                    places[node.name].append(path.relative_to(package).as_posix())
    assert len(places) > 500, "all rooms are read, those behind links too"
    twice = {name: found for name, found in places.items() if len(found) > 1}
    assert twice.keys() == ALLOWED, twice
