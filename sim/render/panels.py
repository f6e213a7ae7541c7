"""What stands over the scene: time and lap, the order, the dials of one car, the map."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import Any

import numpy as np
import pygame
from numpy.typing import NDArray

from nathlon.sim.episode import Episodes, Facts
from nathlon.sim.names import printable
from nathlon.sim.track import Track, X, Y

Colour = tuple[int, int, int]

INK, FAINT, PANEL = (240, 241, 238), (168, 174, 178), (18, 21, 24, 205)
THROTTLE, BRAKE, STEERING, TRACK_LINE = (96, 200, 110), (232, 74, 66), (250, 200, 80), (150, 156, 162)
MARGIN, PADDING, ROW, MAP = 12, 10, 18, (190, 160)
NAME_LENGTH, LISTED = 18, 10
"""Letters of a name, and rows of the order, for which there is room."""


def short(name: str) -> str:
    """A name that fits beside a car."""
    return name if len(name) <= NAME_LENGTH else name[: NAME_LENGTH - 1] + "…"


@lru_cache
def _font(size: int) -> pygame.font.Font:
    pygame.font.init()
    return pygame.font.Font(None, size)


@lru_cache(maxsize=512)
def _line(text: str, size: int, colour: Colour) -> pygame.Surface:
    return _font(size).render(printable(text), True, colour)


def write(
    surface: pygame.Surface, text: str, at: tuple[float, float], size: int, colour: Colour, to: str
) -> None:
    """Write a line; `to` says which point of it lies at `at`, such as `topleft` or `midright`."""
    line = _line(text, size, colour)
    surface.blit(line, line.get_rect(**{to: at}))


@lru_cache
def _plate(size: tuple[int, int]) -> pygame.Surface:
    plate = pygame.Surface(size, pygame.SRCALPHA)
    pygame.draw.rect(plate, PANEL, plate.get_rect(), border_radius=8)
    return plate


class Panels:
    """All panels of a race."""

    def __init__(self, episodes: Episodes, names: Sequence[str], colours: Sequence[Colour]) -> None:
        self._episodes = episodes
        self._names, self._colours = [short(name) for name in names], colours
        self._map = _Map(episodes.world.track)

    def draw(self, surface: pygame.Surface, focus: int, facts: Facts) -> None:
        """Draw all panels for the car in focus."""
        self._draw_clock(surface, focus)
        self._draw_dials(surface, focus)
        if len(self._names) > 1:
            self._draw_order(surface, focus, facts)
        self._map.draw(surface, self._episodes.world.state[0], self._colours, focus)

    def tag(self, surface: pygame.Surface, car: int, at: tuple[float, float]) -> None:
        """Write a car's name above its place in the picture."""
        x, y = at
        write(surface, self._names[car], (x + 1, y - 15), 17, (0, 0, 0), "midbottom")
        write(surface, self._names[car], (x, y - 16), 17, INK, "midbottom")

    def _draw_clock(self, surface: pygame.Surface, focus: int) -> None:
        world, scenario = self._episodes.world, self._episodes.scenario
        car = world.state[0, focus]
        box = _panel(surface, (MARGIN, MARGIN), (200, 78))
        write(surface, world.track.name, (box.left + PADDING, box.top + 8), 19, FAINT, "topleft")
        write(surface, clock(float(world.time[0])), (box.left + PADDING, box.top + 25), 34, INK, "topleft")
        lap = f"lap {int(car['laps']) + 1}"
        if scenario.laps:
            lap = f"lap {min(int(car['laps']) + 1, scenario.laps)}/{scenario.laps}"
        write(surface, lap, (box.right - PADDING, box.top + 8), 19, FAINT, "topright")
        last = f"last {clock(float(car['last_lap_s']))}" if np.isfinite(car["last_lap_s"]) else ""
        write(surface, last, (box.right - PADDING, box.top + 32), 19, FAINT, "topright")
        section = world.track.section_at(float(car["progress"]))
        write(surface, section, (box.left + PADDING, box.bottom - 9), 18, FAINT, "bottomleft")

    def _draw_order(self, surface: pygame.Surface, focus: int, facts: Facts) -> None:
        order = np.argsort(facts["place"][0]).tolist()
        place = int(facts["place"][0, focus])
        places = [*range(1, min(LISTED, len(order)) + 1)]
        if place > LISTED:
            places[-1] = place
        size = (200, len(places) * ROW + 2 * PADDING - 4)
        box = _panel(surface, (surface.get_width() - size[0] - MARGIN, MARGIN), size)
        for row, place in enumerate(places):
            car = order[place - 1]
            y = box.top + PADDING - 2 + row * ROW + ROW // 2
            colour = INK if car == focus else FAINT
            write(surface, f"{place}", (box.left + 24, y), 18, colour, "midright")
            chip = pygame.Rect(box.left + 30, y - 5, 5, 10)
            pygame.draw.rect(surface, self._colours[car], chip, border_radius=2)
            write(surface, self._names[car], (box.left + 42, y), 18, colour, "midleft")
            gap = gap_text(facts, car)
            write(surface, gap, (box.right - PADDING, y), 18, colour, "midright")

    def _draw_dials(self, surface: pygame.Surface, focus: int) -> None:
        car = self._episodes.world.state[0, focus]
        box = _panel(surface, (MARGIN, surface.get_height() - 86 - MARGIN), (200, 86))
        speed = 3.6 * float(np.hypot(car["world_velocity_x"], car["world_velocity_y"]))
        write(surface, f"{speed:.0f}", (box.left + 82, box.top + 12), 46, INK, "topright")
        write(surface, "km/h", (box.left + 88, box.top + 27), 18, FAINT, "topleft")
        gear = "R" if car["gear"] < 0 else f"{int(car['gear']) + 1}"
        write(surface, gear, (box.right - PADDING, box.top + 12), 46, INK, "topright")
        full_lock = self._episodes.world.car.steering.full_lock_rad
        left, width, y = box.left + PADDING, box.width - 2 * PADDING, box.bottom - 33
        for share, colour in ((car["throttle"], THROTTLE), (car["brake"], BRAKE)):
            _bar(surface, (left, y, width, 6), 0.0, float(share), colour)
            y += 9
        # A bar from the middle; + is left.
        _bar(surface, (left, y, width, 6), 0.5, 0.5 - 0.5 * float(car["steering"]) / full_lock, STEERING)


class _Map:
    """The whole circuit in small, with a dot for each car."""

    def __init__(self, track: Track) -> None:
        line = track.table[:, [X, Y]]
        low, extent = line.min(axis=0), np.ptp(line, axis=0)
        room = np.array(MAP) - 4 * PADDING
        self._scale = float((room / extent).min())
        self._offset = (np.array(MAP) - extent * self._scale) / 2.0
        self._low, self._height = low, float(extent[1])
        # Drawn large and made small, which smooths it.
        large = pygame.Surface((4 * MAP[0], 4 * MAP[1]), pygame.SRCALPHA)
        large.fill((*TRACK_LINE, 0))
        ring = (4.0 * self._place(line)).tolist()
        pygame.draw.lines(large, TRACK_LINE, True, ring, 14)
        for x, y in ring:
            pygame.draw.circle(large, TRACK_LINE, (x, y), 7)
        self._picture = pygame.transform.smoothscale(large, MAP)
        self._start = self._place(line[0])

    def _place(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        north_down = (points - self._low) * [1.0, -1.0] + [0.0, self._height]
        return north_down * self._scale + self._offset

    def draw(
        self, surface: pygame.Surface, cars: NDArray[np.void], colours: Sequence[Colour], focus: int
    ) -> None:
        width, height = surface.get_size()
        box = _panel(surface, (width - MAP[0] - MARGIN, height - MAP[1] - MARGIN), MAP)
        surface.blit(self._picture, box)
        pygame.draw.aacircle(surface, INK, (self._start + box.topleft).tolist(), 3, 1)
        places = self._place(np.stack([cars["x"], cars["y"]], axis=1)) + box.topleft
        order = [car for car in np.flatnonzero(cars["driving"]).tolist() if car != focus]
        for car in [*order, focus]:
            dot = places[car].tolist()
            radius = 6 if car == focus else 4
            pygame.draw.aacircle(surface, INK if car == focus else PANEL[:3], dot, radius)
            pygame.draw.aacircle(surface, colours[car], dot, radius - 1)


def clock(seconds: float) -> str:
    """A time as minutes, seconds and tenths."""
    tenths = round(seconds * 10)
    return f"{tenths // 600}:{tenths // 10 % 60:02d}.{tenths % 10}"


def gap_text(facts: Mapping[str, NDArray[Any]], car: int) -> str:
    """How a car stands in the order: how it ended, or its gap to the leader."""
    ending = str(facts["ending"][0, car])
    if ending:
        return "out" if ending == "stuck" else ending.replace("_", " ")
    gap = float(facts["gap_s"][0, car])
    return f"+{gap:.1f}" if gap > 0.0 else ""


def _panel(surface: pygame.Surface, at: tuple[int, int], size: tuple[int, int]) -> pygame.Rect:
    """A translucent plate; returns its place."""
    return surface.blit(_plate(size), at)


def _bar(
    surface: pygame.Surface, place: tuple[int, int, int, int], start: float, end: float, colour: Colour
) -> None:
    """A bar filled from one share of its width to another."""
    box = pygame.Rect(place)
    pygame.draw.rect(surface, (60, 64, 68), box, border_radius=3)
    low, high = sorted((start, end))
    filled = pygame.Rect(
        box.left + round(low * box.width), box.top, round((high - low) * box.width), box.height
    )
    pygame.draw.rect(surface, colour, filled, border_radius=3)
