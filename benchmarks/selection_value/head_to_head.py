"""Two checkpoints in fresh races of each other: points, wins and contacts of one beside the other's."""

from __future__ import annotations

from typing import Any

import numpy as np
import polars as pl

from nathlon.arena.statistics import Floats, interval, spread

RESAMPLES = 2000
CONFIDENCE = 0.95


def head_to_head(results: pl.DataFrame, one: str, rng: np.random.Generator) -> dict[str, Any]:
    """How one of two does in RESULTS of mirrored pairs of them.

    Returns:
        `races`, and with 95 % intervals over pairs (`_low`, `_high`): `points`, how many more a race than the
        other; `wins`, the share of races in which its team scores more; `contacts`, how many more a kilometre
        of its cars than the other's.
    """
    own = pl.col("entrant") == one
    of_pair = (
        results.with_columns(pair=pl.col("race") // 2, km=pl.col("distance_m") / 1000)
        .group_by("match", "pair", "race")
        .agg(
            points=pl.col("points").filter(own).sum() - pl.col("points").filter(~own).sum(),
            mine=pl.col("contacts").filter(own).sum() / pl.col("km").filter(own).sum(),
            theirs=pl.col("contacts").filter(~own).sum() / pl.col("km").filter(~own).sum(),
        )
        .with_columns(wins=(pl.col("points").sign() + 1) / 2, contacts=pl.col("mine") - pl.col("theirs"))
        .group_by("match", "pair")
        .agg(pl.col("points", "wins", "contacts").mean())
        .sort("match", "pair")
    )
    figures: dict[str, Any] = {"races": 2 * of_pair.height}
    for name in ("points", "wins", "contacts"):
        values = of_pair[name].to_numpy()
        low, high = mean_interval(values, rng)
        figures |= {name: round(float(values.mean()), 3), f"{name}_low": low, f"{name}_high": high}
    return figures


def mean_interval(values: Floats, rng: np.random.Generator) -> tuple[float, float]:
    """The 95 % interval of the mean of some values."""
    known = spread(values, np.array([len(values)]), RESAMPLES, rng)
    low, high = interval(np.array([values.mean()]), np.ones((1, 1)), known, CONFIDENCE)
    return round(float(low[0]), 3), round(float(high[0]), 3)
