"""The round robin as a picture, for notebooks."""

from __future__ import annotations

import warnings
from io import BytesIO
from typing import Any

import matplotlib
import polars as pl
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from nathlon.sim.names import printable

WIDTH_IN, ROW_IN, FRAME_IN, DPI = 7.2, 0.29, 0.85, 120
POINTS = "Points a race"
MOST_ROWS = 40
MOST_LETTERS = 40
FIRST, OTHER, INK = "#1f6fb4", "#6b727b", "#22262b"
STYLE: dict[Any, Any] = {
    "font.family": "DejaVu Sans",
    "font.size": 10,
    "text.color": INK,
    "text.parse_math": False,  # names are not ours
    "text.usetex": False,
    "axes.edgecolor": INK,
    "axes.labelcolor": INK,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.spines.left": False,
    "xtick.color": INK,
    "ytick.color": INK,
    "ytick.left": False,
}


def ranking_picture(ranking: pl.DataFrame, heading: str = POINTS) -> bytes:
    """PNG of `draw_ranking`, of `WIDTH_IN` at `DPI`."""
    picture = BytesIO()
    with matplotlib.rc_context(STYLE), warnings.catch_warnings():
        # Letters that the font lacks are drawn as boxes.
        warnings.filterwarnings("ignore", "Glyph .* missing")
        draw_ranking(ranking, heading).savefig(picture, format="png", dpi=DPI)
    return picture.getvalue()


def draw_ranking(ranking: pl.DataFrame, heading: str = POINTS) -> Figure:
    """Points with their intervals, from best to worst; dots of those tied for first are filled.

    The best `MOST_ROWS` are drawn. Who has no points has no dot.

    Args:
        ranking: schema `nathlon.arena.results.RANKING` and `name`, in any order; with RECORDS their means
            are drawn.
        heading: what is drawn.
    """
    ordered = ranking.fill_nan(None).sort(
        "rank", "points_per_race", "name", descending=[False, True, False], nulls_last=True
    )
    shown = ordered.head(MOST_ROWS)
    figure = Figure(
        figsize=(WIDTH_IN, FRAME_IN + ROW_IN * max(1, shown.height)), layout="constrained", facecolor="white"
    )
    FigureCanvasAgg(figure)
    axes = figure.subplots()
    if shown["points_per_race"].drop_nulls().is_empty():
        axes.set_axis_off()
        axes.text(0.5, 0.5, "No team race was scored.", ha="center", va="center", transform=axes.transAxes)
        return figure
    if "mean" in shown.columns and shown["mean"].drop_nulls().len():
        shown = shown.with_columns(
            pl.col("mean").alias("points_per_race"),
            pl.col("mean_low").alias("points_low"),
            pl.col("mean_high").alias("points_high"),
        )
    tied = shown.filter(pl.col("rank") == 1)
    first = "statistically tied for first" if tied.height > 1 else "alone in rank 1"
    rest = f"; best {shown.height} of {ordered.height}" if ordered.height > shown.height else ""
    title = f"{heading}, 95 % intervals. Filled: {first}{rest}"
    figure.suptitle(title, x=0.01, ha="left", fontsize=10)  # the axes may be narrower
    for place, row in enumerate(shown.iter_rows(named=True)):
        _draw_row(axes, place, row)
    axes.set_yticks(range(shown.height), [_label(row) for row in shown.iter_rows(named=True)])
    axes.set_ylim(shown.height - 0.4, -0.6)
    axes.grid(axis="x", linewidth=0.5, color="#e2e4e5")
    axes.set_axisbelow(True)
    return figure


def _draw_row(axes: Axes, place: int, row: dict[str, Any]) -> None:
    points, low, high = row["points_per_race"], row["points_low"], row["points_high"]
    if points is None:
        return
    colour = FIRST if row["rank"] == 1 else OTHER
    if low is not None and high is not None:
        axes.plot([low, high], [place, place], color=colour, linewidth=2.0, marker="|", markersize=8)
    filled = colour if row["rank"] == 1 else "white"
    axes.plot([points], [place], "o", color=colour, markerfacecolor=filled, markersize=7)


def _label(row: dict[str, Any]) -> str:
    name = printable(str(row["name"]))
    short = name if len(name) <= MOST_LETTERS else f"{name[: MOST_LETTERS - 1]}…"
    return f"{short} (barred)" if row["barred"] else short
