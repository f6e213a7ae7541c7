"""What an episode of another world looked like: pictures, few and small enough to be kept and sent."""

from __future__ import annotations

import io
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from PIL import Image

from nathlon.arena.world import WorldError

RATE = 30.0
"""Pictures a second, at most."""
SIDE = 640
"""Pixels of the longer side, at most; larger pictures are made smaller."""
MOST_PICTURES = 1200
MOST_BYTES = 16 << 20
"""Of a film; of one that grows larger every other picture goes, as often as needed."""
QUALITY = 90
"""Of the JPEGs."""


@dataclass(frozen=True)
class Film:
    """Pictures of an episode.

    Attributes:
        world, scenario, match, race, seed: which episode it is.
        version: of the program.
        seats: names of the seats and of the entrants that had them.
        time_s: of each picture since the start of the episode, s; it increases.
        pictures: JPEGs of one size.
        note: how it was shortened, in a sentence; '' where it was not.
    """

    world: str
    scenario: str
    match: str
    race: int
    seed: int
    version: str
    seats: tuple[tuple[str, str], ...]
    time_s: tuple[float, ...]
    pictures: tuple[bytes, ...]
    note: str = ""


class FilmCamera:
    """Takes pictures of an episode; an `Onlooker`.

    Attributes:
        time_s, pictures: as of `Film`.
    """

    def __init__(self) -> None:
        """A camera that has not seen anything yet."""
        self.time_s: list[float] = []
        self.pictures: list[bytes] = []
        self._every_s = 1.0 / RATE
        self._bytes = 0

    def __call__(self, time_s: float, draw: Callable[[], Any], last: bool) -> None:
        """As of `nathlon.arena.world.Onlooker`.

        Raises:
            WorldError: if what is drawn is no picture.
        """
        # A millisecond less, as multiples of a step are not exact.
        if self.time_s and time_s < self.time_s[-1] + self._every_s - 1e-3 and not last:
            return
        self.time_s.append(time_s)
        self.pictures.append(_jpeg(draw()))
        self._bytes += len(self.pictures[-1])
        if len(self.pictures) > MOST_PICTURES or self._bytes > MOST_BYTES:
            self._thin_out()

    def _thin_out(self) -> None:
        kept = slice((len(self.pictures) - 1) % 2, None, 2)  # with the one that was taken last
        self.time_s, self.pictures = self.time_s[kept], self.pictures[kept]
        self._bytes = sum(map(len, self.pictures))
        between_s = (self.time_s[-1] - self.time_s[0]) / max(len(self.time_s) - 1, 1)
        self._every_s = max(2 * self._every_s, between_s)

    @property
    def note(self) -> str:
        """How the film was shortened; see `Film`."""
        if self._every_s == 1.0 / RATE:
            return ""
        return (
            f"It has a picture every {self._every_s:.2g} s, as more than {MOST_PICTURES:,} pictures or "
            f"{MOST_BYTES >> 20} MiB are not kept."
        )


def _jpeg(drawn: Any) -> bytes:
    picture = np.asarray(drawn)
    if picture.ndim != 3 or picture.shape[2] != 3 or picture.dtype != np.uint8 or not picture.size:
        raise WorldError(
            f"render gives {picture.shape} {picture.dtype}, expected a picture (height, width, 3) of uint8"
        )
    image = Image.fromarray(picture)
    image.thumbnail((SIDE, SIDE))
    file = io.BytesIO()
    image.save(file, "JPEG", quality=QUALITY, subsampling=0)
    return file.getvalue()
