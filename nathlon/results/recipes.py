"""What is left of recipes for other programs: their tables."""

from __future__ import annotations

from math import comb
from pathlib import Path

import polars as pl

from nathlon.sim.whole_file import whole_file

SCORES = pl.Schema(
    {
        "recipe": pl.String,
        "run": pl.String,  # a training run: its seed, or its place in the recipe's folder
        "step": pl.Int64,  # of the training; null where it is not known
        "entrant": pl.String,
        "name": pl.String,
        "task": pl.String,  # a race against a reference
        "units": pl.Int64,  # mirrored pairs that are not void
        "void": pl.Int64,  # those that are
        "judged": pl.Boolean,  # whether most units of checkpoint and reference are not
        "points": pl.Float64,  # team points a race, less the reference's
        "error": pl.Float64,  # standard error of `points`; null below two units
        "contacts": pl.Int64,  # of all its cars
        "at_fault": pl.Int64,  # of these, laid to them
        "km": pl.Float64,  # driven by all its cars
    }
)
"""One row a checkpoint and task."""
_ESTIMATES = ("points", "iqm", "gap", "better", "at_fault_per_km")
RECIPES = pl.Schema(
    {
        "recipe": pl.String,
        "runs": pl.Int64,  # whose last checkpoint could be judged
        "not_judged": pl.Int64,  # runs whose last checkpoint could not in some task, see SCORES
        "checkpoints": pl.Int64,
        **{
            f"{name}{bound}": pl.Float64 for name in _ESTIMATES for bound in ("", "_low", "_high")
        },  # of the last checkpoints, with a 95 % interval over runs, null with one run
        "best": pl.String,  # name of the checkpoint with most points
        "best_points": pl.Float64,
        "best_expected": pl.Float64,  # what it may be expected to score again
    }
)
"""One row a recipe. `points` are the mean over runs, `iqm` that of the middle half. `gap` is how far runs
fall short of the references' points, `better` the probability that a run scores more than one of the first,
with bounds that hold for all recipes together. They hold whatever runs that could not be judged would have
scored.
"""
NOT_JUDGED = 3
"""Exit code where a training run could not be judged, as most of its units are void."""


CONFIDENCE = 0.95
"""Of intervals, and of all comparisons with the first recipe together."""


def exit_code(scores: pl.DataFrame) -> int:
    """Of SCORES: 0, or 3 if a checkpoint could not be judged."""
    return NOT_JUDGED if scores.filter(~pl.col("judged")).height else 0


def void_units(recipes: pl.DataFrame, scores: pl.DataFrame) -> str:
    """How many units of SCORES are void, and who could not be judged for them; empty where none are."""
    void = int(scores["void"].sum())
    if not void:
        return ""
    told = f"{void:,} of {void + int(scores['units'].sum()):,} mirrored pairs are void and count for nobody"
    lost = [
        f"{row['not_judged']} training run{'s' if row['not_judged'] > 1 else ''} of {row['recipe']} "
        f"({row['runs']} left)"
        for row in recipes.to_dicts()
        if row["not_judged"]
    ]
    return f"{told}; could not be judged: {', '.join(lost)}." if lost else f"{told}."


def too_few(runs: int, others: int, recipes: int) -> bool:
    """Whether no scores of so many runs prove that one of some recipes differs from the first.

    The most that a permutation test can find is that all runs of the one beat all of the other.
    """
    return 2 / comb(runs + others, runs) > (1 - CONFIDENCE) / recipes


def write_recipes(recipes: pl.DataFrame, scores: pl.DataFrame, folder: Path) -> None:
    """Write `recipes.csv` (RECIPES) and `scores.csv` (SCORES), each whole or not at all."""
    for name, table in (("recipes", recipes), ("scores", scores)):
        with whole_file(folder / f"{name}.csv") as partial:
            table.write_csv(partial)
