"""The skill battery's answer: points by test, and their sum."""

from __future__ import annotations

import numpy as np
import polars as pl
from numpy.typing import NDArray

from nathlon.arena.results import BATTERY, SKILLS
from nathlon.arena.rounding import levelled
from nathlon.arena.statistics import (
    Floats,
    Precision,
    holm,
    interval,
    p_values,
    possible_ranks,
    spread,
    standard_error,
)

MARKS = pl.Schema(
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
    marks: pl.DataFrame, rng: np.random.Generator, resamples: int = 2000, confidence: float = 0.95
) -> pl.DataFrame:
    """Turn MARKS into SKILLS: means over runs, ordered by entrant and test.

    Intervals resample the runs of an entrant in a test; null where no test has two runs.
    """
    if marks.is_empty():
        return pl.DataFrame(schema=SKILLS)
    runs, means = _by_test(marks)
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
    marks: pl.DataFrame,
    rng: np.random.Generator,
    resamples: int = 2000,
    confidence: float = 0.95,
) -> pl.DataFrame:
    """Turn MARKS into BATTERY: the sum over tests of mean points, best first.

    A test in which an entrant has no run gives it no points; nobody is shortlisted yet. Intervals resample
    the runs of each test; null where no test has two runs, and then all entrants tie. They are of each
    entrant alone: ranks compare every two by Student's t, corrected for their number by Holm's method.
    """
    if marks.is_empty():
        return pl.DataFrame(schema=BATTERY)
    runs, means = _by_test(marks)
    entrants = means["entrant"].unique().sort()
    member = (means["entrant"].to_numpy()[None, :] == entrants.to_numpy()[:, None]).astype(np.float64)
    points = levelled(member @ means["points"].to_numpy())
    variation = spread(runs["points"].to_numpy(), means["runs"].to_numpy(), resamples, rng)
    low, high = interval(points, member, variation, confidence)
    best, worst = possible_ranks(_better(points, member, variation, 1 - confidence))
    return (
        pl.DataFrame({"entrant": entrants, "points": points, "points_low": low, "points_high": high})
        .with_columns(rank=best, worst_rank=worst)
        .sort("points", "entrant", descending=[True, False])
        .with_columns(pl.col("points_low", "points_high").fill_nan(None), shortlisted=pl.lit(False))
        .select(BATTERY.names())
        .cast(BATTERY)
    )


def _better(points: Floats, member: Floats, means: Precision, alpha: float) -> NDArray[np.bool_]:
    """(K, K): whether the first entrant has more points than the second, beyond doubt.

    `member` (K, M) says whose tests the M means are. Any false difference at all among equals has
    probability `alpha`.
    """
    first, second = np.triu_indices(len(points), 1)
    error, freedom = standard_error(member, means)
    # No mean belongs to two entrants: their variances, and Welch and Satterthwaite's terms, add up.
    variance = error[first] ** 2 + error[second] ** 2
    terms = error**4 / freedom
    joint = terms[first] + terms[second]
    freedom = np.divide(variance**2, joint, out=np.ones_like(joint), where=joint != 0)
    gap = points[first] - points[second]
    sure = holm(p_values(gap, np.sqrt(variance), freedom)) <= alpha
    better = np.zeros(2 * points.shape, np.bool_)
    better[first, second] = sure & (gap > 0)
    better[second, first] = sure & (gap < 0)
    return better


def _by_test(marks: pl.DataFrame) -> tuple[pl.DataFrame, pl.DataFrame]:
    """The runs in a fixed order, and their means with one row for each group of runs in that order."""
    runs = marks.sort("entrant", "test", "run")
    means = runs.group_by("entrant", "test", maintain_order=True).agg(
        pl.col("measure").mean(),
        pl.col("unit").first(),
        pl.col("points").mean(),
        runs=pl.len().cast(pl.Int64),
    )
    return runs, means
