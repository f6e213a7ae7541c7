"""`nathlon track import`, `generate`, `limit` and `show`."""

from __future__ import annotations

from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from nathlon.commands.options import AsJson, CarName, CircuitParent
from nathlon.selection.bounds import LARGEST_SEED
from nathlon.sim.errors import InputError
from nathlon.sim.names import file_stem
from nathlon.sim.process import typed
from nathlon.sim.whole_file import check_output
from nathlon.terminal import new_table, print_json, print_table, say, tell, warn

if TYPE_CHECKING:
    from nathlon.sim.track import NamedSection, Track

STRAIGHT_RADIUS_M = 400.0  # from here on a bend is no corner


def import_track(
    file: Annotated[Path, typer.Argument(help="File that describes a circuit, or a folder of such files.")],
    name: Annotated[
        str | None,
        typer.Option(help="Name of the circuit: lowercase letters, digits, hyphens. The file's by default."),
    ] = None,
    out: CircuitParent = Path(),
    width: Annotated[
        float | None, typer.Option(help="Width of the road in metres, instead of the file's or of a guess.")
    ] = None,
    scale: Annotated[float, typer.Option(help="Enlarges the circuit: 10 for a model of 1:10.")] = 1.0,
    as_json: AsJson = False,
) -> None:
    """Make a circuit, as the folder NAME, of a table, GeoJSON, GPX, KML, OpenStreetMap, TORCS and others.

    What a file is follows from its contents. Of a folder of files it makes as many circuits as it can, and a
    sheet with pictures of them.
    """
    from nathlon.sim.track.collection import name_of
    from nathlon.sim.track.importing import import_circuit

    check_output(out)
    if file.is_dir():
        _import_folder(file, name, out, width, scale, as_json)
        return
    imported = import_circuit(file, name or name_of(file), out, width, scale)
    if not as_json:
        say(f"Read as      {imported.dialect}")
        for note in imported.notes:
            say(f"Note         {note}")
    _tell(imported.path, as_json, dialect=imported.dialect, notes=imported.notes)


def _import_folder(
    folder: Path, name: str | None, out: Path, width: float | None, scale: float, as_json: bool
) -> None:
    """Import a folder of files, and draw a sheet of the circuits."""
    from nathlon.sim.track import load_track
    from nathlon.sim.track.collection import TriedFile, import_folder
    from nathlon.sim.track.map import draw_sheet

    if name is not None:
        raise InputError(
            f"--name is {name!r}, expected none for a folder: circuits are called like their files"
        )

    def tell(tried: TriedFile) -> None:
        if tried.imported is None:
            warn(f"Left out     {tried.refusal}")
        elif not as_json:
            said = "; ".join([tried.imported.dialect, *tried.imported.notes])
            say(f"Circuit      {tried.imported.path}: {said}")

    tried = import_folder(folder, out, width, scale, tell)
    circuits = [load_track(str(one.imported.path)) for one in tried if one.imported]
    if not circuits:
        raise InputError(f"{folder}: none of {len(tried)} files made a circuit")
    sheet = out / "circuits.png"
    draw_sheet(circuits, sheet)
    if as_json:
        files = [
            {"file": one.file, "error": one.refusal}
            if one.imported is None
            else {"file": one.file, **one.imported._asdict()}
            for one in tried
        ]
        print_json({"files": files, "sheet": sheet})
        return
    say(f"Imported     {len(circuits)} of {len(tried)} files")
    say(f"Sheet        {sheet}")


def generate_track(
    seed: Annotated[int, typer.Option(min=0, max=LARGEST_SEED, help="Seed of the circuit.")],
    style: Annotated[str, typer.Option(help="grand-prix, street or national.")] = "grand-prix",
    length: Annotated[
        float | None, typer.Option(help="Length of the lap, m; the style's usual length by default.")
    ] = None,
    out: CircuitParent = Path(),
    as_json: AsJson = False,
) -> None:
    """Make up a circuit, as the folder STYLE-SEED; the same seed gives the same circuit."""
    from nathlon.sim.track.generating import write_generated

    check_output(out)
    _tell(write_generated(out, seed, style, length), as_json)


def _tell(path: Path, as_json: bool, **facts: Any) -> None:
    """Say what circuit there is now."""
    from nathlon.sim.track import load_track

    circuit = load_track(str(path))
    if as_json:
        print_json({"circuit": path, "description": circuit.description, "length_m": circuit.length, **facts})
        return
    say(f"Circuit      {path}: {circuit.description}")
    tell({"map": typed("track", "show", path), "race": typed("race", "driver", "--circuit", path)}, False)


def limit_track(
    name: Annotated[str, typer.Argument(help="Name or path of the circuit.")],
    car: CarName = "gt3",
    as_json: AsJson = False,
) -> None:
    """Find the fastest lap that car and rules allow, by optimal control; reports then compare laps with it.

    It takes minutes, and needs the extra `limit`.
    """
    from nathlon.selection.publish.lap_limits import compute_limit, known_limit

    known = known_limit(name, car)
    limit_s, solved = compute_limit(name, car) if known is None else (known, True)
    if as_json:
        print_json({"circuit": name, "car": car, "limit_s": limit_s, "solved": solved})
        return
    doubt = "" if solved else ": the solver is not content with it, so it is not kept"
    say(f"Limit        {limit_s:.3f} s{doubt}")


def show_track(
    name: Annotated[str, typer.Argument(help="Name or path of the circuit.")],
    out: Annotated[
        Path | None, typer.Option("--out", help="The picture; NAME.png in this folder by default.")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Draw the map of a circuit and list its sections."""
    from nathlon.sim.data_file import DATA, find_data

    find_data(name, "circuit", DATA / "circuits")
    from nathlon.sim.track import load_track
    from nathlon.sim.track.map import draw_map

    circuit = load_track(name)
    path = out or Path(f"{file_stem(circuit.name)}.png")
    check_output(path, is_file=True)
    draw_map(circuit, path)
    sections = [_described(circuit, section) for section in circuit.sections]
    if as_json:
        print_json({"name": circuit.name, "length_m": circuit.length, "sections": sections, "map": path})
        return
    heads = ("Section", "Kind", "From m", "To m", "Turn", "Least radius m")
    table = new_table(f"{circuit.name}, {circuit.length:.0f} m", heads, ("Section", "Kind", "Turn"))
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
    print_table(table)
    say(f"Map          {path}")


def _described(circuit: Track, section: NamedSection) -> dict[str, Any]:
    """A section with the ways that it bends, in turn, and the least radius of its centre line."""
    import numpy as np

    from nathlon.sim.track import CURVATURE

    rows = slice(int(section.start_m / circuit.spacing), int(section.end_m / circuit.spacing) + 1)
    curvature = circuit.table[rows, CURVATURE]
    bends = curvature[np.abs(curvature) > 1.0 / STRAIGHT_RADIUS_M]
    facts = {"name": section.name, "kind": section.kind, "start_m": section.start_m, "end_m": section.end_m}
    if section.kind == "straight" or not len(bends):
        return {**facts, "turns": [], "least_radius_m": None}
    turns = ["left" if bend > 0 else "right" for bend, _ in groupby(np.sign(bends))]
    return {**facts, "turns": turns, "least_radius_m": float(1.0 / np.abs(bends).max())}
