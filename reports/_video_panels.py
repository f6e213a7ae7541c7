"""What stands over the pictures of a video: time, the order, the followed car, the stewards and the map."""

from __future__ import annotations

import re
from collections.abc import Sequence
from itertools import takewhile

import numpy as np
import pygame
from numpy.typing import NDArray

from nathlon.arena.race_log import NOTICES, Outline, RaceLog, numbered
from nathlon.reports._motion import gaps
from nathlon.reports.cars import car_colours
from nathlon.sim.render.panels import clock, write

INK, FAINT, PLATE, GROOVE = (240, 241, 238), (168, 174, 178), (18, 21, 24, 205), (60, 64, 68)
PEDALS = {"throttle": (96, 200, 110), "brake": (232, 74, 66)}
ROAD, ZONE = (150, 156, 162), (242, 177, 52)
MARGIN, PADDING, ROW, LEFT, RIGHT, MAP = 14, 10, 22, 210, 270, (230, 180)
"""Pixels: around panels and in them, a line, panels on the left, the order, the map."""
NEWS_S, NEWS_LENGTH, NAME_LENGTH = 4.0, 105, 18
"""How long news are shown, and letters for which there is room."""


def brief(names: Sequence[str]) -> list[str]:
    """Start number and name of each car, without the words with which all names begin, cut to NAME_LENGTH."""
    words = [re.split("(?<=[-_:/= ])", name) for name in names]
    columns = zip(*(parts[:-1] for parts in words), strict=False) if len(set(names)) > 1 else ()
    same = len(list(takewhile(lambda column: len(set(column)) == 1, columns)))
    return numbered(_cut("".join(parts[same:])) for parts in words)


def _cut(name: str) -> str:
    """A name without its middle, where it is long: names differ at their ends."""
    half = NAME_LENGTH // 2
    return name if len(name) <= NAME_LENGTH else f"{name[: half - 1]}…{name[-half:]}"


class VideoPanels:
    """All panels of a race's video."""

    def __init__(self, log: RaceLog, followed: int, size: tuple[int, int]) -> None:
        self._log, self._followed = log, followed
        self._width, self._height = size
        self._names, self._colours = brief(log.names), car_colours(log)
        self._gap_s = gaps(log)
        self._news = [incident for incident in log.incidents if incident.kind not in NOTICES]
        endings = [incident for incident in log.incidents if incident.kind == "ending"]
        self._endings = {one.cars[0]: one.text.rpartition(": ")[2].partition(" after")[0] for one in endings}
        self._map = _VideoMap(log.outline)

    def draw(self, picture: pygame.Surface, tick: int, now: float, at: NDArray[np.float64]) -> None:
        """Draw all panels over a picture; `at` is where the cars are, (C, 2)."""
        self._draw_time(picture, tick, now)
        self._draw_order(picture, tick)
        self._draw_followed(picture, tick)
        self._draw_news(picture, now)
        corner = (self._width - MARGIN - MAP[0], self._height - MARGIN - MAP[1])
        self._map.draw(picture, corner, at, self._colours, self._followed)

    def _draw_time(self, picture: pygame.Surface, tick: int, now: float) -> None:
        box = _plate(picture, (MARGIN, MARGIN), (LEFT, 64))
        lap = f"lap {self._log.samples['lap'][tick, self._followed] + 1}"
        write(picture, self._log.circuit, (box.left + PADDING, box.top + 8), 20, FAINT, "topleft")
        write(picture, lap, (box.right - PADDING, box.top + 8), 20, FAINT, "topright")
        write(picture, clock(now), (box.left + PADDING, box.top + 27), 38, INK, "topleft")

    def _draw_order(self, picture: pygame.Surface, tick: int) -> None:
        cars = self._log.samples[tick]
        box = _plate(picture, (self._width - MARGIN - RIGHT, MARGIN), (RIGHT, ROW * len(cars) + 12))
        for row, car in enumerate(np.argsort(cars["place"], kind="stable").tolist()):
            y = box.top + 6 + row * ROW + ROW // 2
            colour = INK if car == self._followed else FAINT
            write(picture, f"{cars['place'][car]}", (box.left + 24, y), 20, colour, "midright")
            pygame.draw.rect(picture, self._colours[car], (box.left + 31, y - 6, 6, 12))
            write(picture, self._names[car], (box.left + 44, y), 20, colour, "midleft")
            write(picture, self._standing(tick, car), (box.right - PADDING, y), 20, colour, "midright")
            if cars["penalty_s"][car] > 0.0:
                penalty = f"{cars['penalty_s'][car]:.0f} s"
                write(picture, penalty, (box.right - PADDING - 50, y), 20, ZONE, "midright")

    def _standing(self, tick: int, car: int) -> str:
        """How a car ended, or its gap to the first, in seconds."""
        if not self._log.samples["driving"][tick, car]:
            return self._endings.get(car) or "out"
        gap_s = self._gap_s[tick, car]
        return f"+{gap_s:.1f}" if gap_s > 0.0 else ""

    def _draw_followed(self, picture: pygame.Surface, tick: int) -> None:
        car = self._log.samples[tick, self._followed]
        box = _plate(picture, (MARGIN, self._height - MARGIN - 96), (LEFT, 96))
        left, right = box.left + PADDING, box.right - PADDING
        speed = 3.6 * float(np.hypot(car["velocity_x_m_s"], car["velocity_y_m_s"]))
        write(picture, self._names[self._followed], (left, box.top + 8), 20, FAINT, "topleft")
        write(picture, f"{speed:.0f} km/h", (left, box.top + 30), 38, INK, "topleft")
        write(picture, f"{car['gear'] or 'R'}", (right, box.top + 30), 38, INK, "topright")
        for row, (name, colour) in enumerate(PEDALS.items()):
            groove = pygame.Rect(left, box.bottom - 28 + 10 * row, right - left, 6)
            pygame.draw.rect(picture, GROOVE, groove)
            pygame.draw.rect(picture, colour, (*groove.topleft, round(groove.width * float(car[name])), 6))

    def draw_sight(self, picture: pygame.Surface, seen: NDArray[np.uint8], proportion: float) -> None:
        """Draw what the followed car's camera shows, (h, w, 3), so much wider than high, above its speed."""
        width, height = LEFT - 2 * PADDING, round((LEFT - 2 * PADDING) / proportion)
        size = (LEFT, height + 2 * PADDING + ROW)
        box = _plate(picture, (MARGIN, self._height - 2 * MARGIN - 96 - size[1]), size)
        write(picture, "what it sees", (box.left + PADDING, box.top + 8), 20, FAINT, "topleft")
        small = pygame.surfarray.make_surface(seen.swapaxes(0, 1))
        picture.blit(
            pygame.transform.scale(small, (width, height)), (box.left + PADDING, box.top + PADDING + ROW)
        )

    def _draw_news(self, picture: pygame.Surface, now: float) -> None:
        left = 2 * MARGIN + LEFT
        fresh = [one.text for one in self._news if 0.0 <= now - one.time_s < NEWS_S]
        for row, text in enumerate(reversed(fresh[-3:])):
            y = self._height - MARGIN - 26 - 30 * row
            box = _plate(picture, (left, y), (self._width - 2 * MARGIN - MAP[0] - left, 26))
            write(picture, text[:NEWS_LENGTH], (box.left + PADDING, box.centery), 21, INK, "midleft")


class _VideoMap:
    """The whole circuit in small, with a dot for each car."""

    def __init__(self, outline: Outline) -> None:
        line = outline.centre[:, :2]
        self._middle = (line.min(axis=0) + line.max(axis=0)) / 2
        self._scale = float(((np.array(MAP) - 4 * PADDING) / np.ptp(line, axis=0)).min())
        # Drawn large and made small, which smooths it.
        large = pygame.Surface((4 * MAP[0], 4 * MAP[1]), pygame.SRCALPHA)
        large.fill((*ROAD, 0))
        pixels, ends = 4 * self._pixels(line), 4 * self._pixels(np.roll(line, -1, axis=0))
        for a, b, zone in zip(pixels.tolist(), ends.tolist(), outline.zone.tolist(), strict=True):
            pygame.draw.line(large, ZONE if zone else ROAD, a, b, 12)
            pygame.draw.circle(large, ZONE if zone else ROAD, b, 6)
        self._picture = pygame.transform.smoothscale(large, MAP)

    def _pixels(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        return (points - self._middle) * [self._scale, -self._scale] + np.array(MAP) / 2

    def draw(
        self,
        picture: pygame.Surface,
        corner: tuple[int, int],
        at: NDArray[np.float64],
        colours: Sequence[tuple[int, int, int]],
        followed: int,
    ) -> None:
        """Draw it with its top left at `corner`, the followed car above the others."""
        picture.blit(self._picture, _plate(picture, corner, MAP))
        places = self._pixels(at) + corner
        for car in [*(car for car in range(len(at)) if car != followed), followed]:
            radius = 6 if car == followed else 4
            pygame.draw.aacircle(picture, INK if car == followed else PLATE[:3], places[car].tolist(), radius)
            pygame.draw.aacircle(picture, colours[car], places[car].tolist(), radius - 1)


def _plate(picture: pygame.Surface, at: tuple[int, int], size: tuple[int, int]) -> pygame.Rect:
    """A translucent plate; returns its place."""
    plate = pygame.Surface(size, pygame.SRCALPHA)
    plate.fill(PLATE)
    return picture.blit(plate, at)
