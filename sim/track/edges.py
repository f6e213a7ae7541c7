"""The middle of a road between its two edges."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d
from scipy.spatial import KDTree

STEP_M, SMOOTHED_M = 2.0, 4.0


def middle_of(
    left: NDArray[np.float64], right: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """The centre line between two closed edges, and how far it lies from each.

    Args:
        left, right: (n, 2) and (m, 2), m, in driving order; the first point need not come again.

    Returns:
        the line (k, 2), and distances to the right and the left edge (k,), m.
    """
    left, right = _even(left), _even(right)
    to_left, to_right = KDTree(left), KDTree(right)
    line = (left + right[to_right.query(left)[1]]) / 2
    for _ in range(3):
        # Halfway between the nearest places of both edges, wherever that moves it.
        line = _even(gaussian_filter1d(line, SMOOTHED_M / STEP_M, axis=0, mode="wrap"))
        line = (left[to_left.query(line)[1]] + right[to_right.query(line)[1]]) / 2
    line = _even(gaussian_filter1d(line, SMOOTHED_M / STEP_M, axis=0, mode="wrap"))
    return line, _smooth(to_right.query(line)[0]), _smooth(to_left.query(line)[0])


def _smooth(width: NDArray[np.float64]) -> NDArray[np.float64]:
    return gaussian_filter1d(width, SMOOTHED_M / STEP_M, mode="wrap")


def _even(line: NDArray[np.float64]) -> NDArray[np.float64]:
    """A closed line in steps of about STEP_M."""
    closed = np.vstack([line, line[:1]])
    at = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(closed, axis=0).T))])
    steps = int(np.clip(at[-1] / STEP_M, 8, 50_000))
    along = np.linspace(0.0, at[-1], steps, endpoint=False)
    return np.column_stack([np.interp(along, at, closed[:, axis]) for axis in (0, 1)])
