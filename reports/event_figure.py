"""The figure of a race: places lap by lap, and how far each car is behind the first."""

from __future__ import annotations

from io import BytesIO
from typing import Any

import matplotlib
import numpy as np
import polars as pl
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from nathlon.arena.lap_chart import running_order
from nathlon.reports.recipes_figure import COLOURS, STYLE

STOP = "#22262b"
DASHES = ("-", "--", ":")
"""Further cars begin the colours again with the next."""


def event_picture(laps: pl.DataFrame) -> bytes:
    """The figure as PNG, from LAP_CHART with `name` and `class`; the same laps give the same bytes."""
    with matplotlib.rc_context(STYLE):
        buffer = BytesIO()
        _draw(laps).savefig(buffer, format="png", dpi=130)
    return buffer.getvalue()


def _draw(laps: pl.DataFrame) -> Figure:
    order = running_order(laps)
    named = laps["class"].n_unique() == 1 or pl.col("name").str.ends_with(pl.col("class"))
    label = pl.when(named).then("name").otherwise(pl.format("{} ({})", "name", "class"))
    names = dict(laps.select("car", label).unique().iter_rows())
    figure = Figure(figsize=(12, 3.4 + 0.36 * max(len(names), 6)), layout="constrained", facecolor="white")
    FigureCanvasAgg(figure)
    places, gaps = figure.subplots(2, 1, sharex=True)
    _draw_places(places, order, laps, names)
    _draw_gaps(gaps, laps)
    return figure


def _line(car: int) -> dict[str, Any]:
    return {"color": COLOURS[car % len(COLOURS)], "ls": DASHES[car // len(COLOURS) % len(DASHES)]}


def _draw_places(axes: Axes, order: pl.DataFrame, laps: pl.DataFrame, names: dict[int, str]) -> None:
    """One line a car, named at its end; a dot where it has stopped."""
    # A stop counts to the lap after it, and begins when the lap before that ends.
    began = laps.sort("car", "lap").with_columns(stop_s=pl.col("time_s").shift().over("car"))
    stopped = began.filter(pl.col("stops").diff().over("car").fill_null(0) > 0)
    for (car,), line in order.group_by("car", maintain_order=True):
        number = int(str(car))
        lap, place = line["lap"].to_numpy(), line["place"].to_numpy()
        axes.plot(lap, place, lw=1.5, **_line(number))
        stops = stopped.filter(car=number)["stop_s"].to_numpy()
        ends = laps.group_by("lap").agg(pl.col("time_s").min()).sort("lap")["time_s"].to_numpy()
        at = np.minimum(np.searchsorted(ends, stops), len(lap) - 1)
        axes.plot(lap[at], place[at], "o", ms=3.2, color=STOP)
        axes.annotate(
            names[number],
            (lap[-1], place[-1]),
            xytext=(6, 0),
            textcoords="offset points",
            va="center",
            annotation_clip=False,
        )
    axes.invert_yaxis()
    axes.set_yticks(range(1, len(names) + 1))
    axes.set_ylabel("place; dots are stops")


def _draw_gaps(axes: Axes, laps: pl.DataFrame) -> None:
    """How much later each car has completed a lap than the first to complete it."""
    gaps = laps.with_columns(gap=pl.col("time_s") - pl.col("time_s").min().over("lap")).sort("car", "lap")
    for (car,), line in gaps.group_by("car", maintain_order=True):
        axes.plot(line["lap"].to_numpy(), line["gap"].to_numpy(), lw=1.2, **_line(int(str(car))))
    axes.invert_yaxis()
    axes.set_ylabel("s behind the first to complete the lap")
    axes.set_xlabel("lap")
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
