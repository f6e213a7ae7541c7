"""`nathlon track import` and `nathlon track show`."""

from __future__ import annotations

from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np
from rich.table import Table

from nathlon.commands.console import console, print_json, say
from nathlon.sim.names import file_stem
from nathlon.sim.track import CURVATURE, NamedSection, Track, load_track
from nathlon.sim.track_import import import_circuit
from nathlon.sim.track_map import draw_map

STRAIGHT_RADIUS_M = 400.0  # from here on a bend is no corner


def import_track(file: Path, name: str, out: Path, as_json: bool) -> None:
    """Make a circuit folder of a centre line, and say how to use it."""
    path = import_circuit(file, name, out)
    circuit = load_track(str(path))
    if as_json:
        print_json({"circuit": path, "description": circuit.description, "length_m": circuit.length})
        return
    say(f"Circuit      {path}: {circuit.description}")
    say(f"Map          nathlon track show {path}")
    say(f"Race         nathlon race driver --circuit {path}")


def show_track(name: str, out: Path | None, as_json: bool) -> None:
    """Draw the map of a circuit and print its sections."""
    circuit = load_track(name)
    path = out or Path(f"{file_stem(circuit.name)}.png")
    draw_map(circuit, path)
    sections = [_described(circuit, section) for section in circuit.sections]
    if as_json:
        print_json({"name": circuit.name, "length_m": circuit.length, "sections": sections, "map": path})
        return
    table = Table(title=f"{circuit.name}, {circuit.length:.0f} m")
    for column in ("Section", "Kind", "From m", "To m", "Turn", "Least radius m"):
        table.add_column(column, justify="left" if column in ("Section", "Kind", "Turn") else "right")
    for row in sections:
        radius = row["least_radius_m"]
        table.add_row(
            row["name"],
            row["kind"],
            f"{row['start_m']:.0f}",
            f"{row['end_m']:.0f}",
            ", ".join(row["turns"]),
            "" if radius is None else f"{radius:.0f}",
        )
    console.print(table)
    say(f"Map          {path}")


def _described(circuit: Track, section: NamedSection) -> dict[str, Any]:
    """A section with the ways that it bends, in turn, and the least radius of its centre line."""
    rows = slice(int(section.start_m / circuit.spacing), int(section.end_m / circuit.spacing) + 1)
    curvature = circuit.table[rows, CURVATURE]
    bends = curvature[np.abs(curvature) > 1.0 / STRAIGHT_RADIUS_M]
    facts = {"name": section.name, "kind": section.kind, "start_m": section.start_m, "end_m": section.end_m}
    if section.kind == "straight" or not len(bends):
        return {**facts, "turns": [], "least_radius_m": None}
    turns = ["left" if bend > 0 else "right" for bend, _ in groupby(np.sign(bends))]
    return {**facts, "turns": turns, "least_radius_m": float(1.0 / np.abs(bends).max())}
