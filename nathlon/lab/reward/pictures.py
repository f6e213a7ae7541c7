"""Pictures of a clip, for judges that cannot play it."""

from __future__ import annotations

import io

import numpy as np
import pygame
from PIL import Image

from nathlon.lab.reward.clips import Clips, Studio
from nathlon.sim.car import load_car
from nathlon.sim.render.scene import Camera, CarShape, DrawnGround
from nathlon.sim.state import CAR_STATE
from nathlon.sim.track import load_track

MOMENTS = 6
COLUMNS = 3
SIZE = (320, 240)
"""Of the picture of a moment, pixels."""
SHOWN_M = 90.0
"""From its left to its right."""
OWN, OTHER = (226, 58, 58), (110, 160, 220)


class Painter:
    """Paints clips of a studio.

    Args:
        studio: where they were made.
    """

    def __init__(self, studio: Studio) -> None:
        self._ground = DrawnGround(load_track(studio.circuit))
        self._shape = CarShape(load_car(studio.car))

    def paint(self, clips: Clips, start: int) -> bytes:
        """A PNG of a clip: moments of it in rows, the car in question in the middle of each, in red."""
        poses = clips.poses[start]
        moments = np.linspace(0, len(poses) - 1, MOMENTS).round().astype(int)
        rows = -(-MOMENTS // COLUMNS)
        sheet = Image.new("RGB", (COLUMNS * SIZE[0], rows * SIZE[1]))
        for number, moment in enumerate(moments):
            place = (number % COLUMNS * SIZE[0], number // COLUMNS * SIZE[1])
            sheet.paste(self._moment(poses[moment]), place)
        file = io.BytesIO()
        sheet.save(file, "PNG")
        return file.getvalue()

    def _moment(self, poses: np.ndarray) -> Image.Image:
        """A picture of all cars, (cars, 3), around the last."""
        surface, camera = pygame.Surface(SIZE), Camera(SIZE, SHOWN_M)
        camera.at = poses[-1, :2].copy()
        self._ground.draw(surface, camera)
        own = len(poses) - 1
        for index, (x, y, yaw) in enumerate(poses):
            cars = np.zeros(1, CAR_STATE)
            cars["x"], cars["y"], cars["yaw"] = x, y, yaw
            self._shape.draw(surface, camera, cars[0], OWN if index == own else OTHER)
        return Image.frombytes("RGB", SIZE, pygame.image.tobytes(surface, "RGB"))
