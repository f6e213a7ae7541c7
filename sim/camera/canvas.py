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

CORNERS = 9
"""Of a polygon at most."""
RED_AND_BLUE, GREEN = np.uint32(0xFF00FF), np.uint32(0x00FF00)
HALF = np.float32(0.5)

Colour = np.uint32
"""Packed."""


class Polygons(NamedTuple):
    """What is to be drawn, in this order.

    Attributes:
        xs, ys: (most, CORNERS) float32, corners, pixels from the top left.
        corners: (most,) int64, how many there are.
        seams: (most,) int64, bit i is set where the edge after corner i is a seam.
        colour: (most,) uint32, packed.
        number: (1,) int64, of polygons there are.
    """

    xs: NDArray[np.float32]
    ys: NDArray[np.float32]
    corners: NDArray[np.int64]
    seams: NDArray[np.int64]
    colour: NDArray[np.uint32]
    number: NDArray[np.int64]


class Edges(NamedTuple):
    """Those of the polygon that is drawn, (CORNERS,) each.

    Attributes:
        start, slope: float32, x at the middle of row y is `start + slope * y`.
        begin, end: int64, the rows that an edge crosses.
        seam: int64, whether it is one.
    """

    start: NDArray[np.float32]
    slope: NDArray[np.float32]
    begin: NDArray[np.int64]
    end: NDArray[np.int64]
    seam: NDArray[np.int64]


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
    xs, ys = np.zeros((2, most, CORNERS), np.float32)
    corners, seams = np.zeros((2, most), np.int64)
    return Polygons(xs, ys, corners, seams, np.zeros(most, np.uint32), np.zeros(1, np.int64))


def new_canvas(width: int, height: int) -> Canvas:
    """A canvas for a picture of so many pixels."""
    start, slope = np.zeros((2, CORNERS), np.float32)
    begin, end, seam = np.zeros((3, CORNERS), np.int64)
    pixels = np.zeros((height, width), np.uint32)
    return Canvas(pixels, Edges(start, slope, begin, end, seam))


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
def draw(polygons: Polygons, canvas: Canvas) -> None:
    """Draw all polygons, one over the other."""
    pixels, edges = canvas.pixels, canvas.edges
    height, width = pixels.shape
    for polygon in range(polygons.number[0]):
        xs, ys = polygons.xs[polygon], polygons.ys[polygon]
        corners, seams = polygons.corners[polygon], polygons.seams[polygon]
        x0, y0, row0 = xs[corners - 1], ys[corners - 1], row_at(ys[corners - 1], height)
        seam = seams >> (corners - 1) & 1
        first, last = height, 0
        for i in range(corners):
            x1, y1, row1 = xs[i], ys[i], row_at(ys[i], height)
            edges.begin[i], edges.end[i], edges.seam[i] = min(row0, row1), max(row0, row1), seam
            slope = (x1 - x0) / (y1 - y0) if row0 != row1 else np.float32(0.0)
            edges.start[i], edges.slope[i] = x0 + (HALF - y0) * slope, slope
            first, last = min(first, row1), max(last, row1)
            x0, y0, row0, seam = x1, y1, row1, seams >> i & 1
        colour = polygons.colour[polygon]
        for y in range(first, last):
            left, right = np.float32(width), np.float32(0.0)
            for i in range(corners):
                if edges.begin[i] <= y < edges.end[i]:
                    x = edges.start[i] + np.float32(y) * edges.slope[i]
                    if edges.seam[i]:
                        x = np.float32(math.floor(x + HALF))
                    left, right = min(left, x), max(right, x)
            draw_span(pixels[y], left, right, colour)


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
