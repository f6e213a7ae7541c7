"""Weather: what may fall in a race, the water on the road, and the grip that tyres have there."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from nathlon.sim.data_file import Section

DRAINAGE_S = 300.0
"""In this time all but 1/e of the water has drained away."""
EVAPORATION_MM_H = 0.3
SPRAY_MM_H = 0.6
"""What cars throw off the road, for each car on a kilometre."""
AQUAPLANING = 0.45
"""Share of its grip that any tyre is left with in deep water."""

PARTS = 10
"""Of a lap, for each of which it is said how much water lies on the road."""

Rain = Annotated[float, Field(ge=0, le=200)]
"""mm/h; 2 is light, 10 heavy rain."""
Film = Annotated[float, Field(ge=0, le=20)]
"""mm of water."""


class Shower(Section):
    """Rain from a moment on.

    Attributes:
        time_s: when it begins, s since the start; 0 by default.
        lap: instead of the time: when the leader begins this lap, 1 being the first.
        rain_mm_h: how hard it rains; 0 ends a shower.
    """

    time_s: Annotated[float, Field(ge=0, le=1e6)] | None = None
    lap: Annotated[int, Field(ge=1, le=1_000_000)] | None = None
    rain_mm_h: Rain

    @model_validator(mode="after")
    def _one_moment(self) -> Shower:
        if (self.time_s is None) == (self.lap is None):
            raise ValueError("expected either time_s or lap")
        return self

    def has_begun(self, time_s: float, lap: int) -> bool:
        """Whether it has begun at a time, with the leader in a lap."""
        return time_s >= self.time_s if self.time_s is not None else lap >= (self.lap or 0)


class Weather(Section):
    """What may come: showers, one after the other, and how probable they are beside the others.

    Attributes:
        chance: weight against that of the others.
        shower: in their order; the last that has begun is the rain.
    """

    chance: Annotated[float, Field(gt=0, le=1e6)] = 1.0
    shower: tuple[Shower, ...] = ()

    def rain_mm_h(self, time_s: float, lap: int) -> float:
        """How hard it rains at a time, with the leader in a lap."""
        begun = self._begun(time_s, lap)
        return begun[-1].rain_mm_h if begun else 0.0

    def with_share(self, share: float) -> Weather:
        """The same with a share of its rain."""
        showers = [one.model_copy(update={"rain_mm_h": share * one.rain_mm_h}) for one in self.shower]
        return self.model_copy(update={"shower": tuple(showers)})

    def agrees(self, other: Weather, time_s: float, lap: int) -> bool:
        """Whether the showers that have begun by a time are those of another weather."""
        return self._begun(time_s, lap) == other._begun(time_s, lap)

    def _begun(self, time_s: float, lap: int) -> list[Shower]:
        return [shower for shower in self.shower if shower.has_begun(time_s, lap)]


def draw(weather: tuple[Weather, ...], rng: np.random.Generator) -> int:
    """Which of several comes true; nothing is drawn where there is no choice."""
    if len(weather) < 2:
        return 0
    chances = np.array([one.chance for one in weather])
    return int(rng.choice(len(weather), p=chances / chances.sum()))


def film_after(film_mm: float, rain_mm_h: float, cars_per_km: float, time_s: float) -> float:
    """The water on the road after some time, mm.

    What falls less what dries is df/dt = (rain - drying) / 3600 - film / DRAINAGE_S, solved exactly.

    Args:
        film_mm: before.
        rain_mm_h, cars_per_km: meanwhile.
        time_s: how long.
    """
    drying = EVAPORATION_MM_H + SPRAY_MM_H * cars_per_km
    end = DRAINAGE_S * (rain_mm_h - drying) / 3600.0
    return max(end + (film_mm - end) * math.exp(-time_s / DRAINAGE_S), 0.0)


def films_ahead(
    weather: Weather,
    film_mm: float,
    cars_per_km: float,
    time_s: float,
    lap: int,
    laps: int,
    lap_s: Callable[[float], float],
) -> NDArray[np.float64]:
    """The water on the road in the coming laps, (laps, PARTS) mm, at the beginning of each part.

    Args:
        weather: that comes.
        film_mm, cars_per_km: of now; as many cars go on.
        time_s: since the start.
        lap: that the leader is in, 1 being the first; it begins its laps when they are begun here.
        laps: how many.
        lap_s: what a lap takes in some water.
    """
    films = np.empty((laps, PARTS))
    for coming in range(laps):
        for part in range(PARTS):
            films[coming, part] = film_mm
            lasts_s = lap_s(film_mm) / PARTS
            rain = weather.rain_mm_h(time_s, lap + coming)
            film_mm, time_s = film_after(film_mm, rain, cars_per_km, lasts_s), time_s + lasts_s
    return films


def wet_share(
    film_mm: NDArray[np.float64] | float, tyre_film: NDArray[np.float64] | float
) -> NDArray[np.float64]:
    """Share of their grip that tyres have in water.

    Args:
        film_mm: depth of the water.
        tyre_film: what the tyres displace, mm: where all but 1/e of what they can lose is lost.
    """
    return AQUAPLANING + (1.0 - AQUAPLANING) * np.exp(-film_mm / np.asarray(tyre_film))
