"""Drawing the road: which parts of it are in sight, how far away, and what they look like."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from nathlon.sim.camera.canvas import Colour, Four, Polygons, blend, keep, row_at, shows
from nathlon.sim.camera.lens import AHEAD, DOWN, NEAR_M, PLACE, RIGHT, Lens, add_polygon
from nathlon.sim.camera.scenery import (
    BLOCK,
    DECK,
    DETAIL_M,
    KERBS_END,
    KERBS_FROM,
    LAND_LEFT,
    LAND_M,
    LAND_RIGHT,
    LEVELS,
    LINES,
    PAINT_LEFT,
    PAINTED,
    PLAIN_FROM,
    STRIPS,
    WALL_FOOT_LEFT,
    WALL_FOOT_RIGHT,
    WALLS_FROM,
    Scenery,
)
from nathlon.sim.kernel import lean_inlined
from nathlon.sim.simd import LANES, divide, fma, greater, load, multiply, select, store, subtract

HAZE_M = np.float32(420.0)
"""At this distance, two thirds of a colour are haze."""
BRIDGE_M = np.float32(12.0)
"""By which a bridge counts as nearer than it is, so that it hides the road below."""
MIDDLE = PAINT_LEFT
"""The line that stands for the road where its distance is asked."""
WIDEST_M = np.float32(LAND_M[0] + 60.0)
"""A node further behind the camera than this has nothing ahead of it."""
CLEAR_M = NEAR_M + np.float32(1.0)
"""A node whose ends are so far ahead has all of it ahead: walls lean forward by less."""
ALONG = 0b1010
"""Seams of a strip, at its near and its far end."""
X, Y, Z, COLUMN, ROW = range(5)
"""What is known of a point of a line: where it is as seen from the camera, and in the picture."""


class Bands(NamedTuple):
    """The parts of the road in sight, scratch.

    Attributes:
        nodes: (most, 5, LINES) float32, see X to ROW.
        ahead, behind: (most,) bool, whether all of a node is far enough ahead of the camera, or none of it.
        distance: (most,) float32, of the road from the camera, m.
        row: (most,) int64, of the scenery.
        key: (most,) float32, the distance of a band's far end, m; the farthest is drawn first.
        node: (most,) int64, at which a band begins; it ends at the next one.
        level: (most,) int64, of detail.
    """

    nodes: NDArray[np.float32]
    ahead: NDArray[np.bool_]
    behind: NDArray[np.bool_]
    distance: NDArray[np.float32]
    row: NDArray[np.int64]
    key: NDArray[np.float32]
    node: NDArray[np.int64]
    level: NDArray[np.int64]


def new_bands(most: int) -> Bands:
    """Room for so many nodes."""
    ahead, behind = np.zeros((2, most), np.bool_)
    distance, key = np.zeros((2, most), np.float32)
    row, node, level = np.zeros((3, most), np.int64)
    nodes = np.zeros((most, 5, LINES), np.float32)
    return Bands(nodes, ahead, behind, distance, row, key, node, level)


@lean_inlined
def look_around(row: int, camera: np.ndarray, lens: Lens, bands: Bands, scenery: Scenery) -> int:
    """Find the bands in sight, the nearest first.

    Args:
        row: of the track, where the camera is.
        camera: its pose.
        lens: of the camera.
        bands: set.
        scenery: of the circuit.

    Returns:
        how many there are.
    """
    node = count = 0
    block = row // BLOCK
    for stretch in range(scenery.first[block], scenery.first[block + 1]):
        at, end = scenery.begin[stretch], scenery.end[stretch]
        while True:
            view(node, at, camera, lens, bands, scenery)
            if at >= end:
                node += 1
                break
            level, reach = 0, DETAIL_M
            while level < LEVELS - 1 and bands.distance[node] > reach:
                level, reach = level + 1, 2.0 * reach
            at = min(((at >> level) + 1) << level, end)
            bands.node[count], bands.level[count] = node, level
            count += 1
            node += 1
    kept = 0
    for band in range(count):
        node = bands.node[band]
        if hidden(node, bands, lens.width):
            continue
        key = distance_of(bands.distance[node], bands.distance[node + 1], scenery.bridge[bands.row[node]])
        level = bands.level[band]
        place = kept
        while place > 0 and bands.key[place - 1] > key:
            bands.key[place], bands.node[place] = bands.key[place - 1], bands.node[place - 1]
            bands.level[place] = bands.level[place - 1]
            place -= 1
        bands.key[place], bands.node[place], bands.level[place] = key, node, level
        kept += 1
    return kept


@lean_inlined
def distance_of(near: np.float32, far: np.float32, bridge: np.float32) -> np.float32:
    """At which a band is drawn, m."""
    farthest = max(near, far)
    return farthest - BRIDGE_M if bridge > 0.0 else farthest


@lean_inlined
def view(node: int, row: int, camera: np.ndarray, lens: Lens, bands: Bands, scenery: Scenery) -> None:
    """Set a node: a row of the scenery as seen from a camera."""
    points, seen = scenery.points[row], bands.nodes[node]
    x, y, z = camera[PLACE], camera[PLACE + 1], camera[PLACE + 2]
    dx, dy, dz = (
        points[MIDDLE] - x,
        points[LINES + MIDDLE] - y,
        points[2 * LINES + MIDDLE] - z,
    )
    ahead = dx * camera[AHEAD] + dy * camera[AHEAD + 1] + dz * camera[AHEAD + 2]
    bands.row[node] = row
    bands.distance[node] = math.sqrt(dx * dx + dy * dy + dz * dz)
    bands.behind[node] = ahead < -WIDEST_M
    bands.ahead[node] = False
    if bands.behind[node]:
        return
    one = np.float32(1.0)
    for line in range(0, LINES, LANES):
        away = (
            subtract(load(points, line), x),
            subtract(load(points, LINES + line), y),
            subtract(load(points, 2 * LINES + line), z),
        )
        right, down, ahead = along(away, camera, RIGHT), along(away, camera, DOWN), along(away, camera, AHEAD)
        scale = divide(one, select(greater(ahead, NEAR_M), ahead, NEAR_M))
        store(seen[X], line, right)
        store(seen[Y], line, down)
        store(seen[Z], line, ahead)
        store(seen[COLUMN], line, fma(multiply(lens.focal_x, right), scale, lens.middle_x))
        store(seen[ROW], line, fma(multiply(lens.focal_y, down), scale, lens.middle_y))
    ends = seen[Z, LAND_LEFT], seen[Z, LAND_RIGHT]
    bands.ahead[node] = min(ends[0], ends[1]) >= CLEAR_M
    bands.behind[node] = max(ends[0], ends[1]) < NEAR_M


@lean_inlined
def along(away: tuple[Four, Four, Four], camera: np.ndarray, axis: int) -> Four:
    """How far four points lie along an axis of a camera, m."""
    dx, dy, dz = away
    return fma(dz, camera[axis + 2], fma(dx, camera[axis], multiply(dy, camera[axis + 1])))


@lean_inlined
def hidden(node: int, bands: Bands, width: int) -> bool:
    """Whether nothing of the band between a node and the next one can be in the picture."""
    if bands.behind[node] and bands.behind[node + 1]:
        return True
    if not (bands.ahead[node] and bands.ahead[node + 1]):
        return False
    one, other = bands.nodes[node, COLUMN], bands.nodes[node + 1, COLUMN]
    a, b, c, d = one[LAND_LEFT], one[LAND_RIGHT], other[LAND_LEFT], other[LAND_RIGHT]
    return max(max(a, b), max(c, d)) <= 0.0 or min(min(a, b), min(c, d)) >= width


@lean_inlined
def haze_share(distance: float) -> int:
    """How much of a colour is haze, of 256 parts."""
    return int(np.float32(256.0) * distance / (distance + HAZE_M) * np.float32(0.9))


@lean_inlined
def add_band(
    band: int, haze: Colour, lens: Lens, bands: Bands, solid: np.ndarray, polygons: Polygons, scenery: Scenery
) -> None:
    """Add the strips of one of the bands.

    Args:
        band: which.
        haze: its colour, packed.
        lens: of the camera.
        bands, scenery: as of `look_around`.
        solid: (n, 3) float32, scratch.
        polygons: added to.
    """
    node = bands.node[band]
    one, other = bands.nodes[node], bands.nodes[node + 1]
    row, level = bands.row[node], bands.level[band]
    colours = scenery.colours[level, row if row < scenery.colours.shape[1] else 0]
    whole = bands.ahead[node] and bands.ahead[node + 1]
    kerbs = scenery.kerbs[row] or scenery.kerbs[bands.row[node + 1]]
    above = seen_from_above(one, other)
    if not above and scenery.bridge[row] <= 0.0:
        return
    share = haze_share(bands.distance[node])
    # Far away, only walls reach the middle of a row of pixels.
    begin = WALLS_FROM if whole and within_a_row(one, other, lens.height) else 0
    for strip in range(begin, len(STRIPS)):
        if KERBS_FROM <= strip < KERBS_END and not kerbs:
            continue
        if not above and DECK < strip < WALLS_FROM:
            continue
        if level >= PLAIN_FROM and strip == PAINTED:
            continue
        if strip == DECK + 1 and colours[strip] == colours[DECK]:
            continue
        colour = colours[strip] if above or strip > DECK else np.uint32(scenery.concrete)
        left, right = STRIPS[strip, 0], STRIPS[strip, 1]
        if whole:
            place = polygons.number[0]
            xs, ys, seams = polygons.xs[place], polygons.ys[place], polygons.seams[place]
            xs[0], ys[0] = one[COLUMN, left], one[ROW, left]
            xs[1], ys[1] = other[COLUMN, left], other[ROW, left]
            xs[2], ys[2] = other[COLUMN, right], other[ROW, right]
            xs[3], ys[3] = one[COLUMN, right], one[ROW, right]
            if not shows(xs, ys, 4, lens.width, lens.height):
                continue
            for edge in range(4):
                seams[edge] = ALONG >> edge & 1
            keep(4, blend(colour, haze, share), polygons)
        else:
            for axis in range(3):
                solid[0, axis], solid[1, axis] = one[axis, left], other[axis, left]
                solid[2, axis], solid[3, axis] = other[axis, right], one[axis, right]
            add_polygon(solid, 4, ALONG, blend(colour, haze, share), False, lens, polygons)


@lean_inlined
def within_a_row(one: np.ndarray, other: np.ndarray, height: int) -> bool:
    """Whether the ground between two nodes lies between the middles of two rows of pixels."""
    a, b, c, d = one[ROW, LAND_LEFT], one[ROW, LAND_RIGHT], other[ROW, LAND_LEFT], other[ROW, LAND_RIGHT]
    top, bottom = min(min(a, b), min(c, d)), max(max(a, b), max(c, d))
    for wall in (WALL_FOOT_LEFT, WALL_FOOT_RIGHT):  # where land falls off beside a bridge
        a, b = one[ROW, wall], other[ROW, wall]
        top, bottom = min(top, min(a, b)), max(bottom, max(a, b))
    return row_at(top, height) == row_at(bottom, height)


@lean_inlined
def seen_from_above(one: np.ndarray, other: np.ndarray) -> bool:
    """Whether the camera is above the plane of the road between two nodes."""
    left, right = WALL_FOOT_LEFT, WALL_FOOT_RIGHT
    along_x, along_y, along_z = (
        other[X, left] - one[X, right],
        other[Y, left] - one[Y, right],
        other[Z, left] - one[Z, right],
    )
    across_x, across_y, across_z = (
        one[X, left] - other[X, right],
        one[Y, left] - other[Y, right],
        one[Z, left] - other[Z, right],
    )
    up_x = along_y * across_z - along_z * across_y
    up_y = along_z * across_x - along_x * across_z
    up_z = along_x * across_y - along_y * across_x
    return up_x * one[X, left] + up_y * one[Y, left] + up_z * one[Z, left] < 0.0
