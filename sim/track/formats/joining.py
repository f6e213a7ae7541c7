"""Ways of a map joined to the line of a lap."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from nathlon.sim.errors import InputError
from nathlon.sim.track.formats.outline import LARGEST, CircuitLine, check_most, known_heights
from nathlon.sim.track.projection import local_metres

TOUCH_M, REACH_M = 1.0, 60.0
"""Ends that lie so close are one; where no ways lead round, ends that lie so close are joined."""
LEAST_RING_M, BESIDE_M = 250.0, 60.0
WIDEST_DEGREES = 1.0
SHARPEST = np.cos(np.radians(110.0))
"""Of a turn from way to way: a lap does not leave an acute fork by its other branch."""
MOST_WAYS, MOST_STEPS = 1_000, 2_000_000


@dataclass(frozen=True, eq=False)
class Way:
    """A line of a map.

    Attributes:
        points: (n, 3) longitude, latitude, height or nan; once projected, m.
        places: where each point stands in the file, (n,).
        name: all names it has, in lower case.
        raceway, member: whether the map calls it one, and part of a circuit.
        beside: whether it is a pit lane, a paddock or for karts.
    """

    points: NDArray[np.float64]
    places: Sequence[str]
    name: str = ""
    raceway: bool = False
    member: bool = False
    beside: bool = False

    @property
    def length(self) -> float:
        """In the plane, m."""
        return float(np.hypot(*np.diff(self.points[:, :2], axis=0).T).sum())

    @property
    def is_ring(self) -> bool:
        """Whether it ends where it begins, and leads round something."""
        gap = float(np.hypot(*(self.points[0] - self.points[-1])[:2]))
        return self.length > LEAST_RING_M and gap < max(TOUCH_M, 0.02 * self.length)


class _Edge(NamedTuple):
    """A piece of a way from node to node; `ahead` is its direction at its start, `astern` that at its end."""

    nodes: tuple[int, int]
    way: Way
    ahead: NDArray[np.float64]
    astern: NDArray[np.float64]


def outline_of(dialect: str, ways: Sequence[Way], expected: str) -> CircuitLine:
    """The lap that ways of a map make: one of them, several in a row, or two as its edges.

    Args:
        dialect: for the outline.
        ways: in degrees, or in metres where they cannot be degrees.
        expected: what the file should hold, for errors.

    Raises:
        InputError: if there are no ways, or they make no lap, or more than one.
    """
    ways = [way for way in ways if len(way.points) > 1]
    for better in ("member", "raceway"):
        if any(getattr(way, better) for way in ways):
            ways = [way for way in ways if getattr(way, better)]
    ways = [way for way in ways if not way.beside] or ways
    if not ways:
        raise InputError(f"no lines, {expected}")
    if len(ways) > MOST_WAYS:
        raise InputError(f"{len(ways):,} lines, expected those of one circuit, at most {MOST_WAYS:,}")
    check_most(sum(len(way.points) for way in ways), "the lines")
    ways, origin = _projected(ways)
    notes = () if origin is None else ("degrees made metres",)
    edges = _edges(ways)
    if edges is not None:
        left, right = edges
        return CircuitLine(
            f"{dialect}, two edges",
            left.points[:, :2],
            left.places,
            right_edge=right.points[:, :2],
            height=_heights(left),
            origin=origin,
            surveyed=False,
            notes=notes,
        )
    rings = [way for way in ways if way.is_ring]
    if len(rings) > 1 and len(rings) == len(ways):
        raise InputError(f"{len(rings)} closed lines, expected one circuit: leave one of them in the file")
    way = ways[0] if len(ways) == 1 else rings[0] if len(rings) == 1 else _joined(ways)
    if len(ways) > 1:
        notes = (*notes, f"made of some of {len(ways)} lines")
    return CircuitLine(
        dialect,
        way.points[:, :2],
        way.places,
        height=_heights(way),
        origin=origin,
        surveyed=False,
        notes=notes,
    )


def _heights(way: Way) -> NDArray[np.float64] | None:
    height = way.points[:, 2]
    known = np.isfinite(height)
    if known.sum() < 0.9 * len(height):
        return None
    at = np.arange(len(height))
    return known_heights(np.interp(at, at[known], height[known]))


def _projected(ways: Sequence[Way]) -> tuple[list[Way], tuple[float, float] | None]:
    """Ways in metres, and where their origin lies if they were in degrees."""
    points = np.vstack([way.points for way in ways])
    origin = None
    if (np.abs(points[:, 0]) <= 360.0).all() and (np.abs(points[:, 1]) < 89.0).all():
        extent = np.ptp(points[:, :2], axis=0)
        if extent.max() > WIDEST_DEGREES:
            raise InputError(
                f"lines over {extent.max():.1f} degrees, expected one circuit: leave one of them in the file"
            )
        origin = (float(points[0, 0]), float(points[0, 1]))
        points = np.column_stack([local_metres(points[:, :2]), points[:, 2]])
    elif not (np.abs(points[:, :2]) < LARGEST).all():
        raise InputError(f"coordinates of more than {LARGEST:g}, expected degrees or metres")
    stops = np.cumsum([0, *(len(way.points) for way in ways)])
    return [
        replace(way, points=points[start:stop])
        for way, (start, stop) in zip(ways, pairwise(stops), strict=True)
    ], origin


def _edges(ways: Sequence[Way]) -> tuple[Way, Way] | None:
    """Left and right edge, where two ways are those of a road: by their names, or as rings side by side."""
    if len(ways) != 2:
        return None
    for left, right in (ways, ways[::-1]):
        if "left" in left.name and "right" in right.name:
            return left, right
    one, other = ways
    if not (one.is_ring and other.is_ring and 0.7 < one.length / other.length < 1.4):
        return None
    if KDTree(one.points[:, :2]).query(other.points[:, :2])[0].max() > BESIDE_M:
        return None
    areas = [_area(way.points) for way in ways]
    if areas[0] * areas[1] < 0.0:
        other = replace(other, points=other.points[::-1], places=other.places[::-1])
    # Driven counter-clockwise, the left edge is the inner one.
    first_is_left = (abs(areas[0]) < abs(areas[1])) == (areas[0] > 0.0)
    return (one, other) if first_is_left else (other, one)


def _area(points: NDArray[np.float64]) -> float:
    """Enclosed by a ring, m^2, + where it leads counter-clockwise."""
    x, y = (points - points[0])[:, :2].T
    return float(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2.0


def _joined(ways: Sequence[Way]) -> Way:
    """The longest lap that leads over ways, in the direction of most of them; else all of them end to end."""
    edges = _split(ways)
    lap = _longest_lap(edges)
    if lap is None:
        return _chained(ways)
    forward = sum(edge.way.length * (1 if along else -1) for edge, along in lap)
    if forward < 0.0:
        lap = [(edge, not along) for edge, along in reversed(lap)]
    start = max(range(len(lap)), key=lambda place: _longest_step(lap[place][0].way))
    parts = [edge.way if along else _reversed(edge.way) for edge, along in [*lap[start:], *lap[:start]]]
    return _together(parts)


def _longest_step(way: Way) -> float:
    return float(np.hypot(*np.diff(way.points[:, :2], axis=0).T).max())


def _together(parts: Sequence[Way]) -> Way:
    return Way(np.vstack([part.points for part in parts]), [one for part in parts for one in part.places])


def _reversed(way: Way) -> Way:
    return replace(way, points=way.points[::-1], places=way.places[::-1])


def _split(ways: Sequence[Way]) -> list[_Edge]:
    """Pieces of ways between places where ends of ways lie."""
    ends = np.vstack([way.points[[0, -1], :2] for way in ways])
    near = KDTree(ends)
    node = np.array([min(found) for found in near.query_ball_point(ends, TOUCH_M)])
    edges = []
    for way in ways:
        apart, nearest = near.query(way.points[:, :2])
        stops = sorted({0, len(way.points) - 1, *np.flatnonzero(apart < TOUCH_M).tolist()})
        for start, stop in pairwise(stops):
            piece = replace(way, points=way.points[start : stop + 1], places=way.places[start : stop + 1])
            ahead, astern = piece.points[1] - piece.points[0], piece.points[-1] - piece.points[-2]
            if piece.length > 0.0:
                nodes = (int(node[nearest[start]]), int(node[nearest[stop]]))
                edges.append(_Edge(nodes, piece, _unit(ahead), _unit(astern)))
    return edges


def _unit(step: NDArray[np.float64]) -> NDArray[np.float64]:
    return step[:2] / max(float(np.hypot(*step[:2])), 1e-9)


def _longest_lap(edges: Sequence[_Edge]) -> list[tuple[_Edge, bool]] | None:
    """The longest way round over edges, each forward or backward, that passes no node twice.

    The search is broken off after MOST_STEPS over edges, with the longest lap so far.
    """
    leaving: dict[int, list[tuple[int, bool]]] = defaultdict(list)
    for number, edge in enumerate(edges):
        leaving[edge.nodes[0]].append((number, True))
        leaving[edge.nodes[1]].append((number, False))
    best: list[tuple[int, bool]] = []
    longest, steps = LEAST_RING_M, 0
    for first in range(len(edges)):
        # Each lap is found from the first of its edges.
        stack = [[(first, True)]]
        while stack and steps < MOST_STEPS:
            path = stack.pop()
            steps += len(path)
            number, along = path[-1]
            here = edges[number].nodes[1 if along else 0]
            if here == edges[first].nodes[0]:
                length = sum(edges[one].way.length for one, _ in path)
                if length > longest and _goes_on(edges, path[-1], path[0]):
                    best, longest = path, length
                continue
            passed = {edges[one].nodes[1 if way else 0] for one, way in path[:-1]}
            if here in passed:
                continue
            stack += [
                [*path, onward]
                for onward in leaving[here]
                if onward[0] > first and onward[0] != number and _goes_on(edges, path[-1], onward)
            ]
    return [(edges[number], along) for number, along in best] or None


def _goes_on(edges: Sequence[_Edge], one: tuple[int, bool], other: tuple[int, bool]) -> bool:
    """Whether the turn from one edge to another is none that no lap makes."""
    into = edges[one[0]].astern if one[1] else -edges[one[0]].ahead
    out = edges[other[0]].ahead if other[1] else -edges[other[0]].astern
    return float(into @ out) > SHARPEST


def _chained(ways: Sequence[Way]) -> Way:
    """Ways end to end: after each the one whose end lies nearest, as long as one does."""
    left = sorted(ways, key=lambda way: -way.length)
    parts = [left.pop(0)]
    while left:
        end = parts[-1].points[-1, :2]
        gaps = [
            (float(np.hypot(*(way.points[at, :2] - end))), number, at)
            for number, way in enumerate(left)
            for at in (0, -1)
        ]
        gap, number, at = min(gaps)
        if gap > REACH_M:
            break
        way = left.pop(number)
        parts.append(way if at == 0 else _reversed(way))
    return _together(parts)
