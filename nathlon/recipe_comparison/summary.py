"""From the scores of checkpoints to what is said of their recipes."""

from __future__ import annotations

import numpy as np
import polars as pl

from nathlon.arena.statistics import Floats
from nathlon.recipe_comparison.statistics import (
    Estimate,
    estimate,
    interquartile_mean,
    mean,
    optimality_gap,
    probability_of_improvement,
    shrunk,
)
from nathlon.reports.recipes import CONFIDENCE, RECIPES

RESAMPLES = 5000


def summarise(scores: pl.DataFrame, rng: np.random.Generator) -> pl.DataFrame:
    """RECIPES of SCORES, in their order; the first recipe is the one to be better than.

    All intervals of `better` hold together with `CONFIDENCE` (Bonferroni).
    """
    names = scores["recipe"].unique(maintain_order=True).to_list()
    of_each = 1 - (1 - CONFIDENCE) / max(len(names) - 1, 1)
    last = last_checkpoints(scores)
    points = {name: _matrix(last.filter(recipe=name), pl.col("points")) for name in names}
    rows = []
    for name in names:
        own = scores.filter(recipe=name)
        at_fault = _matrix(last.filter(recipe=name), pl.col("at_fault") / pl.col("km"))
        figures = {
            "points": estimate(points[name], mean, rng, RESAMPLES, CONFIDENCE),
            "iqm": estimate(points[name], interquartile_mean, rng, RESAMPLES, CONFIDENCE),
            "gap": estimate(points[name], optimality_gap(0.0), rng, RESAMPLES, CONFIDENCE),
            "better": _better(points[name], points[names[0]], name == names[0], rng, of_each),
            "at_fault_per_km": estimate(at_fault, mean, rng, RESAMPLES, CONFIDENCE),
        }
        rows.append(
            {
                "recipe": name,
                "runs": own["run"].n_unique(),
                "checkpoints": own["entrant"].n_unique(),
                **{
                    f"{figure}{bound}": value
                    for figure, told in figures.items()
                    for bound, value in zip(("", "_low", "_high"), told, strict=True)
                },
                **_best(own),
            }
        )
    return pl.DataFrame(rows, schema=RECIPES).with_columns(pl.col(pl.Float64).fill_nan(None))


def last_checkpoints(scores: pl.DataFrame) -> pl.DataFrame:
    """The rows of SCORES of the checkpoints that each run ended with."""
    ends = scores.group_by("recipe", "run", maintain_order=True).agg(pl.col("entrant").last())
    return scores.join(ends, on=["recipe", "run", "entrant"], how="semi", maintain_order="left")


def _matrix(rows: pl.DataFrame, figure: pl.Expr) -> Floats:
    """(runs, tasks) of a figure; runs that lack one of them are left out."""
    table = rows.select("run", "task", figure=figure).pivot("task", index="run", maintain_order=True)
    return table.drop("run").drop_nulls().to_numpy().astype(np.float64)


def _better(
    scores: Floats, base: Floats, itself: bool, rng: np.random.Generator, confidence: float
) -> Estimate:
    if itself:
        return Estimate(np.nan, np.nan, np.nan)
    return probability_of_improvement(scores, base, rng, RESAMPLES, confidence)


def _best(own: pl.DataFrame) -> dict[str, str | float]:
    """The checkpoint with most points over all tasks, and what it may be expected to score again."""
    tasks = own["task"].n_unique()
    each = (
        own.drop_nulls("points")
        .group_by("entrant", maintain_order=True)
        .agg(
            pl.col("name").first(),
            pl.col("points").mean(),
            error=(pl.col("error").fill_null(0.0) ** 2).sum().sqrt() / tasks,
        )
    )
    values = each["points"].to_numpy()
    expected = shrunk(values, each["error"].to_numpy())
    best = int(np.argmax(values))
    return {
        "best": each["name"][best],
        "best_points": float(values[best]),
        "best_expected": float(expected[best]),
    }
