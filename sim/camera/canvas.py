"""Drawing row by row: polygons of one colour, one over the other.

Colours are packed numbers, red in the lowest byte. A pixel at the end of a row of them counts as far as it is
covered, so that edges are smooth; where two polygons meet in a seam, each pixel belongs to one of them.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from nathlon.sim.kernel import lean_inlined
from nathlon.sim.simd import (
    LANES,
    add,
    ceil,
    divide,
    floor,
    fma,
    greater,
    load,
    logical_or,
    select,
    store,
    subtract,
)

CORNERS = 3 * LANES
"""Of a polygon at most."""
RED_AND_BLUE, GREEN = np.uint32(0xFF00FF), np.uint32(0x00FF00)
HALF = np.float32(0.5)

Colour = np.uint32
"""Packed."""
Four = tuple[np.float32, np.float32, np.float32, np.float32]


class Polygons(NamedTuple):
    """What is to be drawn, in this order.

    Attributes:
        xs, ys: (most, CORNERS + 1) float32, corners, pixels from the top left, then the first one again as
            often as it takes to come to the end of a vector of edges.
        seams: (most, CORNERS) float32, 1 where the edge after a corner is a seam, else 0.
        corners: (most,) int64, how many there are.
        colour: (most,) uint32, packed.
        number: (1,) int64, of polygons there are.
    """

    xs: NDArray[np.float32]
    ys: NDArray[np.float32]
    seams: NDArray[np.float32]
    corners: NDArray[np.int64]
    colour: NDArray[np.uint32]
    number: NDArray[np.int64]


class Edges(NamedTuple):
    """Those of the polygon that is drawn, (CORNERS,) float32 each.

    Attributes:
        start, slope: x at the middle of row y is `start + slope * y`.
        first, last: of the rows that an edge crosses; the last one is above the first where there is none.
    """

    start: NDArray[np.float32]
    slope: NDArray[np.float32]
    first: NDArray[np.float32]
    last: NDArray[np.float32]


class Canvas(NamedTuple):
    """What is drawn on.

    Attributes:
        pixels: (height, width) uint32, packed.
        edges: scratch.
    """

    pixels: NDArray[np.uint32]
    edges: Edges


def new_polygons(most: int) -> Polygons:
    """Room for so many polygons."""
    xs, ys = np.zeros((2, most, CORNERS + 1), np.float32)
    seams, corners = np.zeros((most, CORNERS), np.float32), np.zeros(most, np.int64)
    return Polygons(xs, ys, seams, corners, np.zeros(most, np.uint32), np.zeros(1, np.int64))


def new_canvas(width: int, height: int) -> Canvas:
    """A canvas for a picture of so many pixels."""
    pixels = np.zeros((height, width), np.uint32)
    return Canvas(pixels, Edges(*np.zeros((4, CORNERS), np.float32)))


@lean_inlined
def blend(under: Colour, over: Colour, share: int) -> Colour:
    """The colour of which `share` of 256 parts is that above."""
    rest = 256 - share
    both = ((under & RED_AND_BLUE) * rest + (over & RED_AND_BLUE) * share) >> 8
    green = ((under & GREEN) * rest + (over & GREEN) * share) >> 8
    return np.uint32((both & RED_AND_BLUE) | (green & GREEN))


@lean_inlined
def row_at(y: float, height: int) -> int:
    """The first row of pixels whose middle is not above a height; the number of rows if there is none."""
    return min(max(int(math.ceil(y - HALF)), 0), height)  # noqa: RUF046  # in a kernel it is a float


@lean_inlined
def shows(xs: np.ndarray, ys: np.ndarray, corners: int, width: int, height: int) -> bool:
    """Whether a polygon covers the middle of a row within the picture."""
    left = right = xs[0]
    top = bottom = ys[0]
    for i in range(1, corners):
        left, right = min(left, xs[i]), max(right, xs[i])
        top, bottom = min(top, ys[i]), max(bottom, ys[i])
    return right > 0.0 and left < width and row_at(top, height) < row_at(bottom, height)


@lean_inlined
def keep(corners: int, colour: Colour, polygons: Polygons) -> None:
    """Add the polygon whose corners and seams stand behind those that there are."""
    place = polygons.number[0]
    xs, ys = polygons.xs[place], polygons.ys[place]
    for i in range(corners, whole(corners) + 1):
        xs[i], ys[i] = xs[0], ys[0]
    polygons.corners[place], polygons.colour[place] = corners, colour
    polygons.number[0] += 1


@lean_inlined
def whole(corners: int) -> int:
    """How many corners there are with those that fill up a vector."""
    return (corners + LANES - 1) // LANES * LANES


@lean_inlined
def draw(polygons: Polygons, canvas: Canvas) -> None:
    """Draw all polygons, one over the other."""
    pixels, edges = canvas.pixels, canvas.edges
    height, width = np.float32(pixels.shape[0]), np.float32(pixels.shape[1])
    nothing = np.float32(0.0)
    for polygon in range(polygons.number[0]):
        xs, ys, seams = polygons.xs[polygon], polygons.ys[polygon], polygons.seams[polygon]
        corners, colour = whole(polygons.corners[polygon]), polygons.colour[polygon]
        top, bottom = height, nothing
        for at in range(0, corners, LANES):
            highest, lowest = set_edges(xs, ys, at, height, edges)
            top, bottom = min(top, highest), max(bottom, lowest)
        for row in range(int(top), int(bottom)):
            y = np.float32(row)
            left, right = width, nothing
            for at in range(0, corners, LANES):
                x = fma(load(edges.slope, at), y, load(edges.start, at))
                x = select(greater(load(seams, at), nothing), floor(add(x, HALF)), x)
                elsewhere = logical_or(greater(load(edges.first, at), y), greater(y, load(edges.last, at)))
                left = min(left, least(select(elsewhere, width, x)))
                right = max(right, greatest(select(elsewhere, nothing, x)))
            draw_span(pixels[row], left, right, colour)


@lean_inlined
def set_edges(
    xs: np.ndarray, ys: np.ndarray, at: int, height: np.float32, edges: Edges
) -> tuple[np.float32, np.float32]:
    """Set a vector of edges, after the corners from `at` on; returns their first row and their end."""
    x, y = load(xs, at), load(ys, at)
    slope = divide(subtract(load(xs, at + 1), x), subtract(load(ys, at + 1), y))
    row, after = rows_at(y, height), rows_at(load(ys, at + 1), height)
    down = greater(after, row)
    first, end = select(down, row, after), select(down, after, row)
    store(edges.slope, at, slope)
    store(edges.start, at, fma(subtract(HALF, y), slope, x))
    store(edges.first, at, first)
    store(edges.last, at, subtract(end, np.float32(1.0)))
    return least(first), greatest(end)


@lean_inlined
def rows_at(y: Four, height: np.float32) -> Four:
    """As `row_at` of each of four numbers."""
    row = ceil(subtract(y, HALF))
    row = select(greater(row, np.float32(0.0)), row, np.float32(0.0))
    return select(greater(height, row), row, height)


@lean_inlined
def least(numbers: Four) -> np.float32:
    """Of four numbers."""
    a, b, c, d = numbers
    return min(min(a, b), min(c, d))


@lean_inlined
def greatest(numbers: Four) -> np.float32:
    """Of four numbers."""
    a, b, c, d = numbers
    return max(max(a, b), max(c, d))


@lean_inlined
def draw_span(line: np.ndarray, begin: np.float32, end: np.float32, colour: Colour) -> None:
    """Draw from one place of a line to another."""
    width = len(line)
    # Written so that what is no number draws nothing beyond the line.
    if not begin > 0.0:
        begin = np.float32(0.0)
    if not end < width:
        end = np.float32(width)
    if not begin < end:
        return
    low, high = int(begin), int(end)
    if low == high:
        line[low] = blend(line[low], colour, int(np.float32(256.0) * (end - begin)))
        return
    line[low] = blend(line[low], colour, int(np.float32(256.0) * (np.float32(low + 1) - begin)))
    # Of an unsigned number the compiler need not ask whether it counts from the end.
    for x in range(np.uint64(low + 1), np.uint64(high)):
        line[x] = colour
    if high < width:
        line[high] = blend(line[high], colour, int(np.float32(256.0) * (end - np.float32(high))))


@lean_inlined
def soften(pixels: np.ndarray) -> None:
    """Mix each pixel with its neighbours, by 1, 2 and 1 of four parts each way."""
    height, width = pixels.shape
    for y in range(height):
        before = pixels[y, 0]
        for x in range(width):
            here = pixels[y, x]
            after = pixels[y, x + 1] if x + 1 < width else here
            pixels[y, x] = blend(here, blend(before, after, 128), 128)
            before = here
    for x in range(width):
        before = pixels[0, x]
        for y in range(height):
            here = pixels[y, x]
            after = pixels[y + 1, x] if y + 1 < height else here
            pixels[y, x] = blend(here, blend(before, after, 128), 128)
            before = here


@lean_inlined
def develop(pixels: np.ndarray, channels: int, picture: np.ndarray) -> None:
    """Set the bytes of a picture, (height * width * channels,) uint8."""
    height, width = pixels.shape
    for y in range(height):
        colours = pixels[y]
        line = picture[y * width * channels : (y + 1) * width * channels]
        if channels == 3:
            for x in range(width):
                line[3 * x] = np.uint8(colours[x])
                line[3 * x + 1] = np.uint8(colours[x] >> 8)
                line[3 * x + 2] = np.uint8(colours[x] >> 16)
        else:
            for x in range(width):
                red, green, blue = colours[x] & 0xFF, colours[x] >> 8 & 0xFF, colours[x] >> 16
                line[x] = np.uint8((77 * red + 150 * green + 29 * blue) >> 8)
