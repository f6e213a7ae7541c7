"""Circuits from files that describe them, in any dialect that `nathlon.sim.track.formats` reads.

What a file does not say (kerbs, run-off, walls, mostly heights and banking) `nathlon.sim.track.layout` adds;
without heights the circuit is level but for bridges where it crosses itself.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.interpolate import CubicSpline
from scipy.ndimage import gaussian_filter1d, maximum_filter1d, uniform_filter1d
from scipy.sparse.linalg import spsolve

from nathlon.sim.errors import InputError
from nathlon.sim.names import check_new_name
from nathlon.sim.track.circuit_folder import Circuit, new_folder, write_circuit
from nathlon.sim.track.crossing import LEAST_CLEARANCE_M, bridge_heights
from nathlon.sim.track.formats.reading import read_outline
from nathlon.sim.track.lap_line import MODEL, LapLine, lap_line
from nathlon.sim.track.layout import (
    FOLD,
    LEAST_ANGLE_DEGREES,
    ROWS_PER_POINT,
    Road,
    Roadside,
    edges_cross,
    lay_out,
)

LEAST_RADIUS_M = 6.0
STEEPEST = 0.05
"""Of a ramp to a bridge."""
SMOOTHED_M = 50.0
"""Waves of this length are halved by the smoothing, shorter ones vanish."""
TOLERANCE_M, MAP_TOLERANCES_M, TOLERANCE_OVER_M = 0.2, (1.0, 2.0, 4.0), 15.0
"""How far the smoothed line may lie beside the data, in the mean over a stretch; for points of a map the
first of some with which cars can follow the road."""
TRIM_M = 2.0
"""How far an inner edge may move."""
STEEPEST_ROAD, SHARPEST_CREST = 0.2, 0.005
"""Largest slope that a file's heights may have, and largest change of it, 1/m; they are smoothed so far."""
HEIGHTS_OVER_M, MOST_SMOOTHED_M = 10.0, 300.0
STEEPEST_BANK, BANK_OVER_M = 0.5, 8.0


class Imported(NamedTuple):
    """A circuit made of a file.

    Attributes:
        path: of the circuit's TOML file.
        dialect: what the file was read as, in words.
        notes: what was assumed, converted or left out, in short sentences.
    """

    path: Path
    dialect: str
    notes: tuple[str, ...]


def _road_through(points: NDArray[np.float64]) -> Road:
    """The road through points (n, 4) of a closed line and distances to right and left edge, in even rows."""
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


def _smoothed(road: Road, tolerance_m: float) -> NDArray[np.float64]:
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
        off = np.abs(uniform_filter1d(beside, road.rows(TOLERANCE_OVER_M), mode="wrap")) > tolerance_m
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


def smooth_road(points: NDArray[np.float64], tolerance_m: float) -> Road:
    """The road through points, smoothed as far as it stays within a mean distance of the data over 15 m.

    In hairpins about as tight as half the road is wide, the inner edge moves by up to 2 m.

    Args:
        points: (n, 4) x, y, distance to the right and the left edge, m.
        tolerance_m: the largest mean distance.

    Raises:
        InputError: if no car could follow the road, or its edges cross; the message lacks the file's path.
    """
    raw = _road_through(points)
    road = _trimmed(_road_through(np.column_stack([_smoothed(raw, tolerance_m), raw.right, raw.left])))
    sharpest = int(np.argmax(np.abs(road.curvature)))
    radius = 1.0 / max(abs(road.curvature[sharpest]), 1e-9)
    if radius < LEAST_RADIUS_M:
        raise InputError(
            f"{_place(road, sharpest)} the road bends with a radius of {radius:.1f} m, "
            f"expected at least {LEAST_RADIUS_M:g} m: {MODEL}"
        )
    try:
        crossing = edges_cross(road)
    except InputError as error:
        raise InputError(f"x_m, y_m: {error}") from None
    if crossing is not None:
        raise InputError(
            f"{_place(road, crossing)} the edges given by w_tr_right_m and w_tr_left_m cross, "
            f"expected a road that meets itself only at bridges, at {LEAST_ANGLE_DEGREES:g} degrees or more; "
            "--width sets a narrower one"
        )
    return road


def _drivable_road(lap: LapLine) -> tuple[Road, tuple[str, ...]]:
    """The road of a lap; points of a map are followed no closer than makes a road of them."""
    tolerances = (TOLERANCE_M,) if lap.surveyed else MAP_TOLERANCES_M
    for tolerance in tolerances[:-1]:
        try:
            return smooth_road(lap.points, tolerance), ()
        except InputError:
            continue
    note = (
        () if lap.surveyed else (f"smoothed by up to {tolerances[-1]:g} m for a road that cars can follow",)
    )
    return smooth_road(lap.points, tolerances[-1]), note


def _along_road(lap: LapLine, values: NDArray[np.float64], road: Road) -> NDArray[np.float64]:
    """Values at points of the lap at the rows of its road, by their share of the lap, (n,)."""
    closed = np.vstack([lap.points[:, :2], lap.points[:1, :2]])
    at = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(closed, axis=0).T))])
    rows = np.arange(len(road.position)) / len(road.position)
    return np.interp(rows, at / at[-1], np.append(values, values[0]))


def _heights(lap: LapLine, road: Road) -> tuple[NDArray[np.float64], str, tuple[str, ...]]:
    """Heights of the centre line, m, (n,), what they are in words, and a note."""
    note: tuple[str, ...] = ()
    if lap.height is not None:
        height = _smooth_heights(_along_road(lap, lap.height, road), road)
        if all(abs(height[one] - height[other]) > LEAST_CLEARANCE_M for one, other, _ in road.crossings):
            return height, f"{np.ptp(height):.0f} m from its lowest to its highest place", note
        note = (
            "the file's heights are left out: where the road crosses itself they leave no room for a bridge",
        )
    height = bridge_heights(road.crossings, len(road.position), road.spacing)
    slope = np.abs(np.roll(height, -1) - height) / road.spacing
    steepest = int(np.argmax(slope))
    if slope[steepest] > STEEPEST:
        raise InputError(
            f"{_place(road, steepest)} a bridge over the road itself would need a slope of "
            f"{100 * slope[steepest]:.0f} %, expected at most {100 * STEEPEST:.0f} %"
        )
    bridges = len(road.crossings)
    profile = f"level but for {bridges} {'bridge' if bridges == 1 else 'bridges'}" if bridges else "level"
    return height, profile, note


def _smooth_heights(height: NDArray[np.float64], road: Road) -> NDArray[np.float64]:
    """Heights from the first row, smoothed until cars can follow them."""
    over = HEIGHTS_OVER_M
    while True:
        smooth = gaussian_filter1d(height, over / road.spacing, mode="wrap")
        slope = (np.roll(smooth, -1) - smooth) / road.spacing
        crest = (slope - np.roll(slope, 1)) / road.spacing
        over *= 1.5
        even = np.abs(slope).max() < STEEPEST_ROAD and np.abs(crest).max() < SHARPEST_CREST
        if even or over > MOST_SMOOTHED_M:
            return smooth - smooth[0]


def _banks(lap: LapLine, road: Road) -> NDArray[np.float64]:
    """Banking of the rows, rad, (n,)."""
    if lap.bank is None:
        return np.zeros(len(road.position))
    bank = gaussian_filter1d(_along_road(lap, lap.bank, road), BANK_OVER_M / road.spacing, mode="wrap")
    return np.clip(bank, -STEEPEST_BANK, STEEPEST_BANK)


def _place(road: Road, row: int) -> str:
    x, y = road.position[row]
    return f"near x_m {x:.0f}, y_m {y:.0f}"


def import_circuit(
    source: Path, name: str, folder: Path, width: float | None = None, scale: float = 1.0
) -> Imported:
    """Make the circuit folder `folder/name` from a file that describes the circuit.

    Args:
        source: a file of any dialect that `nathlon.sim.track.formats` reads.
        name: of the circuit: lowercase letters, digits and hyphens.
        folder: where the circuit's folder goes; made if it is not there.
        width: of the road, m, instead of the file's widths; if there is neither, it is guessed.
        scale: by which everything in the file is multiplied; not `width`.

    Raises:
        InputError: if the name or the file is not as expected, the circuit's folder is there already, or
            it cannot be written.
    """
    check_new_name(name)
    target = new_folder(folder, name)
    outline = read_outline(source)
    try:
        lap = lap_line(outline, width, scale)
        road, smoothed = _drivable_road(lap)
        height, profile, left_out = _heights(lap, road)
    except InputError as error:
        raise InputError(f"{source}: {error}") from None
    facts, wall_right, wall_left = lay_out(road, name, profile, Roadside())
    bank = _banks(lap, road)
    table = np.column_stack([road.position, height, road.right, road.left, bank, wall_right, wall_left])
    origin = f"Imported from {outline.dialect}; what it lacks follows from its shape."
    path = write_circuit(target, Circuit(facts, table[::ROWS_PER_POINT]), origin)
    return Imported(path, outline.dialect, (*lap.notes, *smoothed, *left_out))
