"""The scene from above: the ground around a place, and the cars on it."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import pygame
from numpy.typing import NDArray
from pygame import gfxdraw

from nathlon.sim.car import Car
from nathlon.sim.track import (
    KERB_LEFT,
    KERB_RIGHT,
    LEFT,
    LEVEL,
    RIGHT,
    RUNOFF_LEFT,
    RUNOFF_RIGHT,
    SURFACES,
    WALL_LEFT,
    WALL_RIGHT,
    ZONE,
    Track,
    X,
    Y,
)

Colour = tuple[int, int, int]
Points = NDArray[np.float64]

BEYOND, BEYOND_LINE = (38, 46, 42), (45, 54, 49)
ROAD, EDGE_LINE, START_LINE, ZONE_LINE = (72, 76, 82), (225, 226, 222), (245, 245, 245), (242, 177, 52)
WALL, WALL_SHADE = (205, 208, 212), (24, 28, 30)
KERB = ((200, 45, 50), (236, 236, 232))
SURFACE: dict[str, tuple[Colour, Colour]] = {
    "tarmac": ((98, 103, 109), (94, 99, 105)),
    "grass": ((84, 124, 66), (78, 117, 61)),
    "gravel": ((196, 176, 132), (190, 170, 126)),
}
"""Each in two shades that take turns along the road, so that speed can be seen."""
TYRE, GLASS, BRAKE_LIGHT = (22, 23, 25), (28, 34, 42), (255, 70, 60)
SHADE_ROWS, LINE_M, GRID_M = 6, 0.18, 50.0
TRAIL = 24
"""Steps that a trail is long."""

# Outlines of a car in its own frame, in half lengths forward and half widths to the left.
BODY = np.array(
    [(1.0, 0.35), (0.93, 0.72), (0.6, 0.88), (0.1, 0.84), (-0.45, 0.9), (-0.92, 0.9), (-1.0, 0.6)]
)
WINDSCREEN = np.array([(0.3, 0.58), (0.06, 0.68), (0.06, 0.0)])
REAR_WINDOW = np.array([(-0.38, 0.62), (-0.58, 0.5), (-0.58, 0.0)])
WING = np.array([(-0.84, 0.98), (-1.0, 0.98), (-1.0, 0.0)])
LIGHT = np.array([(-0.96, 0.86), (-1.04, 0.86), (-1.04, 0.42), (-0.96, 0.42)])
WHEEL_M = np.array([(0.33, 0.15), (0.33, -0.15), (-0.33, -0.15), (-0.33, 0.15)])


def _mirrored(half: Points) -> Points:
    """The whole outline, of which the left half is given from front to rear."""
    return np.concatenate([half, half[::-1] * [1.0, -1.0]])


class Camera:
    """Where a picture is taken: metres of the map to pixels, north up."""

    def __init__(self, size: tuple[int, int], width_m: float) -> None:
        """A picture of `size` pixels that shows `width_m` metres from left to right."""
        self.scale = size[0] / width_m
        self.middle = np.array(size) / 2.0
        self.at = np.zeros(2)

    def pixels(self, points: Points) -> Points:
        """Pixels of points on the map, (..., 2)."""
        return self.middle + (points - self.at) * [self.scale, -self.scale]

    @property
    def reach_m(self) -> float:
        """From the middle of the picture to its corners."""
        return float(np.hypot(*self.middle)) / self.scale


class Strip(NamedTuple):
    """A ribbon along the road: its sides (rows, 2), its colours (rows, 3), the rows where it lies."""

    left: Points
    right: Points
    colours: NDArray[np.int64]
    there: NDArray[np.bool_]


class DrawnGround:
    """The road and all that lies beside it, ready to be drawn around any place."""

    def __init__(self, track: Track) -> None:
        table = track.table
        rows = np.arange(len(table))
        self._line = table[:, [X, Y]]
        self._widest = float(table[:, [WALL_LEFT, WALL_RIGHT]].max())
        self._zone = table[:, ZONE] > 0.0
        self._bridge = table[:, LEVEL] > 0.0
        self._lines: list[tuple[Points, Points]] = []
        self._strips: list[Strip] = []
        everywhere = np.ones(len(table), np.bool_)
        shade = rows // SHADE_ROWS % 2
        for sign, edge, kerb, runoff, wall in (
            (1.0, LEFT, KERB_LEFT, RUNOFF_LEFT, WALL_LEFT),
            (-1.0, RIGHT, KERB_RIGHT, RUNOFF_RIGHT, WALL_RIGHT),
        ):
            edges, walls, kerbs = (
                track.offset_line(sign * offset)[:, :2]
                for offset in (table[:, edge], table[:, wall], table[:, edge] + table[:, kerb])
            )
            surfaces = np.array([SURFACE.get(name, KERB) for name in SURFACES])
            beside = surfaces[table[:, runoff].astype(np.int64), shade]
            self._strips.append(Strip(edges, walls, beside, everywhere))
            self._strips.append(Strip(edges, kerbs, np.array(KERB)[rows % 2], table[:, kerb] > 0.0))
            self._lines.append((edges, walls))
        (left, _), (right, _) = self._lines
        self._strips.append(Strip(left, right, np.tile(ROAD, (len(table), 1)), everywhere))
        self._start = _chequers(track)

    def draw(self, surface: pygame.Surface, camera: Camera) -> None:
        """Draw all that the camera sees."""
        surface.fill(BEYOND)
        self._draw_grid(surface, camera)
        near = np.hypot(*(self._line - camera.at).T) < camera.reach_m + self._widest
        # The upper road of a bridge covers the lower one.
        for rows in (near & ~self._bridge, near & self._bridge):
            self._draw_rows(surface, camera, rows)
        for number, square in enumerate(camera.pixels(self._start)):
            pygame.draw.polygon(surface, START_LINE if number % 2 else TYRE, square.tolist())

    def _draw_rows(self, surface: pygame.Surface, camera: Camera, rows: NDArray[np.bool_]) -> None:
        """Draw some rows of the ground, over those that are there."""
        for strip in self._strips:
            for first, last in _runs(rows & strip.there, strip.colours):
                along = np.arange(first, last + 2) % len(rows)
                outline = np.concatenate([strip.left[along], strip.right[along[::-1]]])
                pygame.draw.polygon(surface, strip.colours[first], camera.pixels(outline).tolist())
        for edges, walls in self._lines:
            self._draw_line(surface, camera, edges, rows & ~self._zone, EDGE_LINE, LINE_M)
            self._draw_line(surface, camera, edges, rows & self._zone, ZONE_LINE, 2.5 * LINE_M)
            self._draw_line(surface, camera, walls, rows, WALL_SHADE, 1.0)
            self._draw_line(surface, camera, walls, rows, WALL, 0.45)

    def _draw_grid(self, surface: pygame.Surface, camera: Camera) -> None:
        """Faint lines on the ground beyond the walls, by which motion is seen."""
        width, height = surface.get_size()
        low = camera.at - camera.middle / camera.scale
        for axis, length in ((0, width), (1, height)):
            first = np.ceil(low[axis] / GRID_M) * GRID_M
            for metres in np.arange(first, low[axis] + length / camera.scale, GRID_M):
                at = round((metres - low[axis]) * camera.scale)
                start, end = (
                    ((at, 0), (at, height)) if axis == 0 else ((0, height - at), (width, height - at))
                )
                pygame.draw.line(surface, BEYOND_LINE, start, end, 2)

    @staticmethod
    def _draw_line(
        surface: pygame.Surface,
        camera: Camera,
        line: Points,
        where: NDArray[np.bool_],
        colour: Colour,
        width_m: float,
    ) -> None:
        width = max(round(width_m * camera.scale), 2)
        for first, last in _runs(where):
            along = np.arange(first, last + 2) % len(line)
            pygame.draw.lines(surface, colour, False, camera.pixels(line[along]).tolist(), width)


def _runs(where: NDArray[np.bool_], colours: NDArray[np.int64] | None = None) -> Iterator[tuple[int, int]]:
    """First and last of the rows that belong together: neighbours that are wanted and of one colour."""
    rows = np.flatnonzero(where)
    if not len(rows):
        return
    breaks = np.diff(rows) > 1
    if colours is not None:
        breaks |= (np.diff(colours[rows], axis=0) != 0).any(axis=1)
    firsts = np.concatenate([[0], np.flatnonzero(breaks) + 1])
    lasts = np.concatenate([firsts[1:], [len(rows)]]) - 1
    yield from zip(rows[firsts].tolist(), rows[lasts].tolist(), strict=True)


def _chequers(track: Track) -> Points:
    """The squares of the start and finish line, two rows deep, (n, 4, 2)."""
    left, right = track.table[0, LEFT], track.table[0, RIGHT]
    count = max(round((left + right) / 0.8), 2)
    across = np.linspace(-right, left, count + 1)
    squares = []
    for number in range(count):
        for depth in (0, 1)[:: 1 if number % 2 else -1]:
            along = 0.8 * np.array([depth, depth + 1, depth + 1, depth])
            beside = across[[number, number, number + 1, number + 1]]
            squares.append(np.stack(track.pose(along, beside)[:2], axis=1))
    return np.array(squares)


class Trails:
    """Where cars were in their last steps."""

    def __init__(self) -> None:
        self._places: deque[Points] = deque(maxlen=TRAIL)

    def clear(self) -> None:
        """Forget all."""
        self._places.clear()

    def note(self, cars: NDArray[np.void]) -> None:
        """Add the present places of all cars."""
        self._places.append(np.stack([cars["x"], cars["y"]], axis=1))

    def draw(self, surface: pygame.Surface, camera: Camera, car: int, colour: Colour) -> None:
        """Draw the trail of one car, the older the fainter."""
        if len(self._places) < 2:
            return
        line = camera.pixels(np.array([place[car] for place in self._places]))
        step = np.diff(line, axis=0)
        aside = step[:, ::-1] * [1.0, -1.0] / np.maximum(np.hypot(*step.T), 1e-9)[:, None]
        aside *= 0.25 * camera.scale
        quads = np.stack([line[:-1] + aside, line[1:] + aside, line[1:] - aside, line[:-1] - aside], axis=1)
        for number, quad in enumerate(quads.tolist(), start=1):
            gfxdraw.filled_polygon(surface, quad, (*colour, 150 * number // len(quads)))


class CarShape:
    """The outline of a car model, and how to draw it."""

    def __init__(self, car: Car) -> None:
        body = car.body
        half = np.array([body.length_m, body.width_m]) / 2.0
        middle = np.array([(body.front_axle_m - body.rear_axle_m) / 2.0, 0.0])
        parts = [_mirrored(part) for part in (BODY, WINDSCREEN, REAR_WINDOW, WING)]
        parts += [LIGHT, LIGHT * [1.0, -1.0]]
        self._parts = [part * half + middle for part in parts]
        self._axles = np.array(
            [
                (along, side * width / 2.0)
                for along, width in (
                    (body.front_axle_m, body.front_track_m),
                    (-body.rear_axle_m, body.rear_track_m),
                )
                for side in (1.0, -1.0)
            ]
        )

    def draw(self, surface: pygame.Surface, camera: Camera, car: np.void, colour: Colour) -> None:
        """Draw a car, a record of CAR_STATE, in its colour."""
        steered = WHEEL_M @ _turn(float(car["steering"]))
        wheels = [axle + (steered if axle[0] > 0.0 else WHEEL_M) for axle in self._axles]
        outlines = [*wheels, *self._parts]
        points = np.concatenate(outlines) @ _turn(float(car["yaw"])) + [car["x"], car["y"]]
        ends = np.cumsum([len(outline) for outline in outlines])[:-1]
        pixels = [part.tolist() for part in np.split(camera.pixels(points), ends)]
        shade = 0.35 * camera.scale
        gfxdraw.filled_polygon(surface, [(x + shade, y + shade) for x, y in pixels[4]], (0, 0, 0, 90))
        colours = [TYRE] * 4 + [colour, GLASS, GLASS, _darker(colour)]
        if car["brake"] > 0.05:
            colours += [BRAKE_LIGHT] * 2
        for part, fill in zip(pixels, colours, strict=False):
            pygame.draw.polygon(surface, fill, part)


def _turn(angle: float) -> Points:
    """The matrix that turns row vectors by an angle, counter-clockwise."""
    sine, cosine = np.sin(angle), np.cos(angle)
    return np.array([[cosine, sine], [-sine, cosine]])


def _darker(colour: Colour) -> Colour:
    return (colour[0] // 2, colour[1] // 2, colour[2] // 2)
