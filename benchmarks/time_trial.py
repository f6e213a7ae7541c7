"""Time trials: laps alone from a few starts, and the fastest lap to hold them against."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
import polars as pl
from numpy.typing import NDArray

from benchmarks.result import RESULTS, read_result
from nathlon.arena.entrant import Entrant
from nathlon.arena.match import Match, Race, Seat
from nathlon.arena.match_policies import match_policies
from nathlon.arena.runner import run_match

SCENARIO = "time_trial"
"""One lap that begins soon after the start, as checkpoints are compared in training and the filter."""
FLYING = str(Path(__file__).with_name("flying_lap.toml"))
"""Two laps. The fastest lap by optimal control passes the line at the speed at which it began; the first lap
after a rolling start does not.
"""
STARTS = 8
SEED = 2024
LIMITS = RESULTS / "lap_limit.json"
"""What `benchmarks.lap_limit` wrote."""


@dataclass(frozen=True)
class TimeTrial:
    """Laps alone.

    Attributes:
        laps_s: (starts,) the best of each, inf where none was completed.
        off_course_share: of the time driven.
        clean: starts from which a lap was completed without ever leaving the course.
    """

    laps_s: NDArray[np.float64]
    off_course_share: float
    clean: int

    @property
    def lap_s(self) -> float:
        """Median lap; inf where half of the starts or more gave none."""
        return float(np.median(self.laps_s))

    @property
    def best_s(self) -> float:
        """Fastest lap; inf where there is none."""
        return float(self.laps_s.min())


def time_trial(rows: pl.DataFrame) -> TimeTrial:
    """The time trial that some RESULTS tell of, one row a start."""
    laps = rows["best_lap_s"].fill_null(math.inf).to_numpy()
    clean = np.isfinite(laps) & (rows["off_course_s"] == 0.0).to_numpy()
    off_course_share = float(rows["off_course_s"].sum()) / float(rows["driven_s"].sum())
    return TimeTrial(laps, off_course_share, int(clean.sum()))


def drive_alone(entrant: Entrant, scenario: str = SCENARIO, starts: int = STARTS) -> TimeTrial:
    """Let an entrant drive a scenario for one car; the starts are the same for everybody."""
    races = tuple(Race(SEED + start, (Seat(0),)) for start in range(starts))
    circuit, car = entrant.circuit, entrant.car
    match = Match("time_trial", SCENARIO, scenario, circuit, car, (entrant.id,), (entrant.source,), races)
    return time_trial(run_match(match, match_policies(match)))


@cache
def limits() -> dict[tuple[str, str], float]:
    """The fastest laps by optimal control, s, by circuit and car, as far as they are known."""
    laps = read_result(LIMITS).figures["laps"]
    return {(lap["circuit"], lap["car"]): lap["limit_s"] for lap in laps if lap["solved"]}
