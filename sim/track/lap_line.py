"""The centre line of a lap in metres, with widths and heights, made of what a file tells."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from nathlon.sim.errors import InputError
from nathlon.sim.track.centre_line import LEAST_POINTS, MOST_POINTS, SHARPEST_TURN, turns_between
from nathlon.sim.track.closing import graded, lap_of
from nathlon.sim.track.edges import middle_of
from nathlon.sim.track.formats.outline import CircuitLine
from nathlon.sim.track.projection import local_metres

GUESSED_WIDTH_M = 10.0
LEAST_LENGTH_M, LARGEST_LENGTH_M = 300.0, 30_000.0
LEAST_WIDTH_M = 4.0
LARGEST_GAP_M, LARGEST_GAP_STEPS, LARGEST_GAP_ON_MAPS_M = 50.0, 10.0, 2000.0
"""The most between two points: so far, or so many times their usual distance; on maps, of straights."""
DEGREES_LAP, KILOMETRES_LAP = 0.4, 30.0
"""Lengths of a lap in units that are not named: shorter ones are degrees, then kilometres, then metres."""
FAR_M = 100_000.0
"""Coordinates beyond are those of a country: the lap is moved to its first point."""
MODEL = "--scale 10 makes a model of 1:10 as large as it should be"


@dataclass(frozen=True, eq=False)
class LapLine:
    """A closed centre line.

    Attributes:
        points: (n, 4) x, y, distance to the right and to the left edge, m.
        height: (n,) m; none where the file does not say.
        bank: (n,) rad, + where the left is higher; none likewise.
        surveyed: whether points lie where the road is to centimetres.
        notes: what was assumed, converted or left out, in short sentences.
    """

    points: NDArray[np.float64]
    height: NDArray[np.float64] | None
    bank: NDArray[np.float64] | None
    surveyed: bool
    notes: tuple[str, ...]


def lap_line(outline: CircuitLine, width: float | None = None, scale: float = 1.0) -> LapLine:
    """Make the centre line of a lap of what a file tells.

    Args:
        outline: what it tells.
        width: of the road, m, instead of the file's widths; if there is neither, it is guessed.
        scale: by which everything in the file is multiplied; not `width`.

    Raises:
        InputError: if it is no closed road; the message lacks the file's path.
    """
    outline, notes = _in_metres(outline)
    if not 0.0 < scale < 1e4:
        raise InputError(f"--scale is {scale:g}, expected a positive number of less than 10,000")
    if width is not None and not LEAST_WIDTH_M <= width <= 100.0:
        raise InputError(f"--width is {width:g}, expected {LEAST_WIDTH_M:g} to 100 m")
    outline = _scaled(outline, scale)
    if outline.right_edge is not None:
        outline = _between(outline, outline.right_edge)
    kept, said = lap_of(outline.line, outline.surveyed)
    places = [outline.places[index] for index in kept]
    line = outline.line[kept]
    _check_line(line, places, outline.surveyed)
    right, left, guessed = _widths(outline, kept, width)
    _check_widths(right, left, places)
    given = [values if values is None else values[kept] for values in (outline.height, outline.bank)]
    line, *along = graded(line, [right, left, *(values for values in given if values is not None)])
    after = iter(along[2:])
    height, bank = (None if values is None else next(after) for values in given)
    return LapLine(
        np.column_stack([line, along[0], along[1]]),
        height,
        bank,
        outline.surveyed,
        (*outline.notes, *notes, *said, *guessed),
    )


def _in_metres(outline: CircuitLine) -> tuple[CircuitLine, list[str]]:
    """An outline in metres, near its first point, and what was converted."""
    line, notes = outline.line, []
    if len(line) < 2:
        raise InputError(f"{len(line)} points, expected at least {LEAST_POINTS}")
    unit: str = outline.unit
    if unit == "unknown":
        lap = float(np.hypot(*np.diff(line, axis=0).T).sum())
        on_earth = bool((np.abs(line) <= [180.0, 90.0]).all())
        unit = "degrees" if lap < DEGREES_LAP and on_earth else "km" if lap < KILOMETRES_LAP else "m"
    if unit == "degrees":
        extent = np.ptp(line, axis=0).max()
        if extent > 1.0 or not (np.abs(line) <= [360.0, 89.0]).all():
            raise InputError(
                f"longitudes and latitudes over {extent:.1f} degrees, expected those of one circuit"
            )
        notes.append("degrees made metres")
        line = local_metres(line)
    elif unit == "km":
        notes.append(f"a lap of {lap:.1f}: taken for kilometres, made metres")
        line = line * 1000.0
    edge = outline.right_edge
    if np.abs(line).max() > FAR_M:
        notes.append("moved to its first point")
        edge = None if edge is None else edge - line[0]
        line = line - line[0]
    surveyed = outline.surveyed and unit != "degrees"
    return replace(outline, line=line, right_edge=edge, surveyed=surveyed), notes


def _scaled(outline: CircuitLine, scale: float) -> CircuitLine:
    def times(values: NDArray[np.float64] | None) -> NDArray[np.float64] | None:
        return None if values is None else values * scale

    return replace(
        outline,
        line=outline.line * scale,
        right=times(outline.right),
        left=times(outline.left),
        right_edge=times(outline.right_edge),
        height=times(outline.height),
    )


def _between(outline: CircuitLine, right_edge: NDArray[np.float64]) -> CircuitLine:
    """The outline of the middle between two edges."""
    edges = []
    for edge in (outline.line, right_edge):
        kept, _ = lap_of(edge, surveyed=True)
        if len(kept) < LEAST_POINTS // 2:
            raise InputError(f"an edge of {len(kept)} points, expected at least {LEAST_POINTS // 2}")
        length = float(np.hypot(*np.diff(edge[kept], axis=0).T).sum())
        if length > 2.0 * LARGEST_LENGTH_M:
            raise InputError(f"an edge of {length:,.0f} m, expected at most {2.0 * LARGEST_LENGTH_M:,.0f} m")
        edges.append(edge[kept])
    line, right, left = middle_of(*edges)
    height = None
    if outline.height is not None:
        height = outline.height[KDTree(outline.line).query(line)[1]]
    places = [f"near x_m {x:.0f}, y_m {y:.0f}" for x, y in line]
    return replace(outline, line=line, places=places, right=right, left=left, right_edge=None, height=height)


def _widths(
    outline: CircuitLine, kept: NDArray[np.int64], width: float | None
) -> tuple[NDArray[np.float64], NDArray[np.float64], list[str]]:
    """Distances to the right and the left edge, m, and a note where they are guessed or replaced."""
    if width is None and outline.right is not None and outline.left is not None:
        return outline.right[kept], outline.left[kept], []
    half = np.full(len(kept), (width or GUESSED_WIDTH_M) / 2.0)
    if width is None:
        return half, half, [f"no widths in the file: {GUESSED_WIDTH_M:g} m is a guess, --width sets another"]
    return half, half, ["the file's widths are left out for --width"] if outline.right is not None else []


def _check_line(line: NDArray[np.float64], places: Sequence[str], surveyed: bool) -> None:
    if not LEAST_POINTS <= len(line) <= MOST_POINTS:
        raise InputError(
            f"x_m, y_m: {len(line):,} points, expected at least {LEAST_POINTS} and at most {MOST_POINTS:,}"
        )
    gaps = np.hypot(*(np.roll(line, -1, axis=0) - line).T)
    length = float(gaps.sum())
    if not LEAST_LENGTH_M <= length <= LARGEST_LENGTH_M:
        hint = f": {MODEL}" if length < LEAST_LENGTH_M else ""
        raise InputError(
            f"x_m, y_m: a lap of {length:.0f} m, expected {LEAST_LENGTH_M:g} to {LARGEST_LENGTH_M:g} m{hint}"
        )
    most = (
        max(LARGEST_GAP_M, LARGEST_GAP_STEPS * float(np.median(gaps))) if surveyed else LARGEST_GAP_ON_MAPS_M
    )
    if gaps.max() > most:
        at = (int(np.argmax(gaps)) + 1) % len(line)
        raise InputError(
            f"{places[at]}: x_m, y_m: {gaps.max():.1f} m from the point before, expected at most {most:.0f} m"
        )
    turn = turns_between(line)
    at = int(np.argmax(turn))
    if turn[at] > SHARPEST_TURN and surveyed:
        raise InputError(
            f"{places[at]}: x_m, y_m: the points turn back by {np.degrees(turn[at]):.0f} degrees, "
            "expected them in driving order"
        )


def _check_widths(right: NDArray[np.float64], left: NDArray[np.float64], places: Sequence[str]) -> None:
    for field, side in (("w_tr_right_m", right), ("w_tr_left_m", left)):
        at = int(np.argmin(side))
        if side[at] <= 0.0:
            raise InputError(
                f"{places[at]}: {field} is {side[at]:g}, "
                "expected a positive distance from the centre line to the edge; --width sets one"
            )
    widths = right + left
    if widths.min() < LEAST_WIDTH_M:
        at = int(np.argmin(widths))
        raise InputError(
            f"{places[at]}: w_tr_right_m + w_tr_left_m is {widths[at]:.2f}, "
            f"expected a road at least {LEAST_WIDTH_M:g} m wide: {MODEL}, --width sets another width"
        )
    if widths.max() > 200.0:
        at = int(np.argmax(widths))
        raise InputError(
            f"{places[at]}: w_tr_right_m + w_tr_left_m is {widths[at]:.0f}, expected at most 200 m"
        )
