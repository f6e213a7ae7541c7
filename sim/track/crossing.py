"""Where a circuit crosses itself: one of the two roads is a bridge over the other."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy
from numpy.typing import NDArray

from nathlon.sim.errors import InputError

CLEARANCE_M, LEAST_CLEARANCE_M = 6.0, 4.0
"""From road to road where it is laid out, and where it is given."""
RAMP_M = 100.0
"""The heights of a bridge fade over a few times this length."""
NEAR_M = 150.0
"""Along the road to either side of a crossing, where cars above and below are kept apart. It is as far as a
slipstream reaches; at the ends, roads that cross at 30 degrees are 78 m apart, about as far as cars see."""

MOST_NEIGHBOURS, MOST_MEETINGS = 100, 1000
"""Segments near each, and crossings in all, up to which roads cross and do not lie on each other."""
ON_ITSELF = "the road lies on itself, expected one that crosses itself at a few bridges at most"


class Crossing(NamedTuple):
    """A place where a closed line crosses itself.

    Attributes:
        first, second: rows of the line before the place, in the order of the lap.
        angle: between the two directions, rad in [0, pi / 2].
    """

    first: int
    second: int
    angle: float


def meetings(starts: NDArray[np.float64], ends: NDArray[np.float64]) -> NDArray[np.int64]:
    """Which segments of closed lines cross or touch, but for those that follow each other.

    Args:
        starts, ends: (n, 2), m.

    Returns:
        (pairs, 2) indices of segments, the lower first, in order.

    Raises:
        InputError: if segments lie upon each other everywhere.
    """
    steps = ends - starts
    reach = float(np.hypot(*steps.T).max())
    middles = scipy.spatial.KDTree((starts + ends) / 2)
    if middles.count_neighbors(middles, reach) > MOST_NEIGHBOURS * len(starts):
        raise InputError(ON_ITSELF)
    pairs = middles.query_pairs(reach, output_type="ndarray").astype(np.int64)
    one, other = pairs.T
    apart = starts[other] - starts[one]
    turn = _cross(steps[one], steps[other])
    with np.errstate(divide="ignore", invalid="ignore"):
        along_one = _cross(apart, steps[other]) / turn
        along_other = _cross(apart, steps[one]) / turn
    # Rounding must not let a line slip through where two points meet.
    inside = (np.abs(along_one - 0.5) < 0.5 + 1e-9) & (np.abs(along_other - 0.5) < 0.5 + 1e-9)
    following = (ends[one] == starts[other]).all(axis=1) | (ends[other] == starts[one]).all(axis=1)
    found = pairs[inside & ~following]
    return found[np.lexsort(found.T[::-1])]


def find_crossings(line: NDArray[np.float64]) -> list[Crossing]:
    """Where a closed line, (n, 2), crosses itself, in the order of the lap.

    Raises InputError if it lies on itself rather than cross itself.
    """
    rows = len(line)
    ends = np.roll(line, -1, axis=0)
    steps = (ends - line) / np.hypot(*(ends - line).T)[:, None]
    found: list[Crossing] = []
    pairs = meetings(line, ends)
    if len(pairs) > MOST_MEETINGS:
        raise InputError(ON_ITSELF)
    while len(pairs):
        first, second = pairs[0]
        sine = abs(float(_cross(steps[[first]], steps[[second]])[0]))
        found.append(Crossing(int(first), int(second), float(np.arcsin(min(sine, 1.0)))))
        # At a point of the line, the segments on both sides meet the other ones.
        pairs = pairs[~belong(pairs, found[-1], 1, rows)]
    return found


def belong(pairs: NDArray[np.int64], crossing: Crossing, reach: int, rows: int) -> NDArray[np.bool_]:
    """Which pairs of rows, (pairs, 2), lie one on each road of a crossing, within `reach` rows of it."""
    to_first, to_second = (_gap(pairs, row, rows) <= reach for row in (crossing.first, crossing.second))
    return (to_first[:, 0] & to_second[:, 1]) | (to_second[:, 0] & to_first[:, 1])


def levels(line: NDArray[np.float64], spacing: float) -> NDArray[np.float64]:
    """Which rows of a closed line, (n, 3), lie near a crossing.

    Returns:
        (n,): on the upper road the number of the crossing, from 1, on the lower road minus that;
        0 elsewhere. Rows near to several belong to the nearest.
    """
    rows = len(line)
    level, nearest = np.zeros(rows), np.full(rows, np.inf)
    for number, crossing in enumerate(find_crossings(line[:, :2]), start=1):
        # A short loop has a stretch between that belongs to neither road.
        first, second, _ = crossing
        near = min(NEAR_M / spacing, min(second - first, first + rows - second) / 4)
        sign = 1 if line[first, 2] > line[second, 2] else -1
        for row, value in ((first, sign * number), (second, -sign * number)):
            gap = _gap(np.arange(rows), row, rows)
            mine = (gap <= near) & (gap < nearest)
            level[mine], nearest[mine] = value, gap[mine]
    return level


def bridge_heights(crossings: list[Crossing], rows: int, spacing: float) -> NDArray[np.float64]:
    """Heights of a road that is level but for bridges: at each crossing the later road is the upper one.

    The least sum of squared heights and squared changes of slope with `CLEARANCE_M` between the roads of
    every crossing, so one rises as much as the other falls.

    Args:
        rows, spacing: of the closed line, m.

    Returns:
        (rows,), m.
    """
    if not crossings:
        return np.zeros(rows)
    ahead = scipy.sparse.csc_array((np.ones(rows), (np.arange(rows), np.roll(np.arange(rows), -1))))
    difference = ahead - scipy.sparse.eye_array(rows, format="csc")
    second = difference @ difference
    energy = scipy.sparse.eye_array(rows) + (RAMP_M / spacing) ** 4 * (second.T @ second)
    apart = np.zeros((rows, len(crossings)))
    for number, crossing in enumerate(crossings):
        apart[crossing.second, number], apart[crossing.first, number] = 1.0, -1.0
    give = scipy.sparse.linalg.splu(energy.tocsc()).solve(apart)
    pull = np.linalg.solve(apart.T @ give, np.full(len(crossings), CLEARANCE_M))
    return np.asarray(give @ pull)


def _cross(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]


def _gap(one: NDArray[np.int64], other: int, rows: int) -> NDArray[np.int64]:
    """Rows from each of some rows to another one on a closed line, the shorter way."""
    ahead = np.mod(one - other, rows)
    return np.minimum(ahead, rows - ahead)
