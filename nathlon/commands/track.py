"""`nathlon track import` and `nathlon track show`."""

from __future__ import annotations

from itertools import groupby
from pathlib import Path

import numpy as np
from rich.table import Table

from nathlon.commands.console import console, say
from sim.track import CURVATURE, NamedSection, Track, load_track
from sim.track_import import import_circuit
from sim.track_map import draw_map

STRAIGHT_RADIUS_M = 400.0  # from here on a bend is no corner


def import_track(file: Path, name: str, out: Path) -> None:
    """Make a circuit folder of a centre line, and say how to use it."""
    path = import_circuit(file, name, out)
    circuit = load_track(str(path))
    say(f"Circuit      {path}: {circuit.description}")
    say(f"Map          nathlon track show {path}")
    say(f"Race         nathlon race driver --circuit {path}")


def show_track(name: str, out: Path | None) -> None:
    """Draw the map of a circuit and print its sections."""
    circuit = load_track(name)
    path = out or Path(Path(f"{circuit.name}.png").name)
    draw_map(circuit, path)
    table = Table(title=f"{circuit.name}, {circuit.length:.0f} m")
    for column in ("Section", "Kind", "From m", "To m", "Turn", "Least radius m"):
        table.add_column(column, justify="left" if column in ("Section", "Kind", "Turn") else "right")
    for section in circuit.sections:
        table.add_row(
            section.name,
            section.kind,
            f"{section.start_m:.0f}",
            f"{section.end_m:.0f}",
            *_bend(circuit, section),
        )
    console.print(table)
    say(f"Map          {path}")


def _bend(circuit: Track, section: NamedSection) -> tuple[str, str]:
    """Which ways a section bends, in turn, and the least radius of its centre line."""
    rows = slice(int(section.start_m / circuit.spacing), int(section.end_m / circuit.spacing) + 1)
    curvature = circuit.table[rows, CURVATURE]
    bends = curvature[np.abs(curvature) > 1.0 / STRAIGHT_RADIUS_M]
    if section.kind == "straight" or not len(bends):
        return "", ""
    ways = ["left" if bend > 0 else "right" for bend, _ in groupby(np.sign(bends))]
    return ", ".join(ways), f"{1.0 / np.abs(bends).max():.0f}"
