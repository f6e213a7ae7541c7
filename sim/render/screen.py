"""The screen of a race: pictures taken from above, as arrays or in a window."""

from __future__ import annotations

import os
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from nathlon.sim.episode import Episodes
from nathlon.sim.errors import InputError

os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
import pygame  # it greets on standard output unless told before

from nathlon.sim.render.panels import Panels
from nathlon.sim.render.scene import Camera, CarShape, DrawnGround, Trails

SIZE, WIDTH_M = (800, 600), 150.0
FINENESS = 2
"""The scene is drawn larger by this factor and made small, which smooths its edges."""
LOOK_AHEAD_S, LOOK_AHEAD_M = 0.4, 20.0
"""The camera looks ahead of the car that it follows, as far as it drives in so long, at most so far."""
COLOURS = (
    (226, 61, 54),
    (58, 134, 230),
    (246, 190, 50),
    (70, 178, 104),
    (166, 98, 214),
    (240, 130, 48),
    (48, 184, 192),
    (238, 122, 170),
    (236, 236, 232),
    (146, 112, 84),
)


class Screen:
    """Shows the first race of some episodes."""

    def __init__(self, window: bool, episodes: Episodes, names: Sequence[str], focus: int | None) -> None:
        """See `nathlon.sim.render.open_screen`; `window` asks for one.

        Raises:
            InputError: if a window is asked for where there is no display.
        """
        self._episodes, self._focus = episodes, focus
        labels = list(dict.fromkeys(names))
        self._colours = [COLOURS[labels.index(name) % len(COLOURS)] for name in names]
        self._window = _open_window() if window else None
        self._clock = pygame.time.Clock()
        self._large = pygame.Surface((SIZE[0] * FINENESS, SIZE[1] * FINENESS), 0, 32)
        self._picture = pygame.Surface(SIZE, 0, 32)
        self._camera = Camera(self._large.get_size(), WIDTH_M)
        self._ground = DrawnGround(episodes.world.track)
        self._shape = CarShape(episodes.world.car)
        self._trails = Trails()
        self._panels = Panels(episodes, names, self._colours)

    def start(self) -> None:
        """A race has started."""
        self._trails.clear()
        self.step()

    def step(self) -> None:
        """The race has gone on by a step; a window shows it, in the time that it took."""
        self._trails.note(self._episodes.world.state[0])
        if self._window:
            self._show(self._window)
            self._clock.tick(1.0 / self._episodes.step_s)

    def render(self) -> NDArray[np.uint8] | None:
        """The picture, (600, 800, 3) uint8; None if a window shows it."""
        if self._window:
            self._show(self._window)
            return None
        self._draw()
        pixels = np.frombuffer(pygame.image.tobytes(self._picture, "RGB"), np.uint8)
        return pixels.reshape(SIZE[1], SIZE[0], 3).copy()

    def close(self) -> None:
        """Close the window, if there is one."""
        if self._window:
            pygame.display.quit()
            self._window = None

    def _show(self, window: pygame.Surface) -> None:
        self._draw()
        window.blit(self._picture, (0, 0))
        pygame.event.pump()
        pygame.display.flip()

    def _draw(self) -> None:
        cars, facts = self._episodes.world.state[0], self._episodes.facts()
        focus = int(facts["place"][0].argmin()) if self._focus is None else self._focus
        self._aim(cars[focus])
        self._ground.draw(self._large, self._camera)
        shown = [*(car for car in np.flatnonzero(cars["driving"]).tolist() if car != focus), focus]
        for car in shown:
            self._trails.draw(self._large, self._camera, car, self._colours[car])
        for car in shown:
            self._shape.draw(self._large, self._camera, cars[car], self._colours[car])
        pygame.transform.smoothscale(self._large, SIZE, self._picture)
        for car in shown:
            place = self._camera.pixels(np.array([cars[car]["x"], cars[car]["y"]])) / FINENESS
            self._panels.tag(self._picture, car, (float(place[0]), float(place[1])))
        self._panels.draw(self._picture, focus, facts)

    def _aim(self, car: np.void) -> None:
        ahead = LOOK_AHEAD_S * np.array([car["world_velocity_x"], car["world_velocity_y"]])
        distance = float(np.hypot(*ahead))
        ahead *= min(1.0, LOOK_AHEAD_M / max(distance, 1e-9))
        self._camera.at = np.array([car["x"], car["y"]]) + ahead


def _open_window() -> pygame.Surface:
    try:
        pygame.display.init()
        window = pygame.display.set_mode(SIZE)
    except pygame.error as error:
        raise InputError(
            f"render_mode 'human' needs a display and found none ({error}); "
            "render_mode 'rgb_array' gives pictures without one"
        ) from None
    pygame.display.set_caption("nathlon")
    return window
