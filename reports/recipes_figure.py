"""The figure of recipes: learning curves with bands, and points against contacts at fault."""

from __future__ import annotations

from io import BytesIO
from typing import Any

import matplotlib
import polars as pl
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

COLOURS = ("#22262b", "#1f6fb4", "#c2571a", "#3f8f5b", "#8c5aa8", "#b3932b", "#c04a6b", "#4a9aa8")
"""Of recipes in their order; further ones begin again."""
ZERO = "#8b9096"
STYLE: dict[Any, Any] = {
    "font.family": "DejaVu Sans",
    "font.size": 9,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "text.parse_math": False,  # names are not ours
    "text.usetex": False,
}


def recipes_picture(recipes: pl.DataFrame, scores: pl.DataFrame) -> bytes:
    """The figure as PNG, from RECIPES and SCORES; the same tables give the same bytes."""
    with matplotlib.rc_context(STYLE):
        buffer = BytesIO()
        draw_recipes(recipes, scores).savefig(buffer, format="png", dpi=130)
    return buffer.getvalue()


def draw_recipes(recipes: pl.DataFrame, scores: pl.DataFrame) -> Figure:
    """Points by updates in a band from the least to the greatest run, and the ends against contacts."""
    names = recipes["recipe"].to_list()
    colours = {name: COLOURS[number % len(COLOURS)] for number, name in enumerate(names)}
    figure = Figure(figsize=(10, 4.4), layout="constrained", facecolor="white")
    FigureCanvasAgg(figure)
    curves, ends = figure.subplots(1, 2, width_ratios=(3, 2))
    _draw_curves(curves, scores, colours)
    _draw_ends(ends, recipes, colours)
    handles, labels = curves.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=min(len(names), 4), frameon=False)
    return figure


def curve(scores: pl.DataFrame, recipe: str) -> pl.DataFrame:
    """Points of a recipe by `step`: `mean`, `low` and `high` over its runs, each the mean over tasks."""
    return (
        scores.filter(recipe=recipe)
        .drop_nulls(["step", "points"])
        .group_by("run", "step")
        .agg(pl.col("points").mean())
        .group_by("step")
        .agg(mean=pl.col("points").mean(), low=pl.col("points").min(), high=pl.col("points").max())
        .sort("step")
    )


def _draw_curves(axes: Axes, scores: pl.DataFrame, colours: dict[str, str]) -> None:
    for name, colour in colours.items():
        found = curve(scores, name)
        steps = found["step"].to_numpy() / 1000
        low, high = found["low"].to_numpy(), found["high"].to_numpy()
        axes.fill_between(steps, low, high, color=colour, alpha=0.12, lw=0)
        axes.plot(steps, found["mean"].to_numpy(), color=colour, label=name, marker="o", ms=3, lw=1.4)
    axes.axhline(0.0, color=ZERO, lw=0.8)
    axes.set_xlabel("thousand updates")
    axes.set_ylabel("team points a race, less the reference's")


def _draw_ends(axes: Axes, recipes: pl.DataFrame, colours: dict[str, str]) -> None:
    for row in recipes.iter_rows(named=True):
        x, y = row["at_fault_per_km"], row["points"]
        if x is None or y is None:
            continue
        colour = colours[row["recipe"]]
        if row["points_low"] is not None:
            axes.hlines(y, row["at_fault_per_km_low"], row["at_fault_per_km_high"], color=colour, lw=1.4)
            axes.vlines(x, row["points_low"], row["points_high"], color=colour, lw=1.4)
        axes.plot([x], [y], "o", ms=6, color=colour)
    axes.axhline(0.0, color=ZERO, lw=0.8)
    axes.set_xlabel("contacts at fault, a car and km")
    axes.set_ylabel("at the end of training")
    axes.set_xlim(left=0.0)
