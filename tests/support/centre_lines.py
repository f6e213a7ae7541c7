"""Closed roads of straights and arcs, and files of the racetrack database with them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

HEADER = "# x_m,y_m,w_tr_right_m,w_tr_left_m"


def path_of(pieces: Sequence[tuple[float, float]], spacing: float = 5.0) -> NDArray[np.float64]:
    """Points of pieces (length m, turn rad, + is left) put together, eastward from the origin, (n, 2).

    The points lie `spacing` metres apart along the path; the end is left out.
    """
    length = sum(piece[0] for piece in pieces)
    at = np.linspace(0.0, length, round(length / spacing), endpoint=False)
    points = np.zeros((len(at), 2))
    start, position, heading = 0.0, np.zeros(2), 0.0
    for piece, turn in pieces:
        rows = (at >= start - 1e-9) & (at < start + piece - 1e-9)
        points[rows] = position + _along(heading, turn / piece, at[rows] - start)
        position = position + _along(heading, turn / piece, np.array([piece]))[0]
        start, heading = start + piece, heading + turn
    np.testing.assert_allclose(position, 0.0, atol=1e-6, err_msg="the path does not close")
    return points


def _along(heading: float, curvature: float, distance: NDArray[np.float64]) -> NDArray[np.float64]:
    """Displacement along an arc in closed form, (n, 2)."""
    half = curvature * distance / 2
    chord = distance * np.sinc(half / np.pi)
    return np.stack([chord * np.cos(heading + half), chord * np.sin(heading + half)], axis=1)


def stadium(straight: float = 600.0, radius: float = 80.0, turn: float = 1.0) -> list[tuple[float, float]]:
    """Two straights and two half circles from the middle of a straight; turn +1 left, -1 right."""
    bend = (np.pi * radius, turn * np.pi)
    return [(straight / 2, 0.0), bend, (straight, 0.0), bend, (straight / 2, 0.0)]


def write_line(
    path: Path, points: NDArray[np.float64], right: float | NDArray = 5.0, left: float | NDArray = 6.0
) -> Path:
    """Write a centre line with its widths as the racetrack database does."""
    table = np.column_stack([points, np.broadcast_to(right, len(points)), np.broadcast_to(left, len(points))])
    rows = [",".join(f"{cell:.6f}" for cell in row) for row in table]
    path.write_text("\n".join([HEADER, *rows]) + "\n", "utf-8")
    return path
