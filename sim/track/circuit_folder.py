"""Circuits as folders: the TOML file and the centre line that it names."""

from __future__ import annotations

import json
import os
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from nathlon.sim.errors import InputError
from nathlon.sim.track import CircuitFile
from nathlon.sim.track.centre_line import BANK_ANGLE, COLUMNS
from nathlon.sim.whole_file import writing

DIGITS = tuple(5 if column == BANK_ANGLE else 3 for column in range(len(COLUMNS)))
"""After the point: millimetres, and as much at the edge of a banked road."""
TOML_ORDER = (
    *("name", "description", "centre_line", "runoff", "sectors_m", "kind", "side"),
    *("pole_m", "spacing_m", "lateral_m", "start_m", "end_m", "width_m", "surface"),
    *("entry_m", "exit_m", "speed_m_s"),
)


class Circuit(NamedTuple):
    """What the folder of a circuit holds.

    Attributes:
        facts: of the TOML file.
        points: (n, 8) float64 of the centre line, columns as in `nathlon.sim.track.centre_line.COLUMNS`.
    """

    facts: CircuitFile
    points: NDArray[np.float64]


def new_folder(folder: Path, name: str) -> Path:
    """Where the folder of a circuit goes.

    Raises:
        InputError: if something is there already.
    """
    target = folder / name
    if target.exists():
        raise InputError(f"{target}: is there already, expected the name of a new folder")
    return target


def write_circuit(target: Path, circuit: Circuit, origin: str) -> Path:
    """Write the folder of a circuit, whole or not at all.

    Args:
        target: the folder, not there yet; those above it are made.
        circuit: what it holds.
        origin: a sentence on where it comes from, the first line of the TOML file.

    Returns:
        the path of the TOML file.

    Raises:
        InputError: if it cannot be written.
    """
    rows = [
        ",".join(f"{cell:.{digits}f}" for cell, digits in zip(row, DIGITS, strict=True))
        for row in circuit.points
    ]
    with writing(target, "circuit"):
        target.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=target.parent, prefix=f".{target.name}-") as partial:
            made = Path(partial) / target.name
            made.mkdir()
            (made / circuit.facts.centre_line).write_text(
                "\n".join([",".join(COLUMNS), *rows]) + "\n", "utf-8"
            )
            (made / "circuit.toml").write_text(_toml(circuit.facts, origin), "utf-8")
            os.rename(made, target)
    return target / "circuit.toml"


def _toml(facts: CircuitFile, origin: str) -> str:
    arrays = ("section", "kerb", "runoff_stretch", "penalty_zone")
    fields = facts.model_dump(mode="json", exclude_none=True)
    tables: list[str] = [name for name in ("grid", "pit_lane") if name in fields]
    lines = [f"# {origin} Metres along the centre line."]
    lines += _assignments({name: fields[name] for name in fields if name not in (*tables, *arrays)})
    for name in tables:
        lines += ["", f"[{name}]", *_assignments(fields[name])]
    for name in arrays:
        for table in fields[name]:
            lines += ["", f"[[{name}]]", *_assignments(table)]
    return "\n".join(lines) + "\n"


def _assignments(table: Mapping[str, Any]) -> list[str]:
    # Strings, numbers and lists of numbers read the same in JSON and TOML.
    return [f"{name} = {json.dumps(table[name])}" for name in sorted(table, key=TOML_ORDER.index)]
