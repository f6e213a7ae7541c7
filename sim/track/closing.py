"""A line round a circuit made a closed one: the points of one lap, and more where they lie far apart."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from nathlon.sim.errors import InputError
from nathlon.sim.track.centre_line import MOST_POINTS

SAME_M = 0.01
NEAR_M, ALIKE = 25.0, np.cos(np.radians(60.0))
"""How near a line that goes round again comes to its start, and how much in the same direction."""
LEAST_LAP_M = 250.0
MOST_RETURNS = 20
"""Places at which a line may seem to begin again, of which one is looked for that does."""
OPEN_M, OPEN_SHARE = 50.0, 0.05
"""The most that may lie between the last point and the first: as much as that, or a share of the lap."""
GRADING = 3.0
"""How many times longer than the one beside it a step may be."""
MAP_STEP_M = 2.0


def lap_of(line: NDArray[np.float64], surveyed: bool) -> tuple[NDArray[np.int64], list[str]]:
    """Which points of a line make one lap, each once.

    A point that stands where the one before does is left out, so are the first again at the end, further
    laps, and on maps points less than 2 m from the one before.

    Args:
        line: (n, 2), m, in driving order.
        surveyed: whether points lie where the road is to centimetres.

    Returns:
        indices of the points, and what is to be said of those left out.

    Raises:
        InputError: if the line does not lead round.
    """
    kept = _apart(line, SAME_M if surveyed else MAP_STEP_M)
    notes = []
    points = line[kept]
    again = _returns(points)
    if again is not None:
        if len(points) - again > 0.5 * again:
            notes.append("the first of several laps")
        kept = kept[:again]
        points = line[kept]
    steps = np.hypot(*np.diff(points, axis=0).T)
    if not len(steps):
        return kept, notes
    closed = False
    while len(kept) > 3 and np.hypot(*(points[0] - points[len(kept) - 1])) < 0.5 * np.median(steps):
        kept, closed = kept[:-1], True
    if closed or again is not None:
        return kept, notes
    gap, length = float(np.hypot(*(points[len(kept) - 1] - points[0]))), float(steps.sum())
    if gap > max(1.01 * steps.max(), 3.0 * np.median(steps)):
        if gap > min(OPEN_M, OPEN_SHARE * length):
            raise InputError(
                f"the last point lies {gap:.1f} m from the first and the others at most "
                f"{steps.max():.1f} m apart, expected a closed line"
            )
        notes.append(f"the last point lies {gap:.1f} m from the first: joined")
    return kept, notes


def _apart(line: NDArray[np.float64], least: float) -> NDArray[np.int64]:
    """Points at least so far from the one before that is kept, m."""
    kept = [0]
    for index in range(1, len(line)):
        x, y = line[index] - line[kept[-1]]
        if x * x + y * y >= least * least:
            kept.append(index)
    return np.array(kept)


def _returns(points: NDArray[np.float64]) -> int | None:
    """The first point beyond a lap, where a line goes on over its beginning."""
    steps = np.diff(points, axis=0)
    lengths = np.hypot(*steps.T)
    at = np.concatenate([[0.0], np.cumsum(lengths)])
    if len(steps) < 3 or at[-1] < LEAST_LAP_M:
        return None
    reach = min(NEAR_M, 3.0 * float(np.median(lengths)))
    ahead = steps[0] / max(lengths[0], SAME_M)
    along = (points - points[0]) @ ahead
    aside = np.abs((points - points[0]) @ np.array([-ahead[1], ahead[0]]))
    onward = np.append(steps @ ahead / np.maximum(lengths, SAME_M), 1.0) > ALIKE
    # Passing the start, from behind it to before it.
    passes = (at > LEAST_LAP_M) & (aside < reach) & (along >= 0.0) & (along < NEAR_M + lengths.max()) & onward
    for index in np.flatnonzero(passes)[:MOST_RETURNS]:
        if not -lengths.max() - reach < along[index - 1] < reach:
            continue
        off, _ = KDTree(points[:index]).query(points[index:])
        if off.max() < max(reach, lengths.max()):
            return int(index)
    return None


def graded(
    line: NDArray[np.float64], values: Sequence[NDArray[np.float64]]
) -> tuple[NDArray[np.float64], ...]:
    """A closed line with more points on long steps beside short ones, so that a curve bends where they do.

    Long steps are taken for straight: whoever draws a line sets points where it bends.

    Args:
        line: (n, 2), m.
        values: along it, (n,) each.

    Returns:
        the line, and the values along it.
    """
    table = np.column_stack([line, *values]) if values else line
    while len(table) < MOST_POINTS:
        step = np.hypot(*(np.roll(table[:, :2], -1, axis=0) - table[:, :2]).T)
        before, after = np.roll(step, 1), np.roll(step, -1)
        short = np.minimum(before, after)
        long = np.flatnonzero(step > GRADING * short)
        if not len(long):
            break
        # Twice as far as the shorter step beside it is long, from where they meet.
        share = np.minimum(2.0 * short / step, 0.5)
        share = np.where(before <= after, share, 1.0 - share)[long, None]
        between = table[long] * (1.0 - share) + np.roll(table, -1, axis=0)[long] * share
        table = np.insert(table, long + 1, between, axis=0)
    return table[:, :2], *table[:, 2:].T
