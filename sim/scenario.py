"""Scenarios: who starts where, and when a run ends. Training and evaluation use the same ones."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import AfterValidator, BaseModel, ConfigDict, Field, model_validator

from sim.data_file import read_toml
from sim.errors import InputError
from sim.track import CURVATURE, LEFT, RIGHT, Track
from sim.world import Start

SCENARIOS = Path(__file__).parent / "data" / "scenarios"
SAFE_LATERAL = 11.0
"""m/s^2 of cornering that every car can hold: random starts are no faster than it allows."""
LOOK_AHEAD_M = 120.0


def _rising(span: tuple[float, float]) -> tuple[float, float]:
    if span[0] > span[1]:
        raise ValueError("expected the smaller number first")
    return span


Span = Annotated[tuple[float, float], AfterValidator(_rising)]


class _Section(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class GridStart(_Section):
    """A standing start from the circuit's grid, with a little disorder in the places."""

    kind: Literal["grid"]
    jitter_m: Annotated[float, Field(ge=0)] = 0.3


class RollingStart(_Section):
    """A column of cars on the move; every quantity is drawn evenly from its span."""

    kind: Literal["rolling"]
    leader_m: Span  # progress of the first car
    gap_m: Span  # from each car to the next, between centres
    lateral_m: Span
    speed_m_s: Span  # one for all cars


class AnywhereStart(_Section):
    """Anywhere on the lap, at any speed from rest to what the road ahead allows, a column of cars."""

    kind: Literal["anywhere"]
    gap_m: Span
    beside_share: Annotated[float, Field(ge=0, le=1)]  # of starts with the first car beside the road


class Scenario(_Section):
    """A scenario as its file describes it.

    Attributes:
        cars: cars in a race.
        start: how they are placed.
        laps: laps to drive; counted from the line.
        finish_m: progress at which a car has finished, m, in place of laps.
        time_s: time at which the run ends for all.
    """

    name: str
    description: str
    cars: Annotated[int, Field(ge=1, le=20)]
    start: Annotated[GridStart | RollingStart | AnywhereStart, Field(discriminator="kind")]
    laps: Annotated[int, Field(ge=1)] | None = None
    finish_m: float | None = None
    time_s: Annotated[float, Field(gt=0)]

    @model_validator(mode="after")
    def _one_end(self) -> Scenario:
        if self.laps is not None and self.finish_m is not None:
            raise ValueError("laps and finish_m exclude each other")
        return self

    def place(self, track: Track, rng: np.random.Generator) -> Start:
        """Starting places of all cars, first to last."""
        match self.start:
            case GridStart():
                start = self._grid(self.start, track, rng)
            case RollingStart():
                start = self._rolling(self.start, track, rng)
            case AnywhereStart():
                start = self._anywhere(self.start, track, rng)
        return start

    def _finish(self, track: Track) -> np.ndarray:
        if self.laps is not None:
            finish = self.laps * track.length
        else:
            finish = np.inf if self.finish_m is None else self.finish_m
        return np.full(self.cars, finish)

    def _grid(self, start: GridStart, track: Track, rng: np.random.Generator) -> Start:
        places = np.arange(self.cars)
        jitter = rng.uniform(-start.jitter_m, start.jitter_m, (2, self.cars))
        grid = track.grid
        return Start(
            distance=grid.pole_m - grid.spacing_m * places + jitter[0],
            lateral=np.where(places % 2 == 0, grid.lateral_m, -grid.lateral_m) + jitter[1],
            heading=np.zeros(self.cars),
            speed=np.zeros(self.cars),
            finish=self._finish(track),
        )

    def _rolling(self, start: RollingStart, track: Track, rng: np.random.Generator) -> Start:
        gaps = np.concatenate([[0.0], rng.uniform(*start.gap_m, self.cars - 1)])
        return Start(
            distance=rng.uniform(*start.leader_m) - np.cumsum(gaps),
            lateral=rng.uniform(*start.lateral_m, self.cars),
            heading=np.zeros(self.cars),
            speed=np.full(self.cars, rng.uniform(*start.speed_m_s)),
            finish=self._finish(track),
        )

    def _anywhere(self, start: AnywhereStart, track: Track, rng: np.random.Generator) -> Start:
        gaps = np.concatenate([[0.0], rng.uniform(*start.gap_m, self.cars - 1)])
        distance = rng.uniform(0.0, track.length) - np.cumsum(gaps)
        row = (np.mod(distance, track.length) / track.spacing).astype(np.int64) % len(track.table)
        window = np.arange(round(LOOK_AHEAD_M / track.spacing))
        bend = np.abs(track.table[(row[:, None] + window) % len(track.table), CURVATURE]).max(axis=1)
        fastest = min(55.0, np.sqrt(SAFE_LATERAL / bend.max()))
        edge = np.stack([-track.table[row, RIGHT], track.table[row, LEFT]])
        lateral = rng.uniform(edge[0] + 1.2, edge[1] - 1.2)
        speed = np.full(self.cars, rng.uniform(0.0, fastest))
        heading = rng.normal(0.0, 0.04, self.cars)
        if rng.uniform() < start.beside_share:
            lateral[0] = rng.choice(edge[:, 0] + np.array([-4.0, 4.0]))
            heading[0] = rng.uniform(-0.8, 0.8)
            speed[0] = rng.uniform(0.0, 12.0)
        return Start(distance, lateral, heading, speed, self._finish(track))


def read_scenario(path: Path) -> Scenario:
    """Read and check a scenario file.

    Raises:
        InputError: if the file cannot be read, or a field is missing, unknown or out of range.
    """
    return read_toml(path, Scenario, "scenario file")


@lru_cache
def load_scenario(name: str) -> Scenario:
    """A scenario by its shipped name, or by the path of a `.toml` file.

    Raises:
        InputError: if there is no such scenario or its file is wrong.
    """
    path = Path(name) if name.endswith(".toml") else SCENARIOS / f"{name}.toml"
    if path.parent == SCENARIOS and not path.is_file():
        known = ", ".join(sorted(p.stem for p in SCENARIOS.glob("*.toml")))
        raise InputError(
            f"scenario {name!r} is unknown; expected one of {known}, or the path of a .toml file"
        )
    return read_scenario(path)
