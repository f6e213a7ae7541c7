"""The map of a circuit: its plan above its heights and bends along the lap; and plans of many on a sheet."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from nathlon.sim.track import (
    CURVATURE,
    KERB_LEFT,
    KERB_RIGHT,
    RUNOFF_LEFT,
    RUNOFF_RIGHT,
    SURFACES,
    ZONE,
    Track,
    Z,
)
from nathlon.sim.track.plan import (
    INK,
    PAPER,
    PENALTY,
    PIT_LANE,
    ROAD,
    SECTORS,
    START,
    SURFACE,
    WALL,
    draw_ground,
    draw_plan,
    wall_lines,
)
from nathlon.sim.whole_file import whole_file, writing

SHEET_ROW, THUMBNAIL_IN, SHEET_DPI = 5, 4.0, 90
"""Circuits in a row of a sheet, and the side of each."""
PLAN_IN, NAMES_IN, MARGIN_IN, DPI = 14.0, 0.9, 0.85, 160


def draw_map(track: Track, path: Path) -> None:
    """Draw the map of a circuit with a strip of heights and curvature, as a PNG picture.

    Raises:
        InputError: if the picture cannot be written.
    """
    # A dollar sign in a name begins no formula.
    with matplotlib.rc_context({"text.parse_math": False}):
        figure = _drawn(track)
    with writing(path, "map"), whole_file(path) as partial:
        figure.savefig(partial, format="png", facecolor=PAPER)


def draw_sheet(tracks: Sequence[Track], path: Path) -> None:
    """Draw the plans of circuits in rows, each to a scale of its own; the kind of picture goes by its name.

    Raises:
        InputError: if the picture cannot be written.
    """
    columns = min(len(tracks), SHEET_ROW)
    rows = -(-len(tracks) // columns)
    figure = Figure(figsize=(columns * THUMBNAIL_IN, rows * THUMBNAIL_IN), dpi=SHEET_DPI, facecolor=PAPER)
    FigureCanvasAgg(figure)
    for place, track in enumerate(tracks, start=1):
        axes = figure.add_subplot(rows, columns, place)
        walls = np.concatenate(wall_lines(track))
        (left, right), (bottom, top) = np.quantile(walls, (0, 1), axis=0).T
        axes.set(xlim=(left, right), ylim=(bottom, top), aspect="equal")
        axes.set_axis_off()
        draw_ground(axes, track, np.ones(len(track.table), np.bool_), 1.0)
        axes.set_title(f"{track.name}\n{track.description}", fontsize=7, parse_math=False)
    figure.tight_layout()
    with writing(path, "sheet"), whole_file(path) as partial:
        figure.savefig(partial, format=path.suffix.lstrip(".") or "png", facecolor=PAPER)


def _drawn(track: Track) -> Figure:
    corners = np.concatenate(wall_lines(track))
    middle, extent = (corners.min(axis=0) + corners.max(axis=0)) / 2, np.ptp(corners, axis=0)
    across = PLAN_IN - 2 * NAMES_IN
    height = float(np.clip(across * extent[1] / extent[0] + 2 * NAMES_IN, 6.0, 14.0))
    inch = float(max(extent[0] / across, extent[1] / (height - 2 * NAMES_IN)))
    (left, bottom), (right, top) = (
        middle + sign * inch / 2 * np.array([PLAN_IN, height]) for sign in (-1, 1)
    )
    figure = Figure(figsize=(PLAN_IN + 2 * MARGIN_IN, height + 5.6), dpi=DPI, facecolor=PAPER)
    FigureCanvasAgg(figure)
    plan, heights, bends = _axes(figure, 4.6, height), _axes(figure, 2.5, 1.3), _axes(figure, 1.05, 1.3)
    plan.set(xlim=(left, right), ylim=(bottom, top))
    title = figure.text(MARGIN_IN, height + 5.2, track.name, fontsize=24, weight="bold")
    subtitle = figure.text(MARGIN_IN, height + 4.82, track.description, fontsize=12)
    for text in (title, subtitle):
        text.set(transform=figure.dpi_scale_trans, va="center", color=INK)
    draw_plan(plan, track, inch)
    _draw_heights(heights, track)
    _draw_bends(bends, track)
    _draw_key(figure, track)
    return figure


def _axes(figure: Figure, bottom: float, height: float) -> Axes:
    """Axes over the width of the figure, in inches from below."""
    width, whole = figure.get_size_inches()
    return figure.add_axes((MARGIN_IN / width, bottom / whole, PLAN_IN / width, height / whole))


def _draw_key(figure: Figure, track: Track) -> None:
    table = track.table
    used = {SURFACES[int(index)] for index in np.unique(table[:, [RUNOFF_LEFT, RUNOFF_RIGHT]])}
    marks: list[Patch | Line2D] = [Patch(color=ROAD, label="road")]
    if table[:, [KERB_LEFT, KERB_RIGHT]].any():
        marks.append(Patch(color=SURFACE["kerb"], label="kerb"))
    marks += [Patch(color=SURFACE[name], label=name) for name in SURFACES if name in used]
    marks.append(Line2D([], [], color=WALL, linewidth=1.0, label="wall"))
    if table[:, ZONE].any():
        marks.append(Patch(color=PENALTY, label="penalty zone"))
    marks.append(Patch(color=PIT_LANE, label="pit lane"))
    marks.append(Line2D([], [], color=START, linewidth=3.0, label="start and finish"))
    marks += [
        Line2D([], [], color=colour, linewidth=2.0, label=f"sector {number}")
        for number, colour in enumerate(SECTORS, start=1)
    ]
    figure.legend(
        handles=marks,
        loc="lower center",
        ncols=len(marks),
        fontsize=9,
        frameon=False,
        handlelength=1.4,
        columnspacing=1.3,
        labelcolor=INK,
    )


def _dress(strip: Axes, track: Track, label: str) -> None:
    """What both strips share: sections, sectors and penalty zones over the distance."""
    strip.set(xlim=(0.0, track.length), facecolor=PAPER)
    strip.set_ylabel(label, fontsize=10, color=INK)
    strip.spines[["top", "right"]].set_visible(False)
    strip.tick_params(colors=INK, labelsize=9)
    for section in track.sections:
        if section.kind != "straight":
            strip.axvspan(section.start_m, section.end_m, color=INK, alpha=0.07, linewidth=0)
    for start, colour in zip(track.sectors[1:], SECTORS[1:], strict=True):
        strip.axvline(start, color=colour, linewidth=1.4)


def _draw_heights(strip: Axes, track: Track) -> None:
    distance = np.append(np.arange(len(track.table)) * track.spacing, track.length)
    height = np.append(track.table[:, Z], track.table[0, Z])
    low, high = height.min(), height.max()
    room = max(0.15 * (high - low), 1.0)
    _dress(strip, track, "height, m")
    strip.set_ylim(low - room, high + room)
    strip.fill_between(distance, low - room, height, color="#c9b79c", alpha=0.6, linewidth=0)
    strip.plot(distance, height, color="#7a5c33", linewidth=1.6)
    strip.tick_params(labelbottom=False)
    for section in track.sections:
        if section.kind != "straight":
            middle = (section.start_m + section.end_m) / 2
            strip.text(
                middle,
                1.02,
                section.name,
                transform=strip.get_xaxis_transform(),
                rotation=35,
                ha="left",
                va="bottom",
                rotation_mode="anchor",
                fontsize=8.5,
                color=INK,
            )


def _draw_bends(strip: Axes, track: Track) -> None:
    distance = np.arange(len(track.table)) * track.spacing
    curvature = 1000.0 * track.table[:, CURVATURE]
    _dress(strip, track, "curvature, 1/km")
    strip.fill_between(distance, np.maximum(curvature, 0.0), color=SECTORS[0], alpha=0.8, linewidth=0)
    strip.fill_between(distance, np.minimum(curvature, 0.0), color=START, alpha=0.8, linewidth=0)
    strip.axhline(0.0, color=INK, linewidth=0.6)
    strip.fill_between(
        distance,
        0.0,
        0.05,
        where=list(track.table[:, ZONE] > 0.0),
        color=PENALTY,
        transform=strip.get_xaxis_transform(),
        linewidth=0,
    )
    strip.set_xlabel("metres along the centre line", fontsize=10, color=INK)
