"""What a file tells of a circuit, before anything is made of it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from nathlon.sim.errors import InputError

MOST_POINTS = 100_000
LARGEST = 1e8
"""More than any coordinate in metres on Earth."""
METRES = {"m": 1.0, "km": 1000.0, "cm": 0.01, "mm": 0.001, "ft": 0.3048}
Unit = Literal["m", "degrees", "unknown"]


@dataclass(frozen=True, eq=False)
class CircuitLine:
    """A line round a circuit in driving order, closed or not yet, and what is known along it.

    Attributes:
        dialect: what was read, in words: `a table`, `GPX`.
        line: (n, 2) float64 x east and y north, or longitude and latitude: the centre line, or the left
            edge where there is a `right_edge`.
        places: where each point stands in the file, (n,): `line 7`.
        unit: of line and edge. Everything else is in metres and radians.
        right, left: (n,) from the centre line to the edges; none where the file does not say.
        right_edge: (m, 2) the right edge, in driving order.
        height: (n,) of `line`.
        bank: (n,) slope across the road, + where the left is higher, rad.
        origin: longitude and latitude of what is 0, 0 where degrees were made metres.
        surveyed: whether points lie where the road is, to centimetres; on maps they lie some metres off.
        notes: what was assumed or left out, in short sentences.
    """

    dialect: str
    line: NDArray[np.float64]
    places: Sequence[str]
    unit: Unit = "m"
    right: NDArray[np.float64] | None = None
    left: NDArray[np.float64] | None = None
    right_edge: NDArray[np.float64] | None = None
    height: NDArray[np.float64] | None = None
    bank: NDArray[np.float64] | None = None
    origin: tuple[float, float] | None = None
    surveyed: bool = True
    notes: tuple[str, ...] = ()


def to_number(text: str | None, where: str, field: str) -> float:
    """The number that a text holds.

    Args:
        text: none where there is nothing.
        where: where it stands, for the error.
        field: what it is, for the error.

    Raises:
        InputError: if it is no number, or larger than LARGEST.
    """
    cell = (text or "").strip()
    try:
        value = float(cell) if "_" not in cell else math.nan
    except ValueError:
        value = math.nan
    if abs(value) < LARGEST:
        return value
    raise InputError(f"{where}: {field} is {cell[:40]!r}, expected a number of less than {LARGEST:g}")


def to_numbers(text: str | None, where: str) -> NDArray[np.float64]:
    """Numbers with spaces, commas or semicolons between, (n,).

    Raises:
        InputError: as `to_number` does, or for more than MOST_POINTS numbers.
    """
    words = (text or "").replace(",", " ").replace(";", " ").split()
    check_most(len(words), where)
    return np.array([to_number(word, where, f"number {place}") for place, word in enumerate(words, start=1)])


def check_most(points: int, where: str) -> None:
    """Raise InputError for more points than a circuit may have."""
    if points > MOST_POINTS:
        raise InputError(f"{where}: {points:,} points, expected at most {MOST_POINTS:,}")


def known_heights(heights: NDArray[np.float64]) -> NDArray[np.float64] | None:
    """Heights, or none where they do not differ: many files write zeros for what they do not know."""
    return heights if len(heights) and np.ptp(heights) > 0.0 else None
