"""Folders of files that describe circuits, imported one by one."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

from nathlon.sim.errors import InputError
from nathlon.sim.names import LONGEST_FILE
from nathlon.sim.track.formats.reading import ENDINGS, edge_files
from nathlon.sim.track.importing import Imported, import_circuit

MOST_FILES = 2000


class TriedFile(NamedTuple):
    """A file, and the circuit made of it or why there is none."""

    file: Path
    imported: Imported | None
    refusal: str = ""


def circuit_files(folder: Path) -> list[Path]:
    """Files in a folder and those below that may describe circuits, in order; of two edges the left one.

    Raises:
        InputError: if there are none, or more than MOST_FILES.
    """
    files = sorted(
        file
        for file in folder.rglob("*")
        if file.suffix.lower() in ENDINGS and file.is_file() and _stands_alone(file)
    )
    if not 0 < len(files) <= MOST_FILES:
        endings = ", ".join(sorted(ENDINGS))
        raise InputError(
            f"{folder}: {len(files):,} files of circuits ({endings}), expected 1 to {MOST_FILES:,}"
        )
    return files


def _stands_alone(file: Path) -> bool:
    """Whether a file is neither the right one of two edges nor part of a circuit that was made."""
    edges = edge_files(file)
    return (edges is None or file == edges[0]) and not (file.parent / "circuit.toml").exists()


def name_of(file: Path) -> str:
    """A circuit's name made of its file's."""
    words = re.sub(r"[^a-z0-9]+", "-", file.stem.lower()).strip("-")
    return words[:LONGEST_FILE].strip("-") or "circuit"


def import_folder(
    folder: Path,
    out: Path,
    width: float | None = None,
    scale: float = 1.0,
    tell: Callable[[TriedFile], object] = lambda tried: None,
) -> list[TriedFile]:
    """Import every file of a folder that describes a circuit, each as a folder in `out`.

    Args:
        folder: with files, and folders of them.
        out: where the folders of the circuits go; made if it is not there.
        width, scale: as `import_circuit` takes them.
        tell: called with each file once it has been tried.

    Raises:
        InputError: if there are no such files, or too many.
    """
    tried = []
    names = _names(circuit_files(folder))
    for file, name in names:
        try:
            one = TriedFile(file, import_circuit(file, name, out, width, scale))
        except InputError as error:
            one = TriedFile(file, None, str(error))
        tried.append(one)
        tell(one)
    return tried


def _names(files: list[Path]) -> Iterator[tuple[Path, str]]:
    """Each file with a name of its own."""
    taken: set[str] = set()
    for file in files:
        name, number = name_of(file), 2
        while name in taken:
            name, number = f"{name_of(file)}-{number}", number + 1
        taken.add(name)
        yield file, name
