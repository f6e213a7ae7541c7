"""A clip of a race as a video, drawn from above from the race's log."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import av
import numpy as np
import pygame
from numpy.typing import NDArray

from nathlon.arena.circuit_mesh import surfaces
from nathlon.arena.race_log import NOTICES, RaceLog
from nathlon.reports._motion import poses
from nathlon.reports._video_panels import VideoPanels, brief
from nathlon.reports.car_model import car_model
from nathlon.reports.cars import car_colours, winner
from nathlon.reports.seen_pictures import camera_of, proportion, seen_pictures
from nathlon.sim.errors import InputError
from nathlon.sim.render.panels import write
from nathlon.sim.render.scene import Camera
from nathlon.sim.whole_file import whole_file, writing

SIZE, FINE, RATE = (1280, 720), 2, 30
"""Pixels of a picture, how much larger it is drawn, and pictures a second."""
WIDTH_M = 90.0
BEYOND, EDGE, ZONE, WALL, INK, ALARM = (
    (38, 46, 42),
    (225, 226, 222),
    (242, 177, 52),
    (205, 208, 212),
    (240, 241, 238),
    (255, 70, 80),
)
TRAIL_S, ALARM_S, ALARM_M = 1.5, 1.2, 4.0
"""Lengths of a trail and of a ring around cars that the stewards look at, and its radius."""


def write_video(
    log: RaceLog,
    path: Path,
    follow: int | None = None,
    start_s: float | None = None,
    end_s: float | None = None,
) -> int:
    """Write a clip as .mp4 (H.264, 30 pictures a second) that follows a car, and return its pictures.

    Args:
        log: the race.
        path: the file; one of that name is replaced whole.
        follow: index of the car; the winner if None.
        start_s: where the clip begins in the race; its start if None.
        end_s: where it ends; the race's end if None.

    Raises:
        InputError: if there is nothing of the race between those times.
    """
    last_s = float(log.time_s[-1]) if len(log.time_s) else 0.0
    start, end = max(start_s or 0.0, 0.0), min(last_s if end_s is None else end_s, last_s)
    if end <= start:
        raise InputError(
            f"{path}: no clip from {start:g} s to {end:g} s, expected times from 0 to {last_s:g} s"
        )
    times = start + np.arange(max(round((end - start) * RATE), 1)) / RATE
    with (
        writing(path, "video"),
        whole_file(path) as partial,
        av.open(str(partial), "w", format="mp4", options={"movflags": "faststart"}) as container,
    ):
        stream = container.add_stream("libx264", rate=RATE, options={"crf": "21", "preset": "veryfast"})
        stream.width, stream.height = SIZE
        stream.pix_fmt = "yuv420p"
        for picture in pictures(log, winner(log) if follow is None else follow, times):
            container.mux(stream.encode(av.VideoFrame.from_ndarray(picture, "rgb24")))
        container.mux(stream.encode())
    return len(times)


def pictures(log: RaceLog, followed: int, time_s: NDArray[np.float64]) -> Iterator[NDArray[np.uint8]]:
    """A picture (height, width, 3) of red, green and blue at each of these times of the race."""
    scene = _Scene(log)
    at = poses(log, time_s)
    panels = VideoPanels(log, followed, SIZE)
    camera = camera_of(log, followed)
    seen = None if camera is None else seen_pictures(log, followed, time_s)
    large = pygame.Surface((SIZE[0] * FINE, SIZE[1] * FINE))
    view = Camera(large.get_size(), WIDTH_M)
    for number, now in enumerate(time_s.tolist()):
        places = {name: values[number] for name, values in at.items()}
        tick = int(np.searchsorted(log.time_s, now, side="right")) - 1
        cars = np.stack([places["x_m"], places["y_m"]], axis=1)
        view.at = cars[followed]
        scene.draw(large, view, places, tick, followed)
        scene.draw_alarms(large, view, cars, now)
        picture = pygame.transform.smoothscale(large, SIZE)
        panels.draw(picture, tick, now, cars)
        if seen is not None and camera is not None:
            panels.draw_sight(picture, seen[number], proportion(camera))
        yield np.ascontiguousarray(pygame.surfarray.array3d(picture).swapaxes(0, 1))


class _Scene:
    """The ground and the cars on it."""

    def __init__(self, log: RaceLog) -> None:
        outline = log.outline
        self._log = log
        found = surfaces(outline)
        self._quads = np.concatenate([surface.quads[..., :2] for surface in found.values()])
        self._middles = self._quads.mean(axis=1)
        self._reach = float(np.linalg.norm(self._quads - self._middles[:, None], axis=2).max())
        self._colours = np.repeat(
            [surface.colour for surface in found.values()],
            [len(surface.quads) for surface in found.values()],
            axis=0,
        )
        self._lines = [
            (line[:, :2], np.ones(len(line), bool), colour, width_m)
            for line, colour, width_m in (
                (outline.wall_left, WALL, 0.5),
                (outline.wall_right, WALL, 0.5),
                (outline.left, EDGE, 0.18),
                (outline.right, EDGE, 0.18),
            )
        ]
        self._lines += [(line[:, :2], outline.zone, ZONE, 0.5) for line in (outline.left, outline.right)]
        self._start = np.stack([outline.left[0, :2], outline.right[0, :2]])
        self._names = brief(log.names)
        self._colour_of = car_colours(log)
        self._models = [_from_above(log, colour) for colour in self._colour_of]

    def draw(
        self,
        surface: pygame.Surface,
        camera: Camera,
        places: dict[str, NDArray[np.float64]],
        tick: int,
        followed: int,
    ) -> None:
        """Draw all that the camera sees."""
        surface.fill(BEYOND)
        reach_m = camera.reach_m
        near = np.linalg.norm(self._middles - camera.at, axis=1) < reach_m + self._reach
        for quad, colour in zip(camera.pixels(self._quads[near]), self._colours[near].tolist(), strict=True):
            pygame.draw.polygon(surface, colour, quad.tolist())
        for line, where, colour, width_m in self._lines:
            ends = np.roll(line, -1, axis=0)
            shown = where & (np.linalg.norm(line - camera.at, axis=1) < reach_m + self._reach)
            width = max(round(width_m * camera.scale), 2)
            for a, b in zip(
                camera.pixels(line[shown]).tolist(), camera.pixels(ends[shown]).tolist(), strict=True
            ):
                pygame.draw.line(surface, colour, a, b, width)
        left, right = camera.pixels(self._start).tolist()
        pygame.draw.line(surface, INK, left, right, round(0.5 * camera.scale))
        cars = [car for car in range(len(self._names)) if car != followed] + [followed]
        for car in cars:
            self._draw_trail(surface, camera, places, tick, car)
        for car in cars:
            self._draw_car(surface, camera, places, car)
        for car in cars:
            self._draw_name(surface, camera, places, car)

    def _draw_trail(
        self,
        surface: pygame.Surface,
        camera: Camera,
        places: dict[str, NDArray[np.float64]],
        tick: int,
        car: int,
    ) -> None:
        log = self._log
        first = int(np.searchsorted(log.time_s, log.time_s[tick] - TRAIL_S))
        past = log.samples[first : tick + 1, car]
        x, y = np.append(past["x_m"], places["x_m"][car]), np.append(past["y_m"], places["y_m"][car])
        line = camera.pixels(np.stack([x, y], axis=1)).tolist()
        pygame.draw.lines(surface, self._colour_of[car], False, line, max(round(0.2 * camera.scale), 1))

    def _draw_car(
        self, surface: pygame.Surface, camera: Camera, places: dict[str, NDArray[np.float64]], car: int
    ) -> None:
        corners, colours = self._models[car]
        cos, sin = np.cos(places["yaw_rad"][car]), np.sin(places["yaw_rad"][car])
        at = np.array([places["x_m"][car], places["y_m"][car]])
        pixels = camera.pixels(corners @ np.array([[cos, sin], [-sin, cos]]) + at)
        for quad, colour in zip(pixels.tolist(), colours.tolist(), strict=True):
            pygame.draw.polygon(surface, colour, quad)

    def _draw_name(
        self, surface: pygame.Surface, camera: Camera, places: dict[str, NDArray[np.float64]], car: int
    ) -> None:
        x, y = camera.pixels(np.array([places["x_m"][car], places["y_m"][car]]))
        write(surface, self._names[car], (x + 2, y - 74), 36, (0, 0, 0), "midbottom")
        write(surface, self._names[car], (x, y - 76), 36, INK, "midbottom")

    def draw_alarms(
        self, surface: pygame.Surface, camera: Camera, cars: NDArray[np.float64], now: float
    ) -> None:
        """Draw a ring around each of the cars (C, 2) about which the stewards have just said something."""
        for incident in self._log.incidents:
            if incident.kind not in NOTICES and 0.0 <= now - incident.time_s < ALARM_S:
                for x, y in camera.pixels(cars[list(incident.cars)]).tolist():
                    pygame.draw.circle(surface, ALARM, (x, y), ALARM_M * camera.scale, 6)


def _from_above(log: RaceLog, colour: tuple[int, int, int]) -> tuple[NDArray[np.float64], NDArray[np.uint8]]:
    """Upward faces (n, 4, 2) of a car in its own frame, the lowest first, and their colours (n, 3)."""
    vertices, _, colours = car_model(log.car_length_m, log.car_width_m, colour)
    quads = vertices.astype(np.float64).reshape(-1, 4, 3)
    flat = np.cross(quads[:, 1] - quads[:, 0], quads[:, 2] - quads[:, 0])[:, 2] > 0.0
    order = np.flatnonzero(flat)[np.argsort(quads[flat][..., 2].max(axis=1), kind="stable")]
    return quads[order][..., :2], colours.reshape(-1, 4, 3)[order, 0]
