"""Circuits: a closed centre line with widths and walls, sampled evenly along its length."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field
from scipy.interpolate import CubicSpline

from sim.data_file import read_toml
from sim.errors import InputError

CIRCUITS = Path(__file__).parent / "data" / "circuits"
SPACING_M = 2.0
COLUMNS = ("x_m", "y_m", "w_tr_right_m", "w_tr_left_m", "wall_right_m", "wall_left_m")

# Columns of `Track.table`, so that what one look-up needs lies in one cache line.
X, Y, TANGENT_X, TANGENT_Y, CURVATURE, LEFT, RIGHT, WALL_LEFT, WALL_RIGHT = range(9)
LEFT_X, LEFT_Y, RIGHT_X, RIGHT_Y = range(9, 13)
TABLE_WIDTH = 16

Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]


class _Section(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class Grid(_Section):
    """Where the starting places lie."""

    pole_m: float
    spacing_m: Positive
    lateral_m: Annotated[float, Field(ge=0)]


class Corner(_Section):
    """A named stretch of the circuit."""

    name: str
    start_m: Annotated[float, Field(ge=0)]
    end_m: Annotated[float, Field(ge=0)]


class CircuitFile(_Section):
    """The circuit's TOML file."""

    name: str
    description: str
    centre_line: str
    kerb_width_m: Annotated[float, Field(ge=0)]
    verge_grip: Annotated[float, Field(gt=0, le=1)]
    verge_rolling_resistance: Annotated[float, Field(ge=0)]
    grid: Grid
    corner: tuple[Corner, ...] = ()


@dataclass(frozen=True, eq=False)
class Track:
    """A circuit ready to drive on.

    Attributes:
        table: (n, TABLE_WIDTH) float64, one row every `spacing` metres of centre line: position,
            unit tangent, curvature (1/m, + is left), distances from the centre line to edges and
            walls (m), positions of the edges. World frame, x east, y north.
        length: of the centre line, m.
        spacing: of the rows, m.
    """

    name: str
    description: str
    table: NDArray[np.float64]
    length: float
    spacing: float
    kerb_width: float
    verge_grip: float
    verge_rolling_resistance: float
    grid: Grid
    corners: tuple[Corner, ...]

    def offset_line(self, offset: NDArray[np.float64] | float) -> NDArray[np.float64]:
        """The closed line at `offset` metres left of the centre line, (n, 2)."""
        normal = np.stack([-self.table[:, TANGENT_Y], self.table[:, TANGENT_X]], axis=1)
        return self.table[:, [X, Y]] + normal * np.reshape(np.broadcast_to(offset, len(self.table)), (-1, 1))

    def pose(
        self, distance: NDArray[np.float64], lateral: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """World x, y (m) and heading (rad) of points given along (m) and left of (m) the centre line."""
        at = np.mod(distance, self.length) / self.spacing
        low = at.astype(np.int64) % len(self.table)
        share = (at - np.floor(at))[..., None]
        high = (low + 1) % len(self.table)
        row = self.table[low] * (1 - share) + self.table[high] * share
        heading = np.arctan2(row[..., TANGENT_Y], row[..., TANGENT_X])
        x = row[..., X] - np.sin(heading) * lateral
        y = row[..., Y] + np.cos(heading) * lateral
        return x, y, heading


def _read_centre_line(path: Path) -> NDArray[np.float64]:
    try:
        lines = path.read_text("utf-8").split()
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: cannot read the centre line: {error}") from None
    if not lines or tuple(lines[0].split(",")) != COLUMNS:
        raise InputError(f"{path}: first line: expected the column names {','.join(COLUMNS)}")
    try:
        points = np.array([[float(cell) for cell in line.split(",")] for line in lines[1:]])
    except ValueError:
        raise InputError(f"{path}: expected {len(COLUMNS)} numbers on every line") from None
    if points.ndim != 2 or points.shape[1:] != (len(COLUMNS),) or len(points) < 20:
        raise InputError(f"{path}: expected at least 20 lines of {len(COLUMNS)} numbers")
    if not np.isfinite(points).all() or (points[:, 2:] <= 0).any():
        raise InputError(f"{path}: expected finite positions and positive widths on every line")
    if (np.hypot(*(points[:, :2] - np.roll(points[:, :2], 1, axis=0)).T) < 0.01).any():
        raise InputError(
            f"{path}: x_m, y_m: expected no point twice in a row, nor the first again at the end"
        )
    if (points[:, 4:] < points[:, 2:4]).any():
        raise InputError(f"{path}: wall_right_m, wall_left_m: expected walls outside the edges on every line")
    return points


def build_track(points: NDArray[np.float64], facts: CircuitFile) -> Track:
    """A track through the points of a closed centre line.

    Args:
        points: (n, 6) float64, columns as in COLUMNS.
        facts: everything else about the circuit.
    """
    closed = np.vstack([points, points[:1]])
    chord = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(closed[:, :2], axis=0).T))])
    line = CubicSpline(chord, closed[:, :2], bc_type="periodic")
    fine = np.linspace(0.0, chord[-1], 20 * len(points) + 1)
    arc = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(line(fine), axis=0).T))])
    length = float(arc[-1])
    rows = round(length / SPACING_M)
    at = np.interp(np.arange(rows) * (length / rows), arc, fine)
    position, first, second = line(at), line(at, 1), line(at, 2)
    speed = np.hypot(first[:, 0], first[:, 1])
    tangent = first / speed[:, None]
    curvature = (first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]) / speed**3
    widths = np.stack([np.interp(at, chord, closed[:, column]) for column in range(2, 6)], axis=1)
    right, left, wall_right, wall_left = widths.T
    normal = np.stack([-tangent[:, 1], tangent[:, 0]], axis=1)
    table = np.zeros((rows, TABLE_WIDTH))
    table[:, [X, Y]] = position
    table[:, [TANGENT_X, TANGENT_Y]] = tangent
    table[:, CURVATURE] = curvature
    table[:, LEFT], table[:, RIGHT] = left, right
    table[:, WALL_LEFT], table[:, WALL_RIGHT] = wall_left, wall_right
    table[:, [LEFT_X, LEFT_Y]] = position + normal * left[:, None]
    table[:, [RIGHT_X, RIGHT_Y]] = position - normal * right[:, None]
    return Track(
        name=facts.name,
        description=facts.description,
        table=table,
        length=length,
        spacing=length / rows,
        kerb_width=facts.kerb_width_m,
        verge_grip=facts.verge_grip,
        verge_rolling_resistance=facts.verge_rolling_resistance,
        grid=facts.grid,
        corners=facts.corner,
    )


def read_track(path: Path) -> Track:
    """Read and check a circuit file and its centre line.

    Raises:
        InputError: if a file cannot be read, or a field is missing, unknown or out of range.
    """
    facts = read_toml(path, CircuitFile, "circuit file")
    return build_track(_read_centre_line(path.parent / facts.centre_line), facts)


@lru_cache
def load_track(name: str) -> Track:
    """A circuit by its shipped name, or by the path of a `.toml` file.

    Raises:
        InputError: if there is no such circuit or its file is wrong.
    """
    if name.endswith(".toml"):
        return read_track(Path(name))
    path = CIRCUITS / name / "circuit.toml"
    if not path.is_file():
        known = ", ".join(sorted(p.parent.name for p in CIRCUITS.glob("*/circuit.toml")))
        raise InputError(f"circuit {name!r} is unknown; expected one of {known}, or the path of a .toml file")
    return read_track(path)
