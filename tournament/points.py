"""Who scores most: team points a race, fitted to the units of evidence of a tournament."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import polars as pl

from nathlon.arena.results import MATCHUPS, POLICY_FAULTS, RANKING
from nathlon.arena.rounding import levelled
from nathlon.arena.statistics import holm, possible_ranks
from nathlon.tournament.conduct import Gate, rates
from nathlon.tournament.evidence import MATCHUP, ORDER, UNIT, Cells, Evidence, appearances, differences

EQUAL: Mapping[str, float] = {}
"""Weights of tests that all count once."""

NO_GATE = Gate()


def rank(
    results: pl.DataFrame,
    rng: np.random.Generator,
    resamples: int = 2000,
    confidence: float = 0.95,
    weights: Mapping[str, float] = EQUAL,
    gate: Gate = NO_GATE,
) -> pl.DataFrame:
    """Turn the RESULTS of a tournament into RANKING, best first.

    The points are scores fitted to the units' differences of points a race, see
    `nathlon.tournament.evidence.Evidence.solution`; their mean is the mean points of a side. An entrant
    without a unit has neither points nor rank. Faults are counted in void units too.

    Intervals resample units; with few of them a plain percentile bootstrap would be far too short. They
    are of each entrant alone. Ranks compare every two entrants, corrected for their number: see `better`.
    Measured figures stand in docs/statistics.md.

    Args:
        results: RESULTS.
        rng: of the bootstrap.
        resamples: of the bootstrap.
        confidence: of the intervals, and of all comparisons together.
        weights: how often the points of a test count, 1 where a test is not named.
        gate: who is barred.
    """
    evidence = Evidence(results, weights)
    table = (
        results.group_by("entrant")
        .agg(faults=pl.col("ending").is_in(POLICY_FAULTS).sum())
        .join(_scores(evidence, rng, resamples, confidence), on="entrant", how="left")
        .join(
            evidence.seen.group_by("entrant").agg(pairs=pl.len(), races=pl.col("started").sum()),
            on="entrant",
            how="left",
        )
        .with_columns(pl.col("pairs", "races").fill_null(0))
    )
    for count in ("contacts", "at_fault"):
        table = table.join(rates(evidence.seen, count, rng, resamples, confidence), on="entrant", how="left")
    return (
        table.with_columns(barred=gate.barred)
        .sort("points_per_race", "entrant", descending=[True, False], nulls_last=True)
        .select(RANKING.names())
        .cast(RANKING)
    )


def better(evidence: Cells, alpha: float) -> np.ndarray:
    """(K, K) bool: whether the first entrant scores more than the second, beyond doubt.

    Every two entrants are compared by Student's t on the difference of their scores, and the p-values
    adjusted by Holm's method: any false difference at all among equals has probability alpha.
    """
    two = evidence.every_two()
    contrasts = evidence.solution[two[:, 0]] - evidence.solution[two[:, 1]]
    gap = evidence.estimates(contrasts)
    sure = holm(evidence.p_values(contrasts)) <= alpha
    wins = np.zeros((len(evidence.entrants),) * 2, np.bool_)
    wins[two[:, 0], two[:, 1]] = sure & (gap > 0)
    wins[two[:, 1], two[:, 0]] = sure & (gap < 0)
    return wins


def matchups(
    results: pl.DataFrame,
    rng: np.random.Generator,
    resamples: int = 2000,
    confidence: float = 0.95,
    weights: Mapping[str, float] = EQUAL,
) -> pl.DataFrame:
    """Turn the RESULTS of a tournament into MATCHUPS, seen from both sides, by entrant and opponent.

    Differences are those of the races in which both took part, units those that have such races.
    Intervals resample the units of the matchup; one of few units that are all alike borrows the spread of
    the others, and its bounds are null where there is none to borrow.
    """
    evidence = Evidence(results, weights, common=True)
    if evidence.seen.is_empty():
        return pl.DataFrame(schema=MATCHUPS)
    difference = evidence.estimates(evidence.shares)
    low, high = evidence.intervals(evidence.shares, rng, resamples, confidence)
    first, second = np.array(evidence.entrants)[evidence.matchups].T
    columns = (*MATCHUP, "difference", "difference_low", "difference_high")
    sides = [(first, second, difference, low, high), (second, first, 0.0 - difference, 0.0 - high, 0.0 - low)]
    told = pl.concat(pl.DataFrame(dict(zip(columns, side, strict=True))) for side in sides)
    return (
        _together(evidence, weights)
        .join(told, on=MATCHUP, maintain_order="left")
        .with_columns(pl.col(pl.Float64).fill_nan(None))
        .select(MATCHUPS.names())
        .cast(MATCHUPS)
    )


def pair_correlation(results: pl.DataFrame) -> float | None:
    """Correlation of the point differences before and after the mirror, within matchups.

    The more negative, the more mirroring the grid has saved. None where too few units tell.
    """
    pairs = differences(appearances(results))
    cell = ("test", *MATCHUP)
    if pairs.height - pairs.select(pl.struct(cell).n_unique()).item() < 2:
        return None
    first, second = (
        pairs.select(pl.col(race) - pl.col(race).mean().over(cell)).to_series().to_numpy()
        for race in ("first", "second")
    )
    scale = np.sqrt((first @ first) * (second @ second))
    return float(first @ second / scale) if scale > 0 else None


def _together(evidence: Evidence, weights: Mapping[str, float]) -> pl.DataFrame:
    """Units, points and contacts of every entrant in its units with every other, by entrant and opponent."""
    weight = pl.col("test").replace_strict(dict(weights), default=1.0, return_dtype=pl.Float64)
    met = evidence.met.drop_nulls("difference").select(*ORDER, *MATCHUP, "points", "points_")
    turned = {"entrant": "opponent", "opponent": "entrant", "points": "points_", "points_": "points"}
    return (
        pl.concat([met, met.rename(turned).select(met.columns)])
        .join(evidence.seen.select(*UNIT, "entrant", "contacts", "km"), on=[*UNIT, "entrant"])
        .sort(*MATCHUP, *ORDER)
        .group_by(*MATCHUP, "test", maintain_order=True)
        .agg(pl.col("points").mean(), pl.col("contacts", "km").sum(), pairs=pl.len())
        .with_columns(weight=weight)
        .group_by(MATCHUP, maintain_order=True)
        .agg(
            pl.col("pairs").sum(),
            points_per_race=(pl.col("points") * pl.col("weight")).sum() / pl.col("weight").sum(),
            contacts_per_km=pl.col("contacts").sum() / pl.col("km").sum(),
        )
    )


def _scores(evidence: Evidence, rng: np.random.Generator, resamples: int, confidence: float) -> pl.DataFrame:
    """The fitted points, their interval and the rank of every entrant that met another."""
    names = ("entrant", "points_per_race", "points_low", "points_high", "rank", "worst_rank")
    if evidence.seen.is_empty():
        return evidence.seen.select("entrant", *(pl.lit(None).alias(name) for name in names[1:]))
    mean = evidence.mean_points
    scores = evidence.estimates(evidence.solution)
    low, high = evidence.intervals(evidence.solution, rng, resamples, confidence)
    columns = (
        evidence.entrants,
        levelled(scores + mean),
        low + mean,
        high + mean,
        *possible_ranks(better(evidence, 1 - confidence)),
    )
    return pl.DataFrame(dict(zip(names, columns, strict=True))).with_columns(
        pl.col(pl.Float64).fill_nan(None)
    )
