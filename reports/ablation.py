"""The table and the figure of an ablation."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import matplotlib
import numpy as np
import polars as pl
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure, SubFigure
from matplotlib.ticker import FuncFormatter, MaxNLocator

from nathlon.sim.whole_file import whole_file, writing

ABLATION = pl.Schema(
    {
        "variant": pl.String,
        "seed": pl.Int64,
        "updates": pl.Int64,
        "transitions": pl.Int64,
        "wall_s": pl.Float64,
        "lap_s": pl.Float64,  # mean of the evaluation's time trials; null unless all were completed
        "off_course_share": pl.Float64,  # of the time driven there
        "score_difference": pl.Float64,  # team points a 4v4 race minus those of the base; null if not raced
        "contacts_per_km": pl.Float64,  # of the variant's cars in those races
    }
)
"""One row a checkpoint of one variant with one seed."""
EFFECTS = pl.Schema(
    {
        "variant": pl.String,
        "measure": pl.String,  # lap_s or score_difference of ABLATION, in its unit
        "seeds": pl.Int64,  # of the variant
        "difference": pl.Float64,  # from the base, of means over seeds
        "low": pl.Float64,  # 95 % confidence interval
        "high": pl.Float64,
    }
)
"""One row a variant and measure. Numbers are null where they are not known."""

BASE = "base"
GREY, COLOUR, INK = "#8b9096", "#1f6fb4", "#22262b"
COLUMNS = 3
MEASURES = (
    ("lap_s", 1.0, "lap time, s"),
    ("off_course_share", 100.0, "off course, % of time"),
    ("score_difference", 1.0, "team points a race, minus base"),
    ("contacts_per_km", 1.0, "contacts per km and car"),
)
"""What is shown of last checkpoints: column, factor, label."""


def write_ablation(table: pl.DataFrame, effects: pl.DataFrame, out: Path) -> None:
    """Write `ablation.csv`, `effects.csv`, `ablation.svg` and `ablation.png`.

    Args:
        table: schema ABLATION, variants in the order of the figure, one of them `base`.
        effects: schema EFFECTS.
        out: the folder.

    Raises:
        InputError: if one cannot be written.
    """
    _replace(out / "ablation.csv", lambda path: table.write_csv(path))
    _replace(out / "effects.csv", lambda path: effects.write_csv(path))
    with matplotlib.rc_context(
        {
            "font.size": 9,
            "axes.spines.top": False,
            "axes.spines.right": False,
            "svg.hashsalt": "nathlon",
            "text.parse_math": False,
        }
    ):
        figure = draw_ablation(table)
        _replace(
            out / "ablation.svg", lambda path: figure.savefig(path, format="svg", metadata={"Date": None})
        )
        _replace(out / "ablation.png", lambda path: figure.savefig(path, format="png", dpi=150))


def _replace(path: Path, write: Callable[[Path], None]) -> None:
    with writing(path), whole_file(path) as partial:
        write(partial)


def draw_ablation(table: pl.DataFrame) -> Figure:
    """Lap time against updates for each variant over the base; below, the last checkpoints of each run."""
    variants = table["variant"].unique(maintain_order=True).to_list()
    others = [variant for variant in variants if variant != BASE]
    rows = math.ceil(max(len(others), 1) / COLUMNS)
    heights = (0.6 + 1.9 * rows, 0.9 + 0.24 * len(variants))
    figure = Figure(figsize=(9, sum(heights)), layout="constrained", facecolor="white")
    FigureCanvasAgg(figure)
    above, below = figure.subfigures(2, 1, squeeze=False, height_ratios=heights).flat
    _draw_curves(above, table, others)
    _draw_last(below, last_checkpoints(table), variants)
    return figure


def seed_band(table: pl.DataFrame, variant: str) -> pl.DataFrame:
    """Lap time of a variant by `updates`: `median`, `low` and `high` over its seeds.

    A seed without a lap counts as slower than any, its lap time as infinite.
    """
    lap = pl.col("lap_s").fill_null(np.inf)
    return (
        table.filter(pl.col("variant") == variant)
        .group_by("updates")
        .agg(median=lap.median(), low=lap.min(), high=lap.max())
        .sort("updates")
    )


def last_checkpoints(table: pl.DataFrame) -> pl.DataFrame:
    """The last row of each variant and seed."""
    return table.sort("updates", maintain_order=True).group_by("variant", "seed", maintain_order=True).last()


def _draw_curves(part: SubFigure, table: pl.DataFrame, others: list[str]) -> None:
    columns = min(COLUMNS, max(len(others), 1))
    rows = math.ceil(max(len(others), 1) / columns)
    axes = part.subplots(rows, columns, sharex=True, sharey=True, squeeze=False).flat
    laps = table["lap_s"].drop_nulls().to_numpy()
    low, high = (laps.min(), laps.max()) if len(laps) else (0.0, 1.0)
    for axis, variant in zip(axes, others, strict=False):
        for name, colour in ((BASE, GREY), (variant, COLOUR)):
            _draw_band(axis, seed_band(table, name), high, colour)
        axis.set_title(variant, loc="left", fontsize=9, color=COLOUR)
    axes[0].set_ylim(low - 0.03 * (high - low), high)
    axes[0].xaxis.set_major_formatter(FuncFormatter(lambda updates, _: f"{updates / 1000:g}"))
    axes[0].xaxis.set_major_locator(MaxNLocator(5, steps=[1, 2, 5, 10]))
    for axis in axes[max(len(others) - columns, 0) :]:
        axis.tick_params(labelbottom=True)
    for axis in axes[len(others) :]:
        axis.set_axis_off()
    part.suptitle(
        "Lap time: median of the seeds, band from fastest to slowest seed; base in grey", fontsize=9
    )
    part.supxlabel("thousand updates", fontsize=9)
    part.supylabel("lap time, s", fontsize=9)


def _draw_band(axis: Axes, band: pl.DataFrame, top: float, colour: str) -> None:
    """A band that reaches the top of the panel where a seed has no lap, and ends where none has."""
    updates, low, median, high = (band[name].to_numpy() for name in ("updates", "low", "median", "high"))
    low, median = (np.where(np.isfinite(values), values, np.nan) for values in (low, median))
    axis.fill_between(updates, low, np.minimum(high, top), color=colour, alpha=0.25, linewidth=0)
    axis.plot(updates, median, color=colour, linewidth=1.4, marker=".", markersize=4)


def _draw_last(part: SubFigure, last: pl.DataFrame, variants: list[str]) -> None:
    raced = last["score_difference"].is_not_null().any()
    measures = MEASURES if raced else MEASURES[:2]
    axes = part.subplots(1, len(measures), sharey=True)
    axes[0].set_yticks(range(len(variants)), variants)
    axes[0].set_ylim(max(len(variants), 1) - 0.5, -0.5)
    for axis, (measure, factor, label) in zip(axes, measures, strict=True):
        for row, variant in enumerate(variants):
            values = factor * last.filter(variant=variant)[measure]
            colour = GREY if variant == BASE else COLOUR
            axis.plot(values, np.full(len(values), row), "o", color=colour, markersize=5, alpha=0.7)
            axis.plot(values.fill_null(np.inf).median(), row, "|", color=INK, markersize=11)
            if measure == "lap_s":
                crosses = "×" * values.null_count()
                axis.text(1.0, row, crosses, transform=axis.get_yaxis_transform(), color=colour, va="center")
        axis.set_xlabel(label)
        axis.grid(axis="x", linewidth=0.4)
    part.suptitle(
        "Last checkpoints: dot = one seed, cross = a seed without a lap, stroke = median",
        fontsize=9,
    )
