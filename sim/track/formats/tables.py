"""Tables of points: a line a point, whatever stands between its cells."""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from nathlon.sim.errors import InputError
from nathlon.sim.names import printable, proper_name
from nathlon.sim.track.formats.outline import (
    METRES,
    CircuitLine,
    check_most,
    known_heights,
    to_number,
)

COMMENTS = ("#", "%", "//")
SEPARATORS = (";", "\t", ",", "|", " ")
LOOKED_AT = 50
"""Lines of a file that tell how its cells are separated."""
WIDEST_M = 50.0
"""From the centre line to an edge, where no column name says that it is one."""
DECIMAL_COMMA = re.compile(r"[+-]?\d*,\d+(?:[eE][+-]?\d+)?")
UNIT = re.compile(r"(.+?)_(m|km|cm|mm|ft|deg|degrees|degree|rad)")
EXPECTED = "expected columns named x_m and y_m (or lon and lat), and w_tr_right_m and w_tr_left_m if known"

_AXES = ("{}", "pos_{}", "{}_pos", "position_{}", "p{}", "utm_{}", "{}_ref", "{}_center", "center_{}")
_CENTRES = ("{}_centre", "centre_{}", "{}_c", "{}c", "c{}", "centerline_{}", "centreline_{}", "{}_centerline")
_SIDES = (
    "w_tr_{}",
    "tr_{}",
    "width_{}",
    "{}_width",
    "w_{}",
    "{}_w",
    "{}",
    "dist_{}",
    "distance_{}",
    "tr_width_{}",
)
_EDGES = (
    "{0}_{1}",
    "{1}_{0}",
    "{0}_{1}_m",
    "{1}_bound_{0}",
    "{1}_boundary_{0}",
    "{0}_bound_{1}",
    "{1}_edge_{0}",
)


def _axis(axis: str, *others: str) -> tuple[str, ...]:
    return (*(form.format(axis) for form in (*_AXES, *_CENTRES)), *others)


ROLES: dict[str, tuple[str, ...]] = {
    "x": _axis("x", "easting", "east", "utm_easting", "utm_e"),
    "y": _axis("y", "northing", "north", "utm_northing", "utm_n"),
    "lon": ("lon", "longitude", "lng", "long"),
    "lat": ("lat", "latitude"),
    "height": ("z", "height", "elevation", "elev", "ele", "altitude", "alt", "z_ref", "z_center", "center_z"),
    "right": (*(form.format("right") for form in _SIDES), "wr", "w_r", "width_r", "nr"),
    "left": (*(form.format("left") for form in _SIDES), "wl", "w_l", "width_l", "nl"),
    "width": ("width", "w", "track_width", "road_width", "w_tr", "tr_width"),
    "bank": ("bank", "banking", "bank_angle"),
    **{
        f"{axis}_{side}": tuple(form.format(axis, name) for name in names for form in _EDGES)
        for axis in "xy"
        for side, names in (
            *(("left", ("left", "l")), ("right", ("right", "r"))),
            *(("inner", ("inner", "inside", "in")), ("outer", ("outer", "outside", "out"))),
        )
    },
}
"""Names of columns, without units, in lower case: the first that a file has counts."""


class _Column(NamedTuple):
    place: int
    name: str
    unit: str


class _Table(NamedTuple):
    """Cells as numbers of the file's own units, (n, columns); nan in columns that nobody asks for."""

    columns: dict[str, _Column]
    rows: list[list[str]]
    places: list[str]

    def numbers(self, role: str) -> NDArray[np.float64]:
        place, name, _ = self.columns[role]
        return np.array(
            [to_number(row[place], at, name) for row, at in zip(self.rows, self.places, strict=True)]
        )

    def metres(self, role: str) -> NDArray[np.float64]:
        return self.numbers(role) * METRES.get(self.columns[role].unit, 1.0)


def read_table(text: str) -> CircuitLine:
    """Read a table with the points of a circuit.

    Columns go by their names: of the centre line, or of both edges; others are left out. Without names there
    are two, x and y, or four with the distances to the right and the left edge, an index before them or not.

    Raises:
        InputError: if there are no columns with coordinates, or a cell of theirs is no number.
    """
    table, notes = _columns(*_cells(text))
    if not table.rows:
        raise InputError("no points, " + EXPECTED)
    for one, other, unit in (("x", "y", None), ("lon", "lat", "degrees")):
        if {one, other} <= table.columns.keys():
            return _along_centre(table, one, other, unit, notes)
    for one, other in (("left", "right"), ("inner", "outer")):
        if {f"x_{one}", f"y_{one}", f"x_{other}", f"y_{other}"} <= table.columns.keys():
            return _between_edges(table, one, other, notes)
    raise InputError(f"{table.places[0]}: {EXPECTED}")


def _along_centre(table: _Table, x: str, y: str, unit: str | None, notes: list[str]) -> CircuitLine:
    named = table.columns[x].unit
    line = np.column_stack([table.numbers(x), table.numbers(y)])
    right = left = None
    if {"right", "left"} <= table.columns.keys():
        right, left = table.metres("right"), table.metres("left")
    elif "width" in table.columns:
        right = left = table.metres("width") / 2.0
    height = known_heights(table.metres("height")) if "height" in table.columns else None
    bank = None
    if "bank" in table.columns:
        bank = table.numbers("bank")
        bank = np.radians(bank) if table.columns["bank"].unit.startswith("deg") else bank
    if named in METRES and named != "m":
        line *= METRES[named]
        notes.append(f"{named} made metres")
    return CircuitLine(
        "a table",
        line,
        table.places,
        unit="degrees" if unit or named.startswith("deg") else "m" if named else "unknown",
        right=right,
        left=left,
        height=height,
        bank=bank,
        surveyed=unit is None and not named.startswith("deg"),
        notes=tuple(notes),
    )


def _between_edges(table: _Table, one: str, other: str, notes: list[str]) -> CircuitLine:
    first, second = (
        np.column_stack([table.metres(f"{axis}_{side}") for axis in "xy"]) for side in (one, other)
    )
    if one == "inner" and _turns_right(first):
        first, second = second, first
    return CircuitLine("a table of edges", first, table.places, right_edge=second, notes=tuple(notes))


def _turns_right(line: NDArray[np.float64]) -> bool:
    x, y = (line - line[0]).T
    return float(x @ np.roll(y, -1) - y @ np.roll(x, -1)) < 0.0


def _cells(text: str) -> tuple[list[str] | None, list[list[str]], list[str]]:
    """Names of columns if there are any, cells of each point, and where it stands."""
    lines = [(number, line.strip()) for number, line in enumerate(text.splitlines(), start=1)]
    said = [(number, line) for number, line in lines if line and not line.startswith(COMMENTS)]
    if not said:
        raise InputError("no points, " + EXPECTED)
    check_most(len(said), "the table")
    separator = _separator([line for _, line in said[:LOOKED_AT]])
    rows = [_split(line.partition(" #")[0], separator, number) for number, line in said]
    names = None
    if sum(map(_is_number, rows[0])) < 2:
        names, rows, said = rows[0], rows[1:], said[1:]
    elif said[0][0] > 1:
        above = lines[said[0][0] - 2][1].lstrip("#%/ \t")
        candidate = _split(above, separator, said[0][0] - 1)
        names = candidate if len(candidate) == len(rows[0]) and not any(map(_is_number, candidate)) else None
    count = len(names or rows[0])
    for (number, _), row in zip(said, rows, strict=True):
        while len(row) > count and not row[-1]:
            row.pop()
        if len(row) != count:
            expected = printable(",".join(names)) if names else f"{count} as above"
            raise InputError(f"line {number}: {len(row)} columns, expected {expected[:100]}")
    commas = any(DECIMAL_COMMA.fullmatch(cell) for row in rows for cell in row)
    if commas:
        if any("." in cell and _is_number(cell) for row in rows for cell in row):
            raise InputError("decimal commas and decimal points are mixed, expected one of them")
        rows = [
            [cell.replace(",", ".") if DECIMAL_COMMA.fullmatch(cell) else cell for cell in row]
            for row in rows
        ]
    return names, rows, [f"line {number}" for number, _ in said]


def _separator(lines: Sequence[str]) -> str:
    """The one that leaves the largest share of cells numbers, in at least two columns."""

    def worth(separator: str) -> tuple[float, int]:
        cells = [cell for line in lines for cell in _split(line, separator, 0)]
        numbers = sum(map(_is_number, cells))
        return (numbers / len(cells) if numbers > len(lines) else 0.0), -SEPARATORS.index(separator)

    return max(SEPARATORS, key=worth)


def _split(line: str, separator: str, number: int) -> list[str]:
    if separator == " ":
        return [cell.strip("\"'") for cell in line.split()]
    try:
        (cells,) = csv.reader([line], delimiter=separator, skipinitialspace=True)
    except (csv.Error, ValueError):
        raise InputError(f"line {number}: expected cells with {separator!r} between") from None
    return [cell.strip().strip("\"'") for cell in cells]


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return DECIMAL_COMMA.fullmatch(cell) is not None
    return True


def _columns(names: list[str] | None, rows: list[list[str]], places: list[str]) -> tuple[_Table, list[str]]:
    if names is None:
        return _unnamed(rows, places)
    found: dict[str, _Column] = {}
    for place, name in enumerate(names):
        plain = re.sub(r"[^a-z0-9]+", "_", name.lstrip("#%/ ").lower()).strip("_")
        base, unit = matched.groups() if (matched := UNIT.fullmatch(plain)) else (plain, "")
        found.setdefault(base, _Column(place, proper_name(name.lstrip("#%/ ")) or plain, unit))
    columns = {
        role: next(found[name] for name in known if name in found)
        for role, known in ROLES.items()
        if any(name in found for name in known)
    }
    return _Table(columns, rows, places), []


def _unnamed(rows: list[list[str]], places: list[str]) -> tuple[_Table, list[str]]:
    fields = ["x", "y", "right", "left"]
    start = int(len(rows[0]) in (3, 5) and _counts(rows))
    width = len(rows[0]) - start
    note = "no column names: taken as x, y" + (
        ", and the distances to the right and left edge" if width == 4 else ""
    )
    if width == 3:
        width, note = 2, note + "; the third column is left out"
    if width not in (2, 4):
        raise InputError(f"{places[0]}: {len(rows[0])} columns without names, " + EXPECTED)
    columns = {field: _Column(start + place, field, "") for place, field in enumerate(fields[:width])}
    table = _Table(columns, rows, places)
    if width == 4 and not all(
        0.0 < value < WIDEST_M for role in ("right", "left") for value in table.numbers(role)
    ):
        raise InputError(f"{places[0]}: four columns without names that are not x, y and widths, " + EXPECTED)
    return table, [note]


def _counts(rows: list[list[str]]) -> bool:
    """Whether the first column is an index."""
    first = [row[0] for row in rows]
    return any(first == [str(place) for place in range(start, start + len(first))] for start in (0, 1))
