"""What a bare road lacks to be a circuit: sections, kerbs, run-off, walls, penalty zones, a grid.

Rules of thumb of circuit design, from the geometry alone: an apex has a kerb inside, the exit one
outside; run-off is widest outside and beyond a bend; walls of neighbouring parts share the space between.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_closing, minimum_filter1d, uniform_filter1d
from scipy.spatial import KDTree

from nathlon.sim.track import CircuitFile, Grid, Kerb, NamedSection, Runoff, RunoffStretch, Side, Stretch
from nathlon.sim.track.crossing import Crossing, belong, find_crossings, meetings

SIDES: tuple[Side, Side] = ("right", "left")
FOLD = 0.8
"""Largest curvature times distance on the inside of a bend. At 1 a line parallel to the road folds over;
points 5 m apart, as they are written, may bend by a tenth more than the road that they stand for."""
BEND_RADIUS_M, BEND_TURN = 250.0, np.radians(15.0)
MERGE_M = 50.0  # bends in one direction that lie closer are one
CHICANE_GAP_M, CHICANE_M = 40.0, 200.0  # between its two bends, and in all
STRAIGHT_M, STRAIGHT_PART_M = 250.0, 50.0
EXIT_KERB_M, BEYOND_BEND_M = 40.0, 60.0
ROWS_PER_POINT = 5  # the road is laid out in rows 1 m apart, and written every 5 m
LEAST_ANGLE_DEGREES = 30.0  # between the roads at a bridge
TAPER_M = 40.0  # over which a wall moves outward
PLACES, POLE_M, PLACE_SPACING_M, PLACE_LATERAL_M, HALF_CAR_M = 20, -12.0, 9.0, 2.6, 1.3


class Roadside(NamedTuple):
    """What stands beside a road.

    Attributes:
        runoff_m: from edge to wall.
        bend_runoff_m: outside a bend of 60 degrees or more.
        kerb_m: width of a kerb.
        beside_kerb_m: between a kerb and the wall; where there is less there is no kerb.
        gravel_m: where there is as much space beside the road, it is a gravel trap.
        surface: of the other run-off.
    """

    runoff_m: float = 5.0
    bend_runoff_m: float = 18.0
    kerb_m: float = 1.2
    beside_kerb_m: float = 0.8
    gravel_m: float = 8.0
    surface: Runoff = "grass"


@dataclass(frozen=True, eq=False)
class Road:
    """A closed road in the plane, in rows about 1 m apart.

    Attributes:
        position: (n, 2) of the centre line, m, x east, y north.
        tangent: (n, 2), unit, in driving direction.
        curvature: (n,), 1/m, + is left.
        right, left: (n,), from the centre line to the edges, m.
        spacing: of the rows along the centre line, m.
    """

    position: NDArray[np.float64]
    tangent: NDArray[np.float64]
    curvature: NDArray[np.float64]
    right: NDArray[np.float64]
    left: NDArray[np.float64]
    spacing: float

    @property
    def length(self) -> float:
        """Of the centre line, m."""
        return self.spacing * len(self.position)

    @property
    def normal(self) -> NDArray[np.float64]:
        """(n, 2), unit, to the left."""
        return np.stack([-self.tangent[:, 1], self.tangent[:, 0]], axis=1)

    @cached_property
    def crossings(self) -> list[Crossing]:
        """Where the centre line crosses itself."""
        return find_crossings(self.position)

    def edge(self, side: Side) -> NDArray[np.float64]:
        """The closed line of an edge, (n, 2)."""
        offset = self.left if side == "left" else -self.right
        return self.position + self.normal * offset[:, None]

    def rows(self, metres: float) -> int:
        """Rows in a length, at least one."""
        return max(1, round(metres / self.spacing))


@dataclass(frozen=True)
class Bend:
    """A bend from one row to another (the last not in it).

    Attributes:
        turn: change of direction, rad, + is left.
        curvature: the largest, 1/m, without sign.
    """

    first: int
    last: int
    turn: float
    curvature: float

    @property
    def inside(self) -> Side:
        return "left" if self.turn > 0 else "right"

    @property
    def outside(self) -> Side:
        return "right" if self.turn > 0 else "left"


def runs(mask: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """First and one past the last row of each run of true values; a run over the line is two."""
    steps = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(np.int8)))
    return [(int(first), int(last)) for first, last in steps.reshape(-1, 2)]


def find_bends(road: Road) -> list[Bend]:
    """Bends in the order of the lap; one that lies across the line is two."""
    curvature = uniform_filter1d(road.curvature, road.rows(15.0), mode="wrap")
    bends: list[Bend] = []
    for sign in (1.0, -1.0):
        for first, last in runs(sign * curvature > 1.0 / BEND_RADIUS_M):
            inside = sign * curvature[first:last]
            # What a tight bend runs out into is no part of it, unless it is a bend in its own right.
            least = np.clip(0.2 * inside.max(), 1.0 / BEND_RADIUS_M, 2.0 / BEND_RADIUS_M)
            bends += [_bend(road, first + start, first + stop) for start, stop in runs(inside > least)]
    bends = sorted((bend for bend in bends if abs(bend.turn) > 0.2 * BEND_TURN), key=lambda bend: bend.first)
    merged: list[Bend] = []
    for bend in bends:
        before = merged[-1] if merged else None
        if before and before.turn * bend.turn > 0 and bend.first - before.last < road.rows(MERGE_M):
            merged[-1] = _bend(road, before.first, bend.last)
        else:
            merged.append(bend)
    return [bend for bend in merged if abs(bend.turn) > BEND_TURN]


def _bend(road: Road, first: int, last: int) -> Bend:
    inside = road.curvature[first:last]
    return Bend(first, last, float(inside.sum() * road.spacing), float(np.abs(inside).max()))


def _is_chicane(road: Road, bend: Bend, following: Bend) -> bool:
    near = following.first - bend.last < road.rows(CHICANE_GAP_M)
    short = following.last - bend.first < road.rows(CHICANE_M)
    return near and short and bend.turn * following.turn < 0


def _straights(road: Road, bends: list[Bend]) -> list[tuple[int, int]]:
    """Rows between bends where the road runs straight for long, the parts at the line by themselves."""
    rows = len(road.position)
    stops = [0, *(row for bend in bends for row in (bend.first, bend.last)), rows]
    gaps = list(zip(stops[::2], stops[1::2], strict=True))
    over_the_line = gaps[0][1] + rows - gaps[-1][0]
    straights = [gap for gap in gaps if gap[1] - gap[0] >= road.rows(STRAIGHT_M)]
    if over_the_line >= road.rows(STRAIGHT_M) and len(gaps) > 1:
        parts = [gap for gap in (gaps[0], gaps[-1]) if gap[1] - gap[0] >= road.rows(STRAIGHT_PART_M)]
        straights = sorted({*straights, *parts})
    return straights


def _sections(road: Road, bends: list[Bend], straights: list[tuple[int, int]]) -> list[NamedSection]:
    found: list[tuple[int, int, str, str]] = []
    number = 1
    while number <= len(bends):
        bend = bends[number - 1]
        if number < len(bends) and _is_chicane(road, bend, bends[number]):
            found.append((bend.first, bends[number].last, f"Turns {number}-{number + 1}", "chicane"))
            number += 2
        else:
            found.append((bend.first, bend.last, f"Turn {number}", "corner"))
            number += 1
    found += [(*rows, f"Straight {index}", "straight") for index, rows in enumerate(straights, start=1)]
    return [
        NamedSection.model_validate({"name": name, "kind": kind} | _stretch(road, first, last))
        for first, last, name, kind in sorted(found)
    ]


def _stretch(road: Road, first: int, last: int) -> dict[str, float]:
    return {"start_m": round(first * road.spacing, 1), "end_m": round(last * road.spacing, 1)}


def clearance(road: Road, side: Side, most: float) -> NDArray[np.float64]:
    """How far beyond an edge a wall may stand, m, (n,): nearest to this place of the road, with a margin.

    No more than `most` is needed.
    """
    edges = KDTree(np.concatenate([road.edge("left"), road.edge("right")]))
    edge, outward = road.edge(side), road.normal * (1.0 if side == "left" else -1.0)
    reach, free = np.zeros(len(edge)), np.ones(len(edge), np.bool_)
    for distance in np.arange(0.5, most / 0.9 + 0.5, 0.5):
        # An edge that widens runs askew, and is then nearer than along the normal.
        free &= edges.query(edge + outward * distance)[0] > 0.95 * distance
        reach[free] = distance
    width, inward = (road.left, road.curvature) if side == "left" else (road.right, -road.curvature)
    fold = FOLD / np.maximum(inward, FOLD / 1000.0) - width
    return np.maximum(np.minimum(0.9 * reach, fold), 0.0)


def _outside_bends(road: Road, bends: list[Bend], side: Side, beside: Roadside) -> NDArray[np.float64]:
    """Run-off that bends call for on one side, m, (n,)."""
    wanted = np.full(len(road.position), beside.runoff_m)
    for bend in bends:
        if bend.outside == side:
            rows = np.arange(bend.first - road.rows(TAPER_M), bend.last + road.rows(BEYOND_BEND_M)) % len(
                wanted
            )
            severity = min(1.0, abs(bend.turn) / np.radians(60.0))
            wider = (beside.bend_runoff_m - beside.runoff_m) * severity
            wanted[rows] = np.maximum(wanted[rows], beside.runoff_m + wider)
    return wanted


def place_walls(road: Road, bends: list[Bend], side: Side, beside: Roadside) -> NDArray[np.float64]:
    """Distance from the edge to the wall on one side, m, (n,), without steps."""
    space = np.minimum(_outside_bends(road, bends, side, beside), clearance(road, side, beside.bend_runoff_m))
    window = road.rows(TAPER_M) | 1
    # The mean of the least over one window is nowhere more than the space itself.
    return uniform_filter1d(minimum_filter1d(space, window, mode="wrap"), window, mode="wrap")


def _kerbs(
    road: Road, bends: list[Bend], side: Side, space: NDArray[np.float64], beside: Roadside
) -> list[Kerb]:
    mask = np.zeros(len(road.position), np.bool_)
    for bend in bends:
        if bend.inside == side:
            rows = np.arange(bend.first, bend.last)
            apex = np.abs(road.curvature[rows]) > 0.4 * bend.curvature
        else:
            rows = np.arange(
                bend.last - road.rows(0.4 * EXIT_KERB_M), bend.last + road.rows(0.6 * EXIT_KERB_M)
            )
            apex = np.ones(len(rows), np.bool_)
        mask[rows[apex] % len(mask)] = True
    gap = road.rows(20.0)
    closed = binary_closing(np.pad(mask, gap, mode="wrap"), np.ones(gap))[gap:-gap]
    mask = closed & (space > beside.kerb_m + beside.beside_kerb_m)
    return [
        Kerb.model_validate({"side": side, "width_m": beside.kerb_m} | _stretch(road, first, last))
        for first, last in runs(mask)
        if last - first >= gap
    ]


def _gravel(road: Road, side: Side, space: NDArray[np.float64], beside: Roadside) -> list[RunoffStretch]:
    return [
        RunoffStretch.model_validate({"side": side, "surface": "gravel"} | _stretch(road, first, last))
        for first, last in runs(space > beside.gravel_m)
        if last - first >= road.rows(20.0)
    ]


def _penalty_zones(road: Road, straights: list[tuple[int, int]]) -> list[Stretch]:
    """Where cars come slowly out of a bend into the two longest straights."""
    longest = sorted(
        (rows for rows in straights if rows[0] > 0), key=lambda straight: straight[0] - straight[1]
    )[:2]
    return [
        Stretch.model_validate(
            _stretch(
                road, first, first + int(np.clip(0.4 * (last - first), road.rows(100.0), road.rows(250.0)))
            )
        )
        for first, last in sorted(longest)
        if last - first >= road.rows(100.0)
    ]


def _grid(road: Road) -> Grid:
    """As wide as the road allows there."""
    back = road.rows(PLACES * PLACE_SPACING_M - POLE_M)
    room = min(road.left[-back:].min(), road.right[-back:].min()) - HALF_CAR_M
    return Grid(
        pole_m=POLE_M,
        spacing_m=PLACE_SPACING_M,
        lateral_m=round(float(np.clip(room, 0.0, PLACE_LATERAL_M)), 2),
    )


def lay_out(
    road: Road, name: str, profile: str, beside: Roadside
) -> tuple[CircuitFile, NDArray[np.float64], NDArray[np.float64]]:
    """The circuit file for a road, and the distances from centre line to right and left walls, m, (n,).

    Args:
        road: laid out in the plane.
        name: of the circuit.
        profile: its heights in words.
        beside: what to put there.
    """
    bends = find_bends(road)
    straights = _straights(road, bends)
    right, left = (place_walls(road, bends, side, beside) for side in SIDES)
    spaces: tuple[tuple[Side, NDArray[np.float64]], ...] = (("left", left), ("right", right))
    turns = f"{len(bends)} {'turn' if len(bends) == 1 else 'turns'}"
    facts = CircuitFile(
        name=name,
        description=f"{road.length / 1000:.1f} km, {turns}, {profile}",
        centre_line="centre_line.csv",
        runoff=beside.surface,
        sectors_m=(round(road.length / 3, 1), round(2 * road.length / 3, 1)),
        grid=_grid(road),
        section=tuple(_sections(road, bends, straights)),
        kerb=tuple(kerb for side, space in spaces for kerb in _kerbs(road, bends, side, space, beside)),
        runoff_stretch=tuple(
            stretch for side, space in spaces for stretch in _gravel(road, side, space, beside)
        ),
        penalty_zone=tuple(_penalty_zones(road, straights)),
    )
    return facts, road.right + right, road.left + left


def edges_cross(road: Road) -> int | None:
    """The first row where an edge folds over or meets another part of an edge; none if none does.

    Where the centre line crosses itself at a large angle is a bridge.
    """
    inner = np.where(road.curvature > 0, road.left, road.right) * np.abs(road.curvature)
    if (inner > FOLD + 1e-9).any():
        return int(np.argmax(inner))
    rows = len(road.position)
    starts = np.concatenate([road.edge("left"), road.edge("right")])
    ends = np.concatenate([np.roll(road.edge(side), -1, axis=0) for side in ("left", "right")])
    pairs = meetings(starts, ends) % rows
    widest = float(np.maximum(road.left, road.right).max())
    for crossing in road.crossings:
        if crossing.angle >= np.radians(LEAST_ANGLE_DEGREES):
            reach = road.rows(3.0 * widest / np.sin(crossing.angle))
            pairs = pairs[~belong(pairs, crossing, reach, rows)]
    return int(pairs.min()) if len(pairs) else None
