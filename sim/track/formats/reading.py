"""What a file holds, by its contents: whatever it is called, the reader that fits."""

from __future__ import annotations

import codecs
import re
from dataclasses import replace
from pathlib import Path

import numpy as np

from nathlon.sim.errors import InputError
from nathlon.sim.track.formats.commonroad import read_commonroad
from nathlon.sim.track.formats.fast_lane import is_fast_lane, read_fast_lane
from nathlon.sim.track.formats.fastest_lap import read_arrays
from nathlon.sim.track.formats.maps import read_geojson, read_gpx, read_kml, read_osm
from nathlon.sim.track.formats.markup import parse
from nathlon.sim.track.formats.outline import CircuitLine
from nathlon.sim.track.formats.segments import read_arcs, read_torcs
from nathlon.sim.track.formats.tables import read_table
from nathlon.sim.track.projection import local_metres
from nathlon.sim.untrusted_file import read_bytes

MOST_MIB = 16
ENDINGS = frozenset(
    (".csv", ".txt", ".tsv", ".dat", ".xml", ".gpx", ".kml", ".osm", ".json", ".geojson", ".ai")
)
"""Of files that a folder is searched for; a file by itself may have any."""
BY_ROOT = {
    "gpx": read_gpx,
    "kml": read_kml,
    "osm": read_osm,
    "commonRoad": read_commonroad,
    "params": read_torcs,
}
KNOWN = "expected a table, GeoJSON, GPX, KML, OpenStreetMap, CommonRoad, TORCS, fastest-lap or fast_lane.ai"


def read_outline(path: Path) -> CircuitLine:
    """Read a file that describes a circuit, and with `x_left.kml` the right edge in `x_right.kml` beside it.

    Raises:
        InputError: if it cannot be read, or is of no kind that is known, or says what cannot be.
    """
    edges = edge_files(path)
    if edges is None:
        return _outline_of(path)
    left, right = map(_outline_of, edges)
    if left.origin is None or right.origin is None or left.right_edge is not None:
        return _outline_of(path)
    beside = local_metres(np.array([left.origin, right.origin]))[1]
    note = f"{edges[0].name} and {edges[1].name} taken for the edges"
    return replace(
        left, dialect=f"{left.dialect}, two edges", right_edge=right.line + beside, notes=(*left.notes, note)
    )


def edge_files(path: Path) -> tuple[Path, Path] | None:
    """The files with the left and the right edge, where a file and one beside it are called so."""
    for one, other in (("left", "right"), ("Left", "Right")):
        files = [path.with_name(path.name.replace(other, one)), path.with_name(path.name.replace(one, other))]
        if files[0] != files[1] and path in files and all(file.is_file() for file in files):
            return files[0], files[1]
    return None


def _outline_of(path: Path) -> CircuitLine:
    content = read_bytes(path, MOST_MIB, "centre line")
    try:
        return _outline(content)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None


def _outline(content: bytes) -> CircuitLine:
    if is_fast_lane(content):
        return read_fast_lane(content)
    if content.startswith(b"PK\x03\x04"):
        raise InputError("an archive (KMZ is one), expected the file that is in it")
    text = _text(content)
    begun = text.lstrip()
    if begun.startswith("<"):
        return _markup(text.lstrip())
    if re.match(r"[{\[]", begun):
        return read_geojson(text)
    return read_table(text)


def _markup(text: str) -> CircuitLine:
    root = parse(text)
    if root.tag in BY_ROOT:
        return BY_ROOT[root.tag](root)
    if root.tag == "circuit" or root.find("data/centerline") is not None:
        return read_arrays(root, text)
    if root.get("type") == "straight-and-curve" or root.find("corner") is not None:
        return read_arcs(root)
    raise InputError(f"XML of <{root.tag[:40]}>, {KNOWN}")


def _text(content: bytes) -> str:
    """The text of a file in UTF-8, in UTF-16 with or without its mark, or in one byte a letter.

    Raises:
        InputError: if it is none.
    """
    for mark, encoding in (
        (codecs.BOM_UTF8, "utf-8-sig"),
        (codecs.BOM_UTF16_LE, "utf-16"),
        (codecs.BOM_UTF16_BE, "utf-16"),
    ):
        if content.startswith(mark):
            return _decoded(content, encoding)
    # Letters of Western texts have a zero byte in UTF-16.
    if b"\0" in content[:2]:
        return _decoded(content, "utf-16-le" if content[1:2] == b"\0" else "utf-16-be")
    try:
        text = content.decode("utf-8")
    except UnicodeDecodeError:
        text = content.decode("latin-1")
    if re.search(r"[\0-\x08\x0e-\x1f]", text):
        raise InputError(f"not a text file, {KNOWN}")
    return text


def _decoded(content: bytes, encoding: str) -> str:
    try:
        return content.decode(encoding)
    except UnicodeDecodeError as error:
        raise InputError(
            f"byte {error.start} is not {encoding.upper()}, expected one encoding throughout"
        ) from None
