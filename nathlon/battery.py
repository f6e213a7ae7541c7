"""The skill battery's answer: points by test, their sum, and who goes on the shortlist."""

from __future__ import annotations

import numpy as np
import polars as pl

from arena.results import BATTERY, SKILLS
from arena.statistics import interval, spread, tied_ranks

MEASURES = pl.Schema(
    {
        "entrant": pl.String,
        "test": pl.String,
        "run": pl.Int64,  # index of the run in its test
        "measure": pl.Float64,  # in `unit`; null where the run set no mark
        "unit": pl.String,
        "points": pl.Float64,  # by the test's scoring
    }
)
"""One row for every run of an entrant in a test."""


def skills(
    measures: pl.DataFrame, rng: np.random.Generator, resamples: int = 2000, confidence: float = 0.95
) -> pl.DataFrame:
    """Turn MEASURES into SKILLS: means over runs, ordered by entrant and test.

    Intervals resample the runs of an entrant in a test; null where no test has two runs.
    """
    if measures.is_empty():
        return pl.DataFrame(schema=SKILLS)
    runs, means = _by_test(measures)
    points = means["points"].to_numpy()
    variation = spread(runs["points"].to_numpy(), means["runs"].to_numpy(), resamples, rng)
    low, high = interval(points, np.eye(len(points)), variation, confidence)
    return (
        means.with_columns(
            points_low=pl.Series(low).fill_nan(None), points_high=pl.Series(high).fill_nan(None)
        )
        .select(SKILLS.names())
        .cast(SKILLS)
    )


def rank_battery(
    measures: pl.DataFrame,
    rng: np.random.Generator,
    shortlist: int,
    resamples: int = 2000,
    confidence: float = 0.95,
) -> pl.DataFrame:
    """Turn MEASURES into BATTERY: the sum over tests of mean points, best first.

    A test in which an entrant has no run gives it no points. The `shortlist` entrants with the most
    points are shortlisted; of equal ones, those first by entrant id. Intervals resample the runs of
    each test; null where no test has two runs, and then all entrants tie.
    """
    if measures.is_empty():
        return pl.DataFrame(schema=BATTERY)
    runs, means = _by_test(measures)
    entrants = means["entrant"].unique().sort()
    member = (means["entrant"].to_numpy()[None, :] == entrants.to_numpy()[:, None]).astype(np.float64)
    points = member @ means["points"].to_numpy()
    variation = spread(runs["points"].to_numpy(), means["runs"].to_numpy(), resamples, rng)
    low, high = interval(points, member, variation, confidence)
    return (
        pl.DataFrame({"entrant": entrants, "points": points, "points_low": low, "points_high": high})
        .with_columns(rank=tied_ranks(low, high))
        .sort("points", "entrant", descending=[True, False])
        .with_columns(
            pl.col("points_low", "points_high").fill_nan(None), shortlisted=pl.int_range(pl.len()) < shortlist
        )
        .select(BATTERY.names())
        .cast(BATTERY)
    )


def _by_test(measures: pl.DataFrame) -> tuple[pl.DataFrame, pl.DataFrame]:
    """The runs in a fixed order, and their means with one row for each group of runs in that order."""
    runs = measures.sort("entrant", "test", "run")
    means = runs.group_by("entrant", "test", maintain_order=True).agg(
        pl.col("measure").mean(),
        pl.col("unit").first(),
        pl.col("points").mean(),
        runs=pl.len().cast(pl.Int64),
    )
    return runs, means
