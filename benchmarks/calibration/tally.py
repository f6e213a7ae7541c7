"""What verdicts on entrants whose truth is known got right."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import polars as pl
from scipy.stats import binomtest

CONFIDENCE = 0.95


def tally(rankings: Sequence[pl.DataFrame]) -> dict[str, Any]:
    """How often intervals and ranks held.

    Args:
        rankings: of every run `entrant`, `rank`, `low` and `high`, the interval of its points, and `truth`.

    Returns:
        `coverage`, the share of intervals that hold the truth; `false_accept`, the share of runs that give
        any entrant a worse rank than it truly has, with its 95 % interval `false_accept_low` to
        `false_accept_high` (Wilson); `best_kept`, the share of runs in which the truly best share the first
        rank; and `runs`.
    """
    shown = pl.concat([ranking.with_columns(run=number) for number, ranking in enumerate(rankings)])
    told = shown.with_columns(
        true_rank=pl.col("truth").rank("min", descending=True).over("run"),
        covered=pl.col("truth").is_between("low", "high"),
    )
    runs = told.group_by("run").agg(
        false=(pl.col("rank") > pl.col("true_rank")).any(),
        kept=((pl.col("true_rank") > 1) | (pl.col("rank") == 1)).all(),
    )
    false = int(runs["false"].sum())
    bounds = binomtest(false, len(runs)).proportion_ci(CONFIDENCE, "wilson")
    return {
        "coverage": round(float(told["covered"].to_numpy().mean()), 4),
        "false_accept": round(false / len(runs), 4),
        "false_accept_low": round(float(bounds.low), 4),
        "false_accept_high": round(float(bounds.high), 4),
        "best_kept": round(float(runs["kept"].to_numpy().mean()), 4),
        "runs": len(runs),
    }
