"""What entrants came to in the races that they took part in: their mean points, and how many they won.

The points of a ranking are fitted to differences: against whom one raced is allowed for, and they can lie
outside of what a race gives. These are what they say. A race that an entrant sat out does not count.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import polars as pl

from nathlon.arena.results import POLICY_FAULTS, RECORDS
from nathlon.arena.rounding import differing, levelled
from nathlon.arena.statistics import interval, spread
from nathlon.tournament.evidence import ENOUGH, ORDER, UNIT, in_units

RACE = (*UNIT, "race")


def records(
    results: pl.DataFrame,
    rng: np.random.Generator,
    resamples: int = 2000,
    confidence: float = 0.95,
    weights: Mapping[str, float] = {},
) -> pl.DataFrame:
    """Turn the RESULTS of a tournament into RECORDS, by entrant.

    Args:
        results: RESULTS.
        rng: of the bootstrap.
        resamples: of the bootstrap.
        confidence: of the intervals, each of one entrant.
        weights: how often the points of a test count, 1 where a test is not named.
    """
    raced = _raced(in_units(results))
    if raced.is_empty():
        return pl.DataFrame(schema=RECORDS)
    shares = raced.group_by("entrant").agg(pl.col("won", "drawn", "lost").mean())
    units = (
        raced.group_by("entrant", *UNIT)
        .agg(pl.col("points").sum(), pl.col("seed").first(), races=pl.len())
        .sort("entrant", *(name for name in ORDER if name != "field"))
    )
    cells = units.group_by("entrant", "test", maintain_order=True).agg(
        pl.col("points", "races").sum(), units=pl.len().cast(pl.Int64)
    )
    sizes, starts = cells["units"].to_numpy(), cells["races"].to_numpy().astype(np.float64)
    mean = cells["points"].to_numpy() / starts
    excess = units["points"].to_numpy() - np.repeat(mean, sizes) * units["races"].to_numpy()
    entrants = cells["entrant"].unique().sort()
    own = cells["entrant"].to_numpy()[None, :] == entrants.to_numpy()[:, None]
    weight = own * np.array([weights.get(test, 1.0) for test in cells["test"]])
    weight /= weight.sum(axis=1, keepdims=True)
    known = spread(excess, sizes, resamples, rng, ENOUGH)
    estimate = weight @ mean
    low, high = interval(estimate, weight * (sizes / starts), known, confidence)
    told = pl.DataFrame({"entrant": entrants, "mean": levelled(estimate), "mean_low": low, "mean_high": high})
    return (
        told.join(shares, on="entrant", maintain_order="left")
        .with_columns(pl.col(pl.Float64).fill_nan(None))
        .select(RECORDS.names())
        .cast(RECORDS)
    )


def _raced(units: pl.DataFrame) -> pl.DataFrame:
    """Every entrant of every race with its points, and whether it won, drew or lost.

    They are those of its team, or in a free-for-all the mean of its cars.
    """
    points = pl.col("points")
    raced = units.group_by(*RACE, "entrant", maintain_order=True).agg(
        pl.when(pl.col("team").first() >= 0).then(points.sum()).otherwise(points.mean()),
        pl.col("seed").first(),
        faulty=pl.col("ending").is_in(POLICY_FAULTS).any(),
    )
    best = raced.select(pl.col("points").max().over(RACE)).to_series().to_numpy()
    behind = differing(best - raced["points"].to_numpy(), np.abs(best))
    # Who has failed has no more points than the last, and is behind whom it shares them with.
    first = pl.col("level") & ~(pl.col("faulty") & (pl.col("level") & ~pl.col("faulty")).any().over(RACE))
    among = first.sum().over(RACE)
    return raced.with_columns(level=behind == 0).with_columns(
        won=first & (among == 1), drawn=first & (among > 1), lost=~first
    )
