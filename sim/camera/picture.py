"""Pictures of a world as cameras on its cars take them."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from nathlon.sim.camera.canvas import (
    Canvas,
    Polygons,
    blend,
    develop,
    draw,
    new_canvas,
    new_polygons,
    soften,
)
from nathlon.sim.camera.cars import (
    POLYGONS,
    CarScratch,
    CarShapes,
    add_car,
    car_shapes,
    meet_camera,
    new_car_scratch,
)
from nathlon.sim.camera.lens import AHEAD, DOWN, PLACE, POSE, RIGHT, Lens, aim, lens_of, stand
from nathlon.sim.camera.road import BRIDGE_M, Bands, add_band, look_around, new_bands
from nathlon.sim.camera.scenery import SIGHT_M, STRIPS, RedGreenBlue, Scenery, pack, scenery_of
from nathlon.sim.camera.sensors import FeelingParameters, feel, feeling_parameters
from nathlon.sim.camera_spec import CameraSpec
from nathlon.sim.car import Car
from nathlon.sim.kernel import lean_inlined, lean_kernel
from nathlon.sim.observation import NUMBERS, ObservationSpec
from nathlon.sim.physics.pit_lane import in_lane
from nathlon.sim.state import Cars
from nathlon.sim.track import Track
from nathlon.sim.work_stealing import Tally, ThreadPool, finish, take

HAZE: RedGreenBlue = (196, 212, 226)
ZENITH: RedGreenBlue = (70, 130, 205)
PLAIN: RedGreenBlue = (112, 134, 84)
"""Of the sky at the horizon and high above, and of the land at one's feet."""
SKY_STEEP, LAND_STEEP = 1.6, 6.0
"""How fast they come with the slope of the view."""
PACKED = tuple(int(pack(colour)) for colour in (HAZE, ZENITH, PLAIN))


class Scratch(NamedTuple):
    """What a thread draws with.

    Attributes:
        canvas, polygons, bands, car: of their modules.
        body, camera: (POSE,), poses of the car that looks (float64) and of its camera (float32).
        cars: (cars,) int64, those in sight, the nearest first.
        distance: (cars,) float32, of their nearest ends from the camera, m.
    """

    canvas: Canvas
    polygons: Polygons
    bands: Bands
    car: CarScratch
    body: NDArray[np.float64]
    camera: NDArray[np.float32]
    cars: NDArray[np.int64]
    distance: NDArray[np.float32]


def new_scratch(spec: CameraSpec, most: int, cars: int) -> Scratch:
    """Scratch for pictures of a scenery of at most so many nodes, with so many cars."""
    return Scratch(
        new_canvas(spec.width, spec.height),
        new_polygons(len(STRIPS) * most + POLYGONS * cars),
        new_bands(most),
        new_car_scratch(),
        np.zeros(POSE),
        np.zeros(POSE, np.float32),
        np.zeros(cars, np.int64),
        np.zeros(cars, np.float32),
    )


class CameraParameters(NamedTuple):
    """What the kernels read of a spec.

    Attributes:
        lens: the camera's.
        channels, blur, seed: as of the spec.
        noise: as of the spec; the width of the sum of four even numbers of it.
    """

    lens: Lens
    channels: int
    blur: int
    noise: float
    seed: int


def camera_parameters(spec: CameraSpec) -> CameraParameters:
    """The kernels' view of a camera."""
    return CameraParameters(lens_of(spec), spec.channels, spec.blur, spec.noise, spec.seed)


@lean_inlined
def take_picture(
    field: Cars,
    index: int,
    tick: int,
    picture: np.ndarray,
    scratch: Scratch,
    camera: CameraParameters,
    shapes: CarShapes,
    scenery: Scenery,
) -> None:
    """Fill in what the camera of one car sees.

    Args:
        field: the cars of a race.
        index: of the car that looks.
        tick: dynamics steps since the race's start, for the noise.
        picture: (height * width * channels,) uint8, set.
        scratch: scratch.
        camera: of the spec.
        shapes: of the car model.
        scenery: of the circuit.
    """
    canvas, polygons, lens = scratch.canvas, scratch.polygons, camera.lens
    polygons.number[0] = 0
    car = field[index]
    stand(car, scratch.body)
    aim(scratch.body, lens, scratch.camera)
    draw_backdrop(scratch.camera, lens, canvas.pixels)
    haze = np.uint32(PACKED[0])
    bands = look_around(car.row, scratch.camera, lens, scratch.bands, scenery)
    cars = find_cars(field, index, scratch, lens, shapes, scenery)
    while bands > 0 or cars > 0:
        if cars == 0 or (bands > 0 and scratch.bands.key[bands - 1] >= scratch.distance[cars - 1]):
            bands -= 1
            add_band(bands, haze, lens, scratch.bands, scratch.car.solid, polygons, scenery)
        else:
            cars -= 1
            other = scratch.cars[cars]
            add_car(field[other], other, scratch.camera, haze, lens, scratch.car, polygons, shapes)
    draw(polygons, canvas)
    for _ in range(camera.blur):
        soften(canvas.pixels)
    develop(canvas.pixels, camera.channels, picture)
    if camera.noise > 0.0:
        add_noise(picture, camera.noise, camera.seed, tick, index, car.x, car.y)


@lean_inlined
def find_cars(
    field: Cars, index: int, scratch: Scratch, lens: Lens, shapes: CarShapes, scenery: Scenery
) -> int:
    """Find the cars in sight, the nearest first; returns how many there are."""
    count = 0
    for j in range(len(field)):
        if not field[j].driving or in_lane(field[j]) or (j == index and not lens.sees_itself):
            continue
        apart = meet_camera(field[j], scratch.camera, scratch.car)
        length = np.float32(shapes.half_length + 0.5)
        # One that is not a number is not near either.
        if not apart < SIGHT_M or scratch.car.seen[PLACE + 2] < -length:
            continue
        key = apart - length
        if scenery.bridge[field[j].row] > 0.0:
            key -= BRIDGE_M
        place = count
        while place > 0 and scratch.distance[place - 1] > key:
            scratch.distance[place], scratch.cars[place] = (
                scratch.distance[place - 1],
                scratch.cars[place - 1],
            )
            place -= 1
        scratch.distance[place], scratch.cars[place] = key, j
        count += 1
    return count


@lean_inlined
def draw_backdrop(camera: np.ndarray, lens: Lens, pixels: np.ndarray) -> None:
    """Draw the sky, and below the horizon the land where nothing stands."""
    height, width = pixels.shape
    haze, zenith, plain = np.uint32(PACKED[0]), np.uint32(PACKED[1]), np.uint32(PACKED[2])
    roll = camera[RIGHT + 2] / lens.focal_x
    for y in range(height):
        down = (np.float32(y) + np.float32(0.5) - lens.middle_y) / lens.focal_y
        # How steeply the view rises in the middle of the line, and how many pixels right of it it is level.
        rise = camera[AHEAD + 2] + down * camera[DOWN + 2]
        sky = blend(haze, zenith, int(256.0 * min(SKY_STEEP * max(rise, 0.0), 1.0)))
        land = blend(haze, plain, int(256.0 * min(LAND_STEEP * max(-rise, 0.0), 1.0)))
        level = lens.middle_x - rise / roll if roll != 0.0 else np.float32(0.0 if rise > 0.0 else width)
        left, right = (land, sky) if roll > 0.0 or roll == 0.0 else (sky, land)
        border = int(min(max(level, np.float32(0.0)), np.float32(width)))
        line = pixels[y]
        for x in range(border):
            line[x] = left
        for x in range(border, width):
            line[x] = right


@lean_inlined
def add_noise(
    picture: np.ndarray, deviation: float, seed: int, tick: int, car: int, x: float, y: float
) -> None:
    """Add to each byte a number that depends on the seed, the time, the car and its place alone."""
    # The place tells races apart; it is the same in any batch.
    place = np.uint64(int(1024.0 * (x + 3.0 * y)))
    state = mix(mix(mix(np.uint64(seed)) ^ np.uint64(tick)) ^ np.uint64(car) ^ place << np.uint64(8))
    for i in range(len(picture)):
        state = mix(state + np.uint64(0x9E3779B97F4A7C15))
        total = np.float32(state & np.uint64(0xFFFF)) + np.float32(state >> np.uint64(16) & np.uint64(0xFFFF))
        total += np.float32(state >> np.uint64(32) & np.uint64(0xFFFF)) + np.float32(state >> np.uint64(48))
        # Four even numbers have a deviation of 1 / sqrt(3) together, about as a bell curve has.
        value = picture[i] + deviation * SPREAD * (total / np.float32(65536.0) - np.float32(2.0))
        picture[i] = int(min(max(value + 0.5, 0.0), 255.0))


SPREAD = math.sqrt(3.0)


@lean_inlined
def mix(state: np.uint64) -> np.uint64:
    """Scatter the bits of a number, as splitmix64 does."""
    state = (state ^ state >> np.uint64(30)) * np.uint64(0xBF58476D1CE4E5B9)
    state = (state ^ state >> np.uint64(27)) * np.uint64(0x94D049BB133111EB)
    return state ^ state >> np.uint64(31)


@lean_kernel
def see_cars(
    state: np.ndarray,
    ticks: np.ndarray,
    races: np.ndarray,
    cars: np.ndarray,
    sensors: np.ndarray,
    rows: np.ndarray,
    scratch: Scratch,
    camera: CameraParameters,
    feeling: FeelingParameters,
    shapes: CarShapes,
    scenery: Scenery,
    tally: Tally,
    thread: int,
) -> None:
    """Fill in what cars with cameras see and feel, those that a thread takes.

    Args:
        state: (races, cars) CAR_STATE.
        ticks: (races,) int64.
        races, cars: (n,) indices of the cars that look.
        sensors: (n, k) float32, set, standardised.
        rows: (n, bytes) uint8, of whole records; their last bytes are set to the pictures.
        scratch, camera, shapes, scenery: as of `take_picture`.
        feeling: of the sensors.
        tally, thread: see `nathlon.sim.work_stealing`.
    """
    begin = rows.shape[1] - scratch.canvas.pixels.size * camera.channels
    while True:
        row = take(tally, thread, len(races))
        if row < 0:
            return
        field, index = state[races[row]], cars[row]
        feel(field[index], sensors[row], feeling)
        tick = ticks[races[row]]
        take_picture(field, index, tick, rows[row, begin:], scratch, camera, shapes, scenery)
        finish(tally, thread)


class Photographer:
    """Takes pictures for cars of one model on one circuit."""

    def __init__(self, spec: ObservationSpec, track: Track, car: Car, cars: int) -> None:
        """For races of so many cars; the spec has a camera."""
        assert spec.camera is not None, "who takes pictures has a camera"
        self._spec, self._camera, self._cars = spec, spec.camera, cars
        self._scenery, self._shapes = scenery_of(track), car_shapes(car)
        self._parameters = camera_parameters(spec.camera)
        self._feeling = feeling_parameters(spec, car)
        self._scratch: list[Scratch] = []

    def observe(
        self,
        state: NDArray[np.void],
        ticks: NDArray[np.int64],
        races: NDArray[np.int64],
        cars: NDArray[np.int64],
        threads: ThreadPool,
    ) -> NDArray[np.void]:
        """What some cars see and feel, (n,) records; for the arguments see `see_cars`."""
        seen = self._spec.blank(len(races))
        rows = seen.view(np.uint8).reshape(len(races), seen.itemsize)
        while len(self._scratch) < threads.count:
            self._scratch.append(new_scratch(self._camera, self._scenery.most, self._cars))

        def work(tally: Tally, thread: int) -> None:
            see_cars(
                state,
                ticks,
                races,
                cars,
                seen[NUMBERS],
                rows,
                self._scratch[thread],
                self._parameters,
                self._feeling,
                self._shapes,
                self._scenery,
                tally,
                thread,
            )

        threads.run(work, len(races))
        return seen
