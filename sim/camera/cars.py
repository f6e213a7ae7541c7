"""Drawing cars: boxes with wheels, windows and lights."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from nathlon.sim.camera.canvas import Colour, Polygons, blend
from nathlon.sim.camera.lens import (
    AHEAD,
    DOWN,
    FORWARD,
    LEFT,
    PLACE,
    POSE,
    RIGHT,
    UP,
    Lens,
    add_polygon,
    stand,
)
from nathlon.sim.camera.road import haze_share
from nathlon.sim.camera.scenery import SUN, RedGreenBlue, pack
from nathlon.sim.car import Car
from nathlon.sim.kernel import lean_inlined
from nathlon.sim.state import CarRecord

PAINTS: tuple[RedGreenBlue, ...] = (
    (230, 60, 50),
    (40, 110, 220),
    (250, 200, 40),
    (30, 170, 120),
    (240, 240, 245),
    (240, 120, 30),
    (150, 70, 190),
    (60, 200, 225),
    (235, 110, 165),
    (40, 44, 52),
)
"""Of the cars in turn."""
TYRE, GLASS, WING, SHADOW = (26, 27, 30), (40, 50, 64), (34, 36, 42), (40, 42, 44)
LAMP, TAIL, BRAKING = (250, 246, 214), (120, 14, 18), (255, 40, 34)
BRAKES = 0.05
"""Of the brake, from which on its lights burn."""

PAINTED = -1
"""Instead of a packed colour: that of the car."""
TOP_ONLY, SIDES_ONLY, WHOLE = range(3)
"""Which faces of a solid are drawn."""
POLYGONS = 80
"""Of a car, at most."""
DISC = 8
"""Corners of a wheel."""
DETAILED_M = 35.0
"""From the camera up to which a car has all its parts."""
LIT, SUNNY = 0.74, 0.2
"""Light on an upright face, and how much more or less the sun makes of it."""
ANY, NEAR, FROM_BEHIND, FROM_AHEAD = range(4)
"""When a part is drawn: always, near the camera, or there from behind or from ahead only."""


Level = tuple[float, float, float, float, float]
"""A rectangle: its rear, front, right and left from the centre of mass's place, and its height, m."""


class Solid(NamedTuple):
    """A solid between two rectangles.

    Attributes:
        bottom, top: the rectangles.
        colour: packed, or PAINTED.
        faces: which are drawn.
        when: it is drawn.
    """

    bottom: Level
    top: Level
    colour: int
    faces: int
    when: int


class Lamp(NamedTuple):
    """Lights of one kind on an upright face: where along the car, from and to across and in height, m."""

    along: float
    inner: float
    outer: float
    low: float
    high: float


class CarShapes(NamedTuple):
    """What the kernels read of a car model's looks.

    Attributes:
        solids: (parts, 10) float32, bottom and top of each.
        kinds: (parts, 3) int64: colour, faces, when.
        wheels: (4, 2) float32, where their middles are, m.
        radius, outside: of the wheels, m, and from the middle of the car to their outer sides, m.
        lamps: (2, 5) float32, those at the rear and those at the front, as `Lamp`.
        paints: (n,) uint32, of the cars in turn, packed.
        tyre, tail, braking, lamp: packed colours.
        half_length: m.
    """

    solids: NDArray[np.float32]
    kinds: NDArray[np.int64]
    wheels: NDArray[np.float32]
    radius: float
    outside: float
    lamps: NDArray[np.float32]
    paints: NDArray[np.uint32]
    tyre: int
    tail: int
    braking: int
    lamp: int
    half_length: float


class CarScratch(NamedTuple):
    """What is needed to draw a car.

    Attributes:
        pose: (POSE,) float64, of the car in the world.
        seen: (POSE,) float32, the same as seen from the camera.
        corners: (8, 3) float32, of a part as seen from the camera.
        solid: (DISC, 3) float32, corners of a polygon.
    """

    pose: NDArray[np.float64]
    seen: NDArray[np.float32]
    corners: NDArray[np.float32]
    solid: NDArray[np.float32]


def new_car_scratch() -> CarScratch:
    """Scratch for one thread."""
    return CarScratch(
        np.zeros(POSE),
        np.zeros(POSE, np.float32),
        np.zeros((8, 3), np.float32),
        np.zeros((DISC, 3), np.float32),
    )


@lru_cache
def car_shapes(car: Car) -> CarShapes:
    """The looks of a car model."""
    body = car.body
    half, side, radius = body.length_m / 2.0, body.width_m / 2.0, car.wheel.radius_m
    middle = (body.front_axle_m - body.rear_axle_m) / 2.0

    def level(rear: float, front: float, wide: float, height: float) -> Level:
        return (middle + rear * half, middle + front * half, -wide * side, wide * side, height)

    glass, wing, shadow = (int(pack(colour)) for colour in (GLASS, WING, SHADOW))
    ground = level(-1.02, 1.02, 1.06, 0.02)
    low, high = level(-0.62, 0.36, 0.86, 0.74), level(-0.40, 0.02, 0.66, 1.18)
    spoiler = Solid(level(-1.0, -0.84, 0.96, 0.98), level(-1.0, -0.84, 0.96, 1.06), wing, WHOLE, ANY)
    parts = [
        Solid(ground, ground, shadow, TOP_ONLY, ANY),
        Solid(level(-1.0, 1.0, 0.98, 0.26), level(-1.0, 0.98, 0.94, 0.62), PAINTED, WHOLE, ANY),
        Solid(level(-1.0, 0.6, 0.94, 0.62), level(-0.98, 0.34, 0.88, 0.76), PAINTED, WHOLE, NEAR),
        spoiler._replace(when=FROM_AHEAD),
        Solid(low, high, glass, SIDES_ONLY, ANY),
        Solid(low, high, PAINTED, TOP_ONLY, ANY),
        spoiler._replace(when=FROM_BEHIND),
    ]
    lamps = [
        Lamp(middle - half - 0.01, 0.42 * side, 0.92 * side, 0.44, 0.61),
        Lamp(middle + half + 0.01, 0.5 * side, 0.9 * side, 0.42, 0.56),
    ]
    return CarShapes(
        solids=np.array([(*part.bottom, *part.top) for part in parts], np.float32),
        kinds=np.array([(part.colour, part.faces, part.when) for part in parts], np.int64),
        wheels=np.array(_axles(car), np.float32),
        radius=radius,
        outside=side * 1.01,
        lamps=np.array(lamps, np.float32),
        paints=pack(np.array(PAINTS, np.float64)),
        tyre=int(pack(TYRE)),
        tail=int(pack(TAIL)),
        braking=int(pack(BRAKING)),
        lamp=int(pack(LAMP)),
        half_length=half,
    )


def _axles(car: Car) -> list[tuple[float, float]]:
    body = car.body
    axles = (body.front_axle_m, body.front_track_m), (-body.rear_axle_m, body.rear_track_m)
    return [(along, side * track / 2.0) for along, track in axles for side in (1.0, -1.0)]


@lean_inlined
def meet_camera(car: CarRecord, camera: np.ndarray, scratch: CarScratch) -> float:
    """Set the pose of a car and how it is seen from a camera; returns the distance of its place, m."""
    stand(car, scratch.pose)
    for begin in (PLACE, FORWARD, LEFT, UP):
        x, y, z = scratch.pose[begin], scratch.pose[begin + 1], scratch.pose[begin + 2]
        if begin == PLACE:
            x, y, z = x - camera[PLACE], y - camera[PLACE + 1], z - camera[PLACE + 2]
        scratch.seen[begin] = x * camera[RIGHT] + y * camera[RIGHT + 1] + z * camera[RIGHT + 2]
        scratch.seen[begin + 1] = x * camera[DOWN] + y * camera[DOWN + 1] + z * camera[DOWN + 2]
        scratch.seen[begin + 2] = x * camera[AHEAD] + y * camera[AHEAD + 1] + z * camera[AHEAD + 2]
    right, down, ahead = scratch.seen[PLACE], scratch.seen[PLACE + 1], scratch.seen[PLACE + 2]
    return math.sqrt(right * right + down * down + ahead * ahead)


@lean_inlined
def put(seen: np.ndarray, x: float, y: float, z: float, corner: np.ndarray) -> None:
    """Set a corner (3,) as seen from the camera, from its place on the car."""
    for axis in range(3):
        place = seen[PLACE + axis] + x * seen[FORWARD + axis] + y * seen[LEFT + axis]
        corner[axis] = place + z * seen[UP + axis]


@lean_inlined
def faces_camera(solid: np.ndarray) -> bool:
    """Whether the outside of a polygon is seen, whose corners go round clockwise seen from there."""
    ax, ay, az = solid[1, 0] - solid[0, 0], solid[1, 1] - solid[0, 1], solid[1, 2] - solid[0, 2]
    bx, by, bz = solid[2, 0] - solid[0, 0], solid[2, 1] - solid[0, 1], solid[2, 2] - solid[0, 2]
    x, y, z = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
    return x * solid[0, 0] + y * solid[0, 1] + z * solid[0, 2] > 0.0


FACES = np.array(
    [
        (0, 3, 7, 4),  # rear
        (2, 1, 5, 6),  # front
        (1, 0, 4, 5),  # right
        (3, 2, 6, 7),  # left
        (4, 7, 6, 5),  # top
    ],
    np.int64,
)
"""Corners of the faces of a solid, clockwise seen from outside: rear right, front right, front left and rear
left at the bottom, then the same at the top."""


@lean_inlined
def add_car(
    car: CarRecord,
    index: int,
    camera: np.ndarray,
    haze: Colour,
    lens: Lens,
    scratch: CarScratch,
    polygons: Polygons,
    shapes: CarShapes,
) -> None:
    """Add the polygons of a car.

    Args:
        car: which.
        index: of the car in its race, which decides its colour.
        camera: pose.
        haze: colour, packed.
        lens: of the camera.
        scratch: scratch.
        polygons: added to.
        shapes: of the car model.
    """
    distance = meet_camera(car, camera, scratch)
    seen, corners, solid = scratch.seen, scratch.corners, scratch.solid
    share = haze_share(distance)
    paint = shapes.paints[index % len(shapes.paints)]
    near = distance < DETAILED_M
    towards = seen[PLACE] * seen[FORWARD] + seen[PLACE + 1] * seen[FORWARD + 1]
    from_behind = towards + seen[PLACE + 2] * seen[FORWARD + 2] > 0.0
    sun = SUNNY * (SUN_X * scratch.pose[FORWARD] + SUN_Y * scratch.pose[FORWARD + 1])
    aside = SUNNY * (SUN_X * scratch.pose[LEFT] + SUN_Y * scratch.pose[LEFT + 1])
    for part in range(len(shapes.kinds)):
        colour, faces, when = shapes.kinds[part, 0], shapes.kinds[part, 1], shapes.kinds[part, 2]
        if when != ANY and not near:
            continue
        if (when == FROM_BEHIND and not from_behind) or (when == FROM_AHEAD and from_behind):
            continue
        base = np.uint32(paint if colour == PAINTED else colour)
        for half in range(2):
            at = shapes.solids[part, 5 * half : 5 * half + 5]
            put(seen, at[0], at[2], at[4], corners[4 * half])
            put(seen, at[1], at[2], at[4], corners[4 * half + 1])
            put(seen, at[1], at[3], at[4], corners[4 * half + 2])
            put(seen, at[0], at[3], at[4], corners[4 * half + 3])
        for face in range(4 if faces == TOP_ONLY else 0, 4 if faces == SIDES_ONLY else 5):
            for corner in range(4):
                for axis in range(3):
                    solid[corner, axis] = corners[FACES[face, corner], axis]
            if not faces_camera(solid):
                continue
            light = 1.0
            if face < 2:
                light = LIT - sun if face == 0 else LIT + sun
            elif face < 4:
                light = LIT - aside if face == 2 else LIT + aside
            shaded = blend(0, base, int(256.0 * light))
            add_polygon(solid, 4, 0, blend(shaded, haze, share), False, lens, polygons)
        if part == FIRST_BODY and near:
            add_wheels(car, haze, share, lens, scratch, polygons, shapes)
        if part == FIRST_BODY:
            add_lamps(car, from_behind, haze, share, lens, scratch, polygons, shapes)


SUN_X, SUN_Y = (float(part) for part in SUN / np.hypot(*SUN))
FIRST_BODY = 1
"""The part after which the wheels are drawn; the shadow comes before."""


@lean_inlined
def add_wheels(
    car: CarRecord,
    haze: Colour,
    share: int,
    lens: Lens,
    scratch: CarScratch,
    polygons: Polygons,
    shapes: CarShapes,
) -> None:
    """Add the outer sides of the wheels, the front ones steered."""
    tyre = blend(np.uint32(shapes.tyre), haze, share)
    turn_sine, turn_cosine = math.sin(car.steering), math.cos(car.steering)
    for wheel in range(4):
        side = 1.0 if wheel % 2 == 0 else -1.0
        sine, cosine = (turn_sine, turn_cosine) if wheel < 2 else (0.0, 1.0)
        for corner in range(DISC):
            # Clockwise seen from outside, on either side of the car.
            along = shapes.radius * CIRCLE[corner, 0] * side
            put(
                scratch.seen,
                shapes.wheels[wheel, 0] + along * cosine,
                side * shapes.outside + along * sine,
                shapes.radius * (1.0 + CIRCLE[corner, 1]),
                scratch.solid[corner],
            )
        if faces_camera(scratch.solid):
            add_polygon(scratch.solid, DISC, 0, tyre, False, lens, polygons)


_ANGLES = np.arange(DISC) * (2.0 * math.pi / DISC) + math.pi / DISC
CIRCLE = np.stack([np.cos(_ANGLES), np.sin(_ANGLES)], axis=1).astype(np.float32)
"""Corners of a wheel, counter-clockwise seen from the right of the car."""


@lean_inlined
def add_lamps(
    car: CarRecord,
    rear: bool,
    haze: Colour,
    share: int,
    lens: Lens,
    scratch: CarScratch,
    polygons: Polygons,
    shapes: CarShapes,
) -> None:
    """Add the lights at the rear or at the front; those of brakes are seen from far away."""
    lamp = shapes.lamps[0 if rear else 1]
    braking = rear and car.brake > BRAKES
    colour = np.uint32(shapes.lamp)
    if rear:
        colour = np.uint32(shapes.braking if braking else shapes.tail)
    for side in range(2):
        sign = 1.0 if (side == 0) == rear else -1.0
        inner, outer = lamp[1] * sign, lamp[2] * sign
        left, right = (outer, inner) if side == 0 else (inner, outer)
        put(scratch.seen, lamp[0], right, lamp[3], scratch.solid[0])
        put(scratch.seen, lamp[0], left, lamp[3], scratch.solid[1])
        put(scratch.seen, lamp[0], left, lamp[4], scratch.solid[2])
        put(scratch.seen, lamp[0], right, lamp[4], scratch.solid[3])
        if not faces_camera(scratch.solid):
            continue
        shown = colour if braking else blend(colour, haze, share)
        corners = add_polygon(scratch.solid, 4, 0, shown, braking, lens, polygons)
        if braking and corners > 0:
            last = polygons.number[0] - 1
            glow(polygons.xs[last], corners)
            glow(polygons.ys[last], corners)


@lean_inlined
def glow(places: np.ndarray, corners: int) -> None:
    """Make a polygon at least a pixel wide or high, given one coordinate of its corners."""
    low = high = places[0]
    for i in range(1, corners):
        low, high = min(low, places[i]), max(high, places[i])
    if high - low < np.float32(1.0):
        stretch = np.float32(1.0) / max(high - low, np.float32(1e-6))
        middle = np.float32(0.5) * (low + high)
        for i in range(len(places)):
            places[i] = middle + stretch * (places[i] - middle)
