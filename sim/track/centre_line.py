"""The centre line of a circuit as its CSV file holds it, checked before anything is made of it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from nathlon.sim.errors import InputError

COLUMNS = (
    "x_m",
    "y_m",
    "z_m",
    "w_tr_right_m",
    "w_tr_left_m",
    "bank_rad",
    "wall_right_m",
    "wall_left_m",
)
RIGHT_WIDTH, LEFT_WIDTH, BANK_ANGLE, RIGHT_WALL, LEFT_WALL = range(3, 8)
RANGES = dict(
    zip(
        COLUMNS,
        (
            *((-1e6, 1e6), (-1e6, 1e6), (-1e4, 1e4), (0.5, 100.0), (0.5, 100.0)),
            *((-0.6, 0.6), (0.5, 1000.0), (0.5, 1000.0)),
        ),
        strict=True,
    )
)
"""What each column may hold."""
LEAST_POINTS, MOST_POINTS = 20, 100_000
LEAST_LENGTH_M, LARGEST_LENGTH_M = 100.0, 100_000.0
STEEPEST = 1.0
SHARPEST_TURN = np.radians(120.0)


def read_centre_line(path: Path) -> NDArray[np.float64]:
    """Read and check the points of a closed centre line.

    Returns:
        (n, 8) float64, columns as in COLUMNS, m and rad.

    Raises:
        InputError: if the file cannot be read, or no road can be laid through its points.
    """
    try:
        lines = path.read_text("utf-8").rstrip().splitlines()
    except OSError as error:
        raise InputError(f"{path}: cannot read the centre line: {error.strerror}") from None
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: cannot read the centre line: {error}") from None
    if not lines or tuple(cell.strip() for cell in lines[0].split(",")) != COLUMNS:
        raise InputError(f"{path}: first line: expected the column names {','.join(COLUMNS)}")
    check_count(path, len(lines) - 1)
    points = np.array([_numbers(path, number, line) for number, line in enumerate(lines[1:], start=2)])
    _check_walls(path, points)
    _check_steps(path, points)
    check_turns(path, points[:, :2])
    return points


def check_count(path: Path, points: int) -> None:
    """Raise InputError where a file has too few points to be a circuit, or too many."""
    if points < LEAST_POINTS:
        raise InputError(f"{path}: x_m, y_m: {points} points, expected at least {LEAST_POINTS}")
    if points > MOST_POINTS:
        raise InputError(f"{path}: x_m, y_m: {points:,} points, expected at most {MOST_POINTS:,}")


def turns_between(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """How much the closed line through points, (n, 2), turns at each, (n,) rad, without sign."""
    steps = np.roll(points, -1, axis=0) - points
    direction = np.arctan2(steps[:, 1], steps[:, 0])
    return np.abs(np.angle(np.exp(1j * (direction - np.roll(direction, 1)))))


def check_turns(path: Path, points: NDArray[np.float64]) -> None:
    """Raise InputError where the closed line through points (n, 2), of lines 2 on, turns back on itself."""
    turn = turns_between(points)
    if (turn > SHARPEST_TURN).any():
        at = int(np.argmax(turn))
        raise InputError(
            f"{path}: line {at + 2}: x_m, y_m: the points turn back by {np.degrees(turn[at]):.0f} degrees, "
            "expected them in driving order"
        )


def _numbers(path: Path, number: int, line: str) -> list[float]:
    cells = line.split(",")
    if len(cells) != len(COLUMNS):
        raise InputError(
            f"{path}: line {number}: {len(cells)} columns, expected {len(COLUMNS)} numbers on every line"
        )
    numbers = []
    for (field, (low, high)), cell in zip(RANGES.items(), cells, strict=True):
        try:
            value = float(cell)
        except ValueError:
            value = np.nan
        if not low <= value <= high:
            raise InputError(
                f"{path}: line {number}: {field} is {cell.strip()[:40]!r}, "
                f"expected a number from {low:,.7g} to {high:,.7g}"
            )
        numbers.append(value)
    return numbers


def _check_walls(path: Path, points: NDArray[np.float64]) -> None:
    inside = (points[:, [RIGHT_WALL, LEFT_WALL]] < points[:, [RIGHT_WIDTH, LEFT_WIDTH]]).any(axis=1)
    if inside.any():
        raise InputError(
            f"{path}: line {np.argmax(inside) + 2}: wall_right_m, wall_left_m: "
            "expected walls outside the edges on every line"
        )


def _check_steps(path: Path, points: NDArray[np.float64]) -> None:
    """Of each point from the one before it: the first line is that after the last."""
    steps = points[:, :3] - np.roll(points[:, :3], 1, axis=0)
    gaps = np.hypot(steps[:, 0], steps[:, 1])
    if gaps.min() < 0.01:
        raise InputError(
            f"{path}: line {np.argmin(gaps) + 2}: x_m, y_m: "
            "expected no point twice in a row, nor the first again at the end"
        )
    if not LEAST_LENGTH_M <= gaps.sum() <= LARGEST_LENGTH_M:
        raise InputError(
            f"{path}: x_m, y_m: a lap of {gaps.sum():,.0f} m with {gaps.max():,.0f} m before "
            f"line {np.argmax(gaps) + 2}, expected {LEAST_LENGTH_M:,g} to {LARGEST_LENGTH_M:,g} m"
        )
    slopes = np.abs(steps[:, 2]) / gaps
    if slopes.max() > STEEPEST:
        raise InputError(
            f"{path}: line {np.argmax(slopes) + 2}: z_m: a slope of {slopes.max():.0%} from the line before, "
            f"expected at most {STEEPEST:.0%}"
        )
