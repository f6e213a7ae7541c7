"""The Pareto filter: the checkpoints that may be the best trade of speed, discipline and care."""

from __future__ import annotations

import moocore
import numpy as np
import polars as pl
from numpy.typing import NDArray

from arena.results import PARETO, POLICY_FAULTS, VOID_ENDINGS
from arena.statistics import Floats, group_sums, resample_counts


def pareto(
    results: pl.DataFrame, rng: np.random.Generator, resamples: int = 500, keep_probability: float = 0.05
) -> pl.DataFrame:
    """Turn the RESULTS of the filter's races into PARETO, ordered by entrant.

    Three objectives, all to be small: mean best lap, share of the time spent off course, contacts a
    kilometre. An entrant survives if the bootstrap over its races leaves it non-dominated with at
    least `keep_probability`: the front of the observed values alone would drop every good
    checkpoint that had bad luck. With one race an entrant there is nothing to resample, and the
    filter is that plain front. Equal objectives do not dominate each other.

    A race without a lap, or ended by the policy's fault, counts as the slowest best lap of the field.
    An entrant without any lap neither survives nor dominates. A race with a simulator fault is void.
    """
    races = _races(results)
    sizes = races["entrant"].rle().struct.field("len").cast(pl.Int64).to_numpy()
    lapped = group_sums(races["lap_s"].is_not_null().to_numpy(), sizes) > 0
    races = races.with_columns(pl.col("lap_s").fill_null(pl.col("lap_s").max()))

    probability = np.zeros(len(sizes))
    if lapped.any():
        contenders = races.filter(pl.Series(np.repeat(lapped, sizes)))
        counts = resample_counts(sizes[lapped], resamples, rng)
        probability[lapped] = _nondominated(_objectives(contenders, counts, sizes[lapped])).mean(axis=0)

    lap_s, off_course_share, contacts_per_km = _objectives(races, np.ones(races.height), sizes).T
    measured = pl.DataFrame(
        {
            "entrant": races["entrant"].unique(maintain_order=True),
            "lap_s": np.where(lapped, lap_s, np.inf),
            "off_course_share": off_course_share,
            "contacts_per_km": contacts_per_km,
            "nondominated_probability": probability,
            "races": sizes,
        }
    ).with_columns(pl.col(pl.Float64).replace(np.inf, None))
    return (
        results.select(pl.col("entrant").unique().sort())
        .join(measured, on="entrant", how="left", maintain_order="left")
        .with_columns(pl.col("nondominated_probability", "races").fill_null(0))
        .with_columns(survives=pl.col("nondominated_probability") >= keep_probability)
        .select(PARETO.names())
        .cast(PARETO)
    )


def _races(results: pl.DataFrame) -> pl.DataFrame:
    """One row for each entrant in each race that is not void: its cars together, ordered."""
    void = pl.col("ending").is_in(VOID_ENDINGS).any().over("match", "race")
    lap_counts = ~pl.col("ending").is_in(POLICY_FAULTS)
    return (
        results.sort("entrant", "match", "race", "car")
        .filter(~void)
        .group_by("entrant", "match", "race", maintain_order=True)
        .agg(
            pl.col("best_lap_s").filter(lap_counts).mean().alias("lap_s"),
            pl.col("off_course_s", "driven_s", "contacts", "distance_m").sum(),
        )
    )


def _objectives(races: pl.DataFrame, counts: NDArray, sizes: NDArray) -> Floats:
    """The objectives of E entrants from races drawn `counts` (..., rows) times, as (..., E, 3)."""

    def total(column: str) -> Floats:
        return group_sums(counts * races[column].to_numpy(), sizes)

    return np.stack(
        [
            total("lap_s") / sizes,
            _rate(total("off_course_s"), total("driven_s")),
            _rate(total("contacts"), total("distance_m") / 1000),
        ],
        axis=-1,
    )


def _rate(events: Floats, exposure: Floats) -> Floats:
    """Infinite, the worst, where nothing was driven."""
    return np.divide(events, exposure, out=np.full_like(exposure, np.inf), where=exposure > 0)


def _nondominated(objectives: Floats) -> NDArray[np.bool_]:
    """Which of E points no other dominates, in each of the resamples: (resamples, E, 3) -> (resamples, E)."""
    return np.stack([moocore.is_nondominated(points, keep_weakly=True) for points in objectives])
