"""What a camera sees of a circuit: lines along the road in space, colours between them, what lies near."""

from __future__ import annotations

from functools import lru_cache
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import scipy
from numpy.typing import NDArray

from nathlon.sim.track import (
    KERB_LEFT,
    KERB_RIGHT,
    LEFT,
    LEVEL,
    RIGHT,
    RUNOFF_LEFT,
    RUNOFF_RIGHT,
    SURFACES,
    TANGENT_X,
    TANGENT_Y,
    WALL_LEFT,
    WALL_RIGHT,
    ZONE,
    Track,
    X,
    Y,
)

LINES = 12
"""Along the road, numbered below; a wall has one at its foot and one at its top."""
LAND_LEFT, WALL_FOOT_LEFT, KERB_OUTER_LEFT, EDGE_LEFT, PAINT_LEFT = range(5)
PAINT_RIGHT, EDGE_RIGHT, KERB_OUTER_RIGHT, WALL_FOOT_RIGHT, LAND_RIGHT, WALL_TOP_LEFT, WALL_TOP_RIGHT = range(
    5, LINES
)

STRIPS = np.array(
    [
        (LAND_LEFT, WALL_FOOT_LEFT),
        (WALL_FOOT_RIGHT, LAND_RIGHT),
        (WALL_FOOT_LEFT, WALL_FOOT_RIGHT),  # under all that follows
        (EDGE_RIGHT, WALL_FOOT_RIGHT),
        (KERB_OUTER_LEFT, EDGE_LEFT),
        (EDGE_RIGHT, KERB_OUTER_RIGHT),
        (EDGE_LEFT, EDGE_RIGHT),
        (PAINT_LEFT, PAINT_RIGHT),  # what is paint stays to its left and right
        (WALL_FOOT_LEFT, WALL_TOP_LEFT),
        (WALL_TOP_RIGHT, WALL_FOOT_RIGHT),
    ],
    np.int64,
)
"""Left and right line of each strip of one colour, in the order in which they are drawn."""
DECK, KERBS_FROM, KERBS_END, PAINTED, WALLS_FROM = 2, 4, 6, 6, 8
"""Places among STRIPS: of what all of the road lies on, the kerbs, the painted edges, the walls."""

LEVELS = 5
"""Of detail: at level k, 2**k rows of the track are drawn as one."""
PLAIN_FROM = 2
"""Level of detail from which on painted edges are left out."""
DETAIL_M = 28.0
"""From the camera up to which every row is drawn; up to twice as far every second one, and so on."""
SIGHT_M = 360.0
BLOCK = 16
"""Rows of the track that share a list of what lies near."""

WALL_M, PAINT_M, DECK_M = 1.0, 0.2, 1.5
LAND_M = (60.0, 45.0, 34.0, 25.0, 18.0, 13.0, 9.0, 6.0, 4.0, 2.5, 1.5, 0.8)
"""How far land may reach beyond a wall: as far as this stretch of the road is the nearest one."""
EMBANKMENT = 6.0, 4.0
"""Beside a ramp: m outward and m down."""

RedGreenBlue = tuple[int, int, int]
Shades = tuple[RedGreenBlue, RedGreenBlue]
"""Two colours that take turns along the road, so that speed can be seen."""
SUN = np.array([0.6, 0.35])
"""Where it stands, on the map."""
ROAD: Shades = ((80, 82, 88), (74, 76, 82))
LAND: Shades = ((104, 128, 74), (96, 120, 69))
RUNOFF: dict[str, Shades] = {
    "tarmac": ((118, 120, 124), (110, 112, 117)),
    "grass": ((92, 140, 66), (82, 128, 58)),
    "gravel": ((206, 186, 142), (196, 175, 130)),
}
KERB: Shades = ((208, 44, 46), (240, 240, 236))
PAINT, ZONE_PAINT, START = (235, 235, 230), (244, 180, 50), (250, 250, 250)
LEFT_WALL: Shades = ((242, 196, 60), (214, 168, 44))
RIGHT_WALL: Shades = ((46, 64, 124), (36, 50, 100))
"""A road looks alike in both directions: sides that differ, in grey too, tell which way it goes."""
CONCRETE = (120, 118, 114)
SHADE_ROWS, KERB_ROWS = 6, 2
"""Rows after which they do."""


class Scenery(NamedTuple):
    """What the kernels read of a circuit.

    Attributes:
        points: (rows + 1, 3 * LINES) float32: x of the lines, then y, then z, m; the last row is the first.
        colours: (LEVELS, rows, len(STRIPS)) uint32, packed; at level k the mean of 2**k rows.
        kerbs: (rows + 1,) bool, where there is a kerb on any side.
        bridge: (rows + 1,) float32, as the track's LEVEL.
        concrete: packed.
        first: (blocks + 1,) int64, where a block's stretches begin among those below.
        begin, end: (n,) int64, rows of the stretches of road that can be seen from a block.
        most: nodes that a picture has at most.
    """

    points: NDArray[np.float32]
    colours: NDArray[np.uint32]
    kerbs: NDArray[np.bool_]
    bridge: NDArray[np.float32]
    concrete: int
    first: NDArray[np.int64]
    begin: NDArray[np.int64]
    end: NDArray[np.int64]
    most: int


def pack(colour: NDArray[np.float64] | RedGreenBlue) -> NDArray[np.uint32]:
    """Colours (..., 3), from 0 to 255, as one number each."""
    red, green, blue = np.moveaxis(np.round(np.asarray(colour, np.float64)).astype(np.uint32), -1, 0)
    return np.asarray(red | green << np.uint32(8) | blue << np.uint32(16))


@lru_cache
def scenery_of(track: Track) -> Scenery:
    """The scenery of a circuit."""
    first, begin, end = _stretches(track)
    sizes = [int((end[a:b] - begin[a:b] + 2).sum()) for a, b in pairwise(first)]
    points = _points(track)
    table = track.table
    kerbs = (table[:, KERB_LEFT] > 0.0) | (table[:, KERB_RIGHT] > 0.0)
    return Scenery(
        points=np.concatenate([points, points[:1]]).astype(np.float32),
        colours=_levels(_colours(track)),
        kerbs=np.append(kerbs, kerbs[0]),
        bridge=np.append(table[:, LEVEL], table[0, LEVEL]).astype(np.float32),
        concrete=int(pack(CONCRETE)),
        first=first,
        begin=begin,
        end=end,
        most=max(sizes),
    )


def _points(track: Track) -> NDArray[np.float64]:
    """The lines, (rows, 3 * LINES)."""
    table = track.table
    left, right = table[:, LEFT], table[:, RIGHT]
    outer_left = np.minimum(left + table[:, KERB_LEFT], table[:, WALL_LEFT])
    outer_right = np.minimum(right + table[:, KERB_RIGHT], table[:, WALL_RIGHT])
    offsets = {
        WALL_FOOT_LEFT: table[:, WALL_LEFT],
        KERB_OUTER_LEFT: outer_left,
        EDGE_LEFT: left,
        PAINT_LEFT: left - PAINT_M,
        PAINT_RIGHT: PAINT_M - right,
        EDGE_RIGHT: -right,
        KERB_OUTER_RIGHT: -outer_right,
        WALL_FOOT_RIGHT: -table[:, WALL_RIGHT],
        WALL_TOP_LEFT: table[:, WALL_LEFT],
        WALL_TOP_RIGHT: -table[:, WALL_RIGHT],
    }
    lines = np.zeros((len(table), 3, LINES))
    for line, offset in offsets.items():
        lines[:, :, line] = track.offset_line(offset)
    lines[:, 2, [WALL_TOP_LEFT, WALL_TOP_RIGHT]] += WALL_M
    for side, foot, land in ((1.0, WALL_FOOT_LEFT, LAND_LEFT), (-1.0, WALL_FOOT_RIGHT, LAND_RIGHT)):
        out = side * np.stack([-table[:, TANGENT_Y], table[:, TANGENT_X]], axis=1)
        reach = _reach(track, lines[:, :2, foot], out)
        down = np.zeros(len(table))
        bridge = table[:, LEVEL] > 0.0
        ramp = bridge & (reach >= EMBANKMENT[0])
        reach[ramp], down[ramp] = EMBANKMENT
        reach[bridge & ~ramp], down[bridge & ~ramp] = 0.0, DECK_M
        lines[:, :2, land] = lines[:, :2, foot] + out * reach[:, None]
        lines[:, 2, land] = lines[:, 2, foot] - down
    return lines.reshape(len(table), -1)


def _reach(track: Track, foot: NDArray[np.float64], out: NDArray[np.float64]) -> NDArray[np.float64]:
    """How far land reaches from the foot of a wall, (rows,) m."""
    rows = len(track.table)
    tree = scipy.spatial.KDTree(track.table[:, [X, Y]])
    reach = np.zeros(rows)
    for width in LAND_M:
        _, nearest = tree.query(foot + width * out)
        gap = np.abs(nearest - np.arange(rows))
        # On the inside of a bend, many rows are nearly as near as a point's own.
        mine = np.minimum(gap, rows - gap) * track.spacing <= 0.3 * width + 2.0 * track.spacing
        reach = np.where((reach == 0.0) & mine, width, reach)
    return np.asarray(scipy.ndimage.minimum_filter1d(reach, 5, mode="wrap"))


def _colours(track: Track) -> NDArray[np.float64]:
    """Of each strip of each row, (rows, strips, 3)."""
    table = track.table
    rows = np.arange(len(table))
    shade = rows // SHADE_ROWS % 2
    runoff = np.array([RUNOFF.get(name, KERB) for name in SURFACES], np.float64)
    left, right = (runoff[table[:, side].astype(np.int64), shade] for side in (RUNOFF_LEFT, RUNOFF_RIGHT))
    land = np.array(LAND, np.float64)[shade]
    kerb = np.array(KERB, np.float64)[rows // KERB_ROWS % 2]
    road = np.array(ROAD, np.float64)[shade]
    road[0] = START
    paint = np.where(table[:, ZONE, None] > 0.0, ZONE_PAINT, np.array(PAINT, np.float64))
    inward = np.stack([table[:, TANGENT_Y], -table[:, TANGENT_X]], axis=1) @ SUN
    lit = [
        np.array(wall, np.float64)[shade] * (0.86 + 0.16 * side * inward)[:, None]
        for side, wall in ((1.0, LEFT_WALL), (-1.0, RIGHT_WALL))
    ]
    return np.stack([land, land, left, right, kerb, kerb, paint, road, *lit], axis=1)


def _levels(colours: NDArray[np.float64]) -> NDArray[np.uint32]:
    """Packed colours, at level k the means of 2**k rows from a row on."""
    summed = colours.copy()
    levels = [pack(colours)]
    for level in range(1, LEVELS):
        summed = summed + np.roll(summed, -(2 ** (level - 1)), axis=0)
        levels.append(pack(summed / 2.0**level))
    return np.stack(levels)


def _stretches(track: Track) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """Which rows lie in sight of each block of rows: first, begin and end of `Scenery`."""
    line = track.table[:, [X, Y]]
    rows = len(line)
    tree = scipy.spatial.KDTree(line)
    begin: list[int] = []
    end: list[int] = []
    first = [0]
    for block in range(0, rows, BLOCK):
        middle = line[min(block + BLOCK // 2, rows - 1)]
        near = np.zeros(rows + 2, np.bool_)
        near[1:-1][tree.query_ball_point(middle, SIGHT_M)] = True
        edges = np.flatnonzero(near[1:] != near[:-1])
        begin += edges[::2].tolist()
        end += edges[1::2].tolist()
        first.append(len(begin))
    return np.array(first), np.array(begin), np.array(end)
