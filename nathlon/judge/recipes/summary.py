"""From the scores of checkpoints to what is said of their recipes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import polars as pl

from nathlon.arena.statistics import Floats
from nathlon.judge.recipes.statistics import (
    Aggregate,
    Estimate,
    estimate,
    interquartile_mean,
    mean,
    optimality_gap,
    probability_of_improvement,
    shrunk,
)
from nathlon.results.recipes import CONFIDENCE, RECIPES

RESAMPLES = 5000
NOTHING = Estimate(np.nan, np.nan, np.nan)


def summarise(scores: pl.DataFrame, rng: np.random.Generator) -> pl.DataFrame:
    """RECIPES of SCORES, in their order; the first recipe is the one to be better than.

    All intervals of `better` hold together with `CONFIDENCE` (Bonferroni).
    """
    names = scores["recipe"].unique(maintain_order=True).to_list()
    of_each = 1 - (1 - CONFIDENCE) / max(len(names) - 1, 1)
    last = last_checkpoints(scores)
    tasks = last.filter("judged")["task"].unique(maintain_order=True).to_list()
    points = {name: _matrix(last.filter(recipe=name), pl.col("points"), tasks) for name in names}
    all_runs = {name: scores.filter(recipe=name)["run"].n_unique() for name in names}
    judged = {name: len(points[name]) / all_runs[name] for name in names}
    rows = []
    for name in names:
        own = scores.filter(recipe=name)
        ends = last.filter(recipe=name)
        at_fault = _matrix(ends, pl.col("at_fault") / pl.col("km"), tasks)
        better = _better(points[name], points[names[0]], name == names[0], rng, of_each)
        figures = {
            "points": _estimate(points[name], mean, rng),
            "iqm": _estimate(points[name], interquartile_mean, rng),
            "gap": _estimate(points[name], optimality_gap(0.0), rng),
            "better": whatever_is_missing(better, judged[name] * judged[names[0]]),
            "at_fault_per_km": _estimate(at_fault, mean, rng),
        }
        rows.append(
            {
                "recipe": name,
                "runs": len(points[name]),
                "not_judged": ends.filter(~pl.col("judged"))["run"].n_unique(),
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


def whatever_is_missing(better: Estimate, known: float) -> Estimate:
    """Bounds of a probability that hold whatever the runs would have scored that are missing.

    Args:
        better: of the runs that are there.
        known: share of the pairs of runs, one of each recipe, that they make up.
    """
    return Estimate(better.value, known * better.low, 1.0 - known * (1.0 - better.high))


def last_checkpoints(scores: pl.DataFrame) -> pl.DataFrame:
    """The rows of SCORES of the checkpoints that each run ended with."""
    ends = scores.group_by("recipe", "run", maintain_order=True).agg(pl.col("entrant").last())
    return scores.join(ends, on=["recipe", "run", "entrant"], how="semi", maintain_order="left")


def _matrix(rows: pl.DataFrame, figure: pl.Expr, tasks: Sequence[str]) -> Floats:
    """(runs, tasks) of a figure; runs that lack one of them, or could not be judged in it, are left out."""
    known = rows.filter(pl.col("judged"), pl.col("task").is_in(list(tasks)))
    table = known.select("run", "task", figure=figure).pivot("task", index="run", maintain_order=True)
    if table.width <= len(tasks):
        return np.empty((0, len(tasks)))
    return table.select(tasks).drop_nulls().to_numpy().astype(np.float64)


def _estimate(scores: Floats, aggregate: Aggregate, rng: np.random.Generator) -> Estimate:
    """With its interval; nothing of no runs."""
    return estimate(scores, aggregate, rng, RESAMPLES, CONFIDENCE) if len(scores) else NOTHING


def _better(
    scores: Floats, base: Floats, itself: bool, rng: np.random.Generator, confidence: float
) -> Estimate:
    if itself or not len(scores) or not len(base):
        return NOTHING
    return probability_of_improvement(scores, base, rng, RESAMPLES, confidence)


def _best(own: pl.DataFrame) -> dict[str, str | float | None]:
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
    if each.is_empty():
        return {"best": None, "best_points": None, "best_expected": None}
    values = each["points"].to_numpy()
    expected = shrunk(values, each["error"].to_numpy())
    best = int(np.argmax(values))
    return {
        "best": each["name"][best],
        "best_points": float(values[best]),
        "best_expected": float(expected[best]),
    }
