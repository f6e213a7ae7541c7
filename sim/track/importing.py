"""Circuits from the racetrack database of TUM (github.com/TUMFTM/racetrack-database).

A file there holds the centre line of a real circuit and the widths to the edges, in driving order from
the start line. It says nothing of heights, banking, kerbs or walls: the circuit made of it is level but for
bridges where it crosses itself, and `nathlon.sim.track.layout` adds the rest.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.interpolate import CubicSpline
from scipy.ndimage import maximum_filter1d, uniform_filter1d
from scipy.sparse.linalg import spsolve

from nathlon.sim.errors import InputError
from nathlon.sim.names import check_new_name
from nathlon.sim.track.centre_line import check_count, check_turns
from nathlon.sim.track.circuit_folder import Circuit, new_folder, write_circuit
from nathlon.sim.track.crossing import bridge_heights
from nathlon.sim.track.layout import (
    FOLD,
    LEAST_ANGLE_DEGREES,
    ROWS_PER_POINT,
    Road,
    Roadside,
    edges_cross,
    lay_out,
)

FIELDS = ("x_m", "y_m", "w_tr_right_m", "w_tr_left_m")
LARGEST_GAP_M = 50.0
LEAST_LENGTH_M, LARGEST_LENGTH_M = 500.0, 30_000.0
LEAST_WIDTH_M, LEAST_RADIUS_M = 4.0, 6.0
STEEPEST = 0.05
SMOOTHED_M = 50.0
"""Waves of this length are halved by the smoothing, shorter ones vanish."""
TOLERANCE_M, TOLERANCE_OVER_M = 0.2, 15.0
"""How far the smoothed line may lie beside the data, in the mean over a stretch."""
TRIM_M = 2.0
"""How far an inner edge may move."""


def read_racetrack(path: Path) -> NDArray[np.float64]:
    """Read and check a file of the racetrack database.

    A first point that is repeated at the end is left out. Nothing in a file tells whether the whole of
    it runs against the driving direction; points that turn back on themselves do not pass.

    Returns:
        (n, 4) float64, columns as in FIELDS, m.

    Raises:
        InputError: if the file cannot be read or does not describe a closed road.
    """
    try:
        lines = path.read_text("utf-8-sig").splitlines()
    except UnicodeDecodeError:
        raise InputError(f"{path}: not a text file; expected lines of {','.join(FIELDS)}") from None
    except OSError as error:
        raise InputError(f"{path}: cannot read the centre line: {error.strerror}") from None
    if not lines or tuple(cell.strip(" #") for cell in lines[0].split(",")) != FIELDS:
        raise InputError(f"{path}: line 1: expected the column names # {','.join(FIELDS)}")
    while len(lines) > 1 and not lines[-1].strip():
        lines.pop()
    check_count(path, len(lines) - 1)
    points = np.array([_numbers(path, number, line) for number, line in enumerate(lines[1:], start=2)])
    if np.hypot(*(points[0, :2] - points[-1, :2])) < 0.01:
        points = points[:-1]
    _check_line(path, points[:, :2])
    _check_widths(path, points)
    return points


def _numbers(path: Path, number: int, line: str) -> list[float]:
    cells = line.split(",")
    if len(cells) != len(FIELDS):
        raise InputError(f"{path}: line {number}: {len(cells)} columns, expected {','.join(FIELDS)}")
    numbers = []
    for field, cell in zip(FIELDS, cells, strict=True):
        try:
            numbers.append(float(cell))
        except ValueError:
            raise InputError(
                f"{path}: line {number}: {field} is {cell.strip()!r}, expected a number"
            ) from None
        if not abs(numbers[-1]) < 1e6:
            raise InputError(
                f"{path}: line {number}: {field} is {cell.strip()}, expected less than 1e6 metres"
            )
    return numbers


def _check_line(path: Path, points: NDArray[np.float64]) -> None:
    steps = np.roll(points, -1, axis=0) - points
    gaps = np.hypot(*steps.T)
    if (gaps < 0.01).any():
        raise InputError(f"{path}: line {np.argmin(gaps) + 3}: x_m, y_m: expected no point twice in a row")
    usual, widest = float(np.median(gaps[:-1])), float(gaps[:-1].max())
    if gaps[-1] > max(3 * usual, 1.01 * widest):
        raise InputError(
            f"{path}: x_m, y_m: the last point lies {gaps[-1]:.1f} m from the first and the others "
            f"at most {widest:.1f} m apart, expected a closed line"
        )
    if gaps.max() > LARGEST_GAP_M:
        raise InputError(
            f"{path}: line {np.argmax(gaps) + 3}: x_m, y_m: {gaps.max():.1f} m from the point before, "
            f"expected at most {LARGEST_GAP_M:g} m"
        )
    if not LEAST_LENGTH_M <= gaps.sum() <= LARGEST_LENGTH_M:
        raise InputError(
            f"{path}: x_m, y_m: a lap of {gaps.sum():.0f} m, "
            f"expected {LEAST_LENGTH_M:g} to {LARGEST_LENGTH_M:g} m"
        )
    check_turns(path, points)


def _check_widths(path: Path, points: NDArray[np.float64]) -> None:
    for column in (2, 3):
        at = int(np.argmin(points[:, column]))
        if points[at, column] <= 0:
            raise InputError(
                f"{path}: line {at + 2}: {FIELDS[column]} is {points[at, column]:g}, "
                "expected a positive distance from the centre line to the edge"
            )
    widths = points[:, 2] + points[:, 3]
    if widths.min() < LEAST_WIDTH_M:
        raise InputError(
            f"{path}: line {np.argmin(widths) + 2}: w_tr_right_m + w_tr_left_m is {widths.min():.2f}, "
            f"expected a road at least {LEAST_WIDTH_M:g} m wide"
        )


def _road_through(points: NDArray[np.float64]) -> Road:
    """The road through the points of a closed line, (n, 4), columns as in FIELDS, in rows of even length."""
    closed = np.vstack([points, points[:1]])
    chord = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(closed[:, :2], axis=0).T))])
    line = CubicSpline(chord, closed[:, :2], bc_type="periodic")
    fine = np.linspace(0.0, chord[-1], 20 * len(points) + 1)
    arc = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(line(fine), axis=0).T))])
    rows = ROWS_PER_POINT * round(arc[-1] / ROWS_PER_POINT)
    at = np.interp(np.arange(rows) * (arc[-1] / rows), arc, fine)
    first, second = line(at, 1), line(at, 2)
    speed = np.hypot(*first.T)
    return Road(
        position=line(at),
        tangent=first / speed[:, None],
        curvature=(first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]) / speed**3,
        right=np.interp(at, chord, closed[:, 2]),
        left=np.interp(at, chord, closed[:, 3]),
        spacing=float(arc[-1]) / rows,
    )


def _smoothed(road: Road) -> NDArray[np.float64]:
    """Centre line without the noise that a car would feel as bends, (n, 2).

    The least sum of squared distances from the data and squared changes of curvature, as a periodic
    smoothing spline has it (Whittaker, 1923, with third differences). Where that cuts a corner by more
    than the tolerance, the data weighs more until it does not.
    """
    rows = len(road.position)
    ahead = sparse.csc_array((np.ones(rows), (np.arange(rows), np.roll(np.arange(rows), -1))))
    difference = ahead - sparse.eye_array(rows, format="csc")
    third = difference @ difference @ difference
    penalty = (SMOOTHED_M / (2 * np.pi * road.spacing)) ** 6 * (third.T @ third)
    weight = np.ones(rows)
    while True:
        line = spsolve((sparse.diags_array(weight) + penalty).tocsc(), weight[:, None] * road.position)
        beside = ((line - road.position) * road.normal).sum(axis=1)
        off = np.abs(uniform_filter1d(beside, road.rows(TOLERANCE_OVER_M), mode="wrap")) > TOLERANCE_M
        if not off.any():
            return line
        weight[maximum_filter1d(off, road.rows(SMOOTHED_M / 2), mode="wrap")] *= 2.0


def _trimmed(road: Road) -> Road:
    """The road with its inner edges moved a little, to where they do not fold over in hairpins."""

    def trim(width: NDArray[np.float64], inward: NDArray[np.float64]) -> NDArray[np.float64]:
        # As sharp as anywhere between the points that are written.
        sharpest = maximum_filter1d(np.maximum(inward, 1e-9), 2 * ROWS_PER_POINT + 1, mode="wrap")
        return np.clip(FOLD / sharpest, width - TRIM_M, width)

    return replace(road, left=trim(road.left, road.curvature), right=trim(road.right, -road.curvature))


def smooth_road(path: Path, points: NDArray[np.float64]) -> Road:
    """The road of a file, smoothed as far as it stays within a mean of 0.2 m beside the data over 15 m.

    In hairpins about as tight as half the road is wide, the inner edge moves by up to 2 m.

    Args:
        path: the file, for errors.
        points: (n, 4), as `read_racetrack` returns them.

    Raises:
        InputError: if no car could follow the road, or its edges cross.
    """
    raw = _road_through(points)
    road = _trimmed(_road_through(np.column_stack([_smoothed(raw), raw.right, raw.left])))
    sharpest = int(np.argmax(np.abs(road.curvature)))
    radius = 1.0 / max(abs(road.curvature[sharpest]), 1e-9)
    if radius < LEAST_RADIUS_M:
        raise InputError(
            f"{path}: {_place(road, sharpest)} the road bends with a radius of {radius:.1f} m, "
            f"expected at least {LEAST_RADIUS_M:g} m"
        )
    try:
        crossing = edges_cross(road)
    except InputError as error:
        raise InputError(f"{path}: x_m, y_m: {error}") from None
    if crossing is not None:
        raise InputError(
            f"{path}: {_place(road, crossing)} the edges given by w_tr_right_m and w_tr_left_m cross, "
            f"expected a road that meets itself only at bridges, at {LEAST_ANGLE_DEGREES:g} degrees or more"
        )
    return road


def _heights(path: Path, road: Road) -> NDArray[np.float64]:
    """Heights of the centre line, m, (n,)."""
    height = bridge_heights(road.crossings, len(road.position), road.spacing)
    slope = np.abs(np.roll(height, -1) - height) / road.spacing
    steepest = int(np.argmax(slope))
    if slope[steepest] > STEEPEST:
        raise InputError(
            f"{path}: {_place(road, steepest)} a bridge over the road itself would need a slope of "
            f"{slope[steepest]:.0%}, expected at most {STEEPEST:.0%}"
        )
    return height


def _place(road: Road, row: int) -> str:
    x, y = road.position[row]
    return f"near x_m {x:.0f}, y_m {y:.0f}"


def import_circuit(source: Path, name: str, folder: Path) -> Path:
    """Make the circuit folder `folder/name` from a file of the racetrack database.

    Args:
        source: CSV file with the columns FIELDS.
        name: of the circuit: lowercase letters, digits and hyphens.
        folder: where the circuit's folder goes; made if it is not there.

    Returns:
        the path of the circuit's TOML file.

    Raises:
        InputError: if the name or the file is not as expected, the circuit's folder is there already, or
            it cannot be written.
    """
    check_new_name(name)
    target = new_folder(folder, name)
    road = smooth_road(source, read_racetrack(source))
    bridges = len(road.crossings)
    profile = f"level but for {bridges} {'bridge' if bridges == 1 else 'bridges'}" if bridges else "level"
    facts, wall_right, wall_left = lay_out(road, name, profile, Roadside())
    height, bank = _heights(source, road), np.zeros(len(road.position))
    table = np.column_stack([road.position, height, road.right, road.left, bank, wall_right, wall_left])
    origin = "Imported from a centre line; what it lacks follows from its shape."
    return write_circuit(target, Circuit(facts, table[::ROWS_PER_POINT]), origin)
