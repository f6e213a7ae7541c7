"""The plan of a circuit: the road from above, with all that stands beside it, and the names."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.text import Text
from matplotlib.transforms import Bbox
from numpy.typing import NDArray

from nathlon.sim.track import (
    CURVATURE,
    KERB_LEFT,
    KERB_RIGHT,
    LEFT,
    LEVEL,
    RIGHT,
    RUNOFF_LEFT,
    RUNOFF_RIGHT,
    SURFACES,
    TANGENT_X,
    TANGENT_Y,
    WALL_LEFT,
    WALL_RIGHT,
    ZONE,
    NamedSection,
    Track,
    X,
    Y,
)

PAPER, INK, FAINT = "#fbfaf6", "#22262b", "#8b9096"
ROAD, WALL, PLACE, PENALTY, START = "#4a5058", "#2b2f36", "#ffffff", "#f2b134", "#d7263d"
PIT_LANE, LANE_M = "#c2409b", (4.0, 8.0)
"""Its colour, and how far beside the edge of the road it is drawn."""
SURFACE = {"tarmac": "#a9adb3", "kerb": "#d7263d", "grass": "#a9cf8e", "gravel": "#e3cf9f"}
SECTORS = ("#2f6fde", "#12a594", "#8e4ec6")
PLACES, CAR_M = 20, (4.6, 2.0)
LEAST_BEND = 1e-9
"""Curvature of no account, 1/m."""


def wall_lines(track: Track) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The lines of the walls, left and right, (n, 2)."""
    table = track.table
    return track.offset_line(table[:, WALL_LEFT])[:, :2], track.offset_line(-table[:, WALL_RIGHT])[:, :2]


def draw_plan(axes: Axes, track: Track, inch: float) -> None:
    """Draw a circuit from above.

    Args:
        axes: with limits in metres that hold the circuit.
        track: the circuit.
        inch: metres in an inch of the picture, the measure of all that is not drawn to scale.
    """
    axes.set_axis_off()
    # The upper road of a bridge covers the lower one.
    bridge = track.table[:, LEVEL] > 0.0
    for order, rows in ((1.0, ~bridge), (2.0, bridge)):
        draw_ground(axes, track, rows, order)
        _draw_sector_line(axes, track, rows, order)
    _draw_pit_lane(axes, track)
    _draw_grid(axes, track)
    names = _Names(axes, track, inch)
    names.avoid(_draw_start(axes, track, inch))
    names.avoid(_draw_scale(axes, track, inch))
    for number, start in enumerate(track.sectors[1:], start=2):
        names.write_sector(number, start)
    for section in sorted(track.sections, key=lambda section: section.kind == "straight"):
        names.write_section(section)


def _ribbon(track: Track, one: NDArray[np.float64], other: NDArray[np.float64]) -> NDArray[np.float64]:
    """Quadrangles between two offsets from the centre line, (n, 4, 2)."""
    a, b = track.offset_line(one)[:, :2], track.offset_line(other)[:, :2]
    return np.stack([a, np.roll(a, -1, axis=0), np.roll(b, -1, axis=0), b], axis=1)


def _fill(axes: Axes, quads: NDArray[np.float64], colours: str | list[str], order: float) -> None:
    # An edge in the same colour closes the hairlines between neighbours.
    axes.add_collection(
        PolyCollection(list(quads), facecolors=colours, edgecolors=colours, linewidths=0.4, zorder=order),
        autolim=False,
    )


def draw_ground(axes: Axes, track: Track, rows: NDArray[np.bool_], order: float) -> None:
    """Some rows of the ground; those of a higher order cover the others."""
    table = track.table
    for sign, edge, kerb, runoff, wall in (
        (1.0, LEFT, KERB_LEFT, RUNOFF_LEFT, WALL_LEFT),
        (-1.0, RIGHT, KERB_RIGHT, RUNOFF_RIGHT, WALL_RIGHT),
    ):
        surfaces = [SURFACE[SURFACES[int(index)]] for index in table[rows, runoff]]
        _fill(axes, _ribbon(track, sign * table[:, edge], sign * table[:, wall])[rows], surfaces, order + 0.1)
        striped = np.flatnonzero(rows & (table[:, kerb] > 0.0))
        if len(striped):
            quads = _ribbon(track, sign * table[:, edge], sign * (table[:, edge] + table[:, kerb]))
            stripes = [SURFACE["kerb"] if row // 3 % 2 else "#ffffff" for row in striped]
            _fill(axes, quads[striped], stripes, order + 0.3)
    _fill(axes, _ribbon(track, table[:, LEFT], -table[:, RIGHT])[rows], ROAD, order + 0.2)
    zone = rows & (table[:, ZONE] > 0.0)
    if zone.any():
        _fill(axes, _ribbon(track, 0.8 * table[:, LEFT], -0.8 * table[:, RIGHT])[zone], PENALTY, order + 0.25)
    ends = rows | np.roll(rows, 1)
    for line in wall_lines(track):
        wall_line = np.where(ends[:, None], line, np.nan)
        axes.plot(*np.vstack([wall_line, wall_line[:1]]).T, color=WALL, linewidth=0.9, zorder=order + 0.4)


def _draw_pit_lane(axes: Axes, track: Track) -> None:
    lane = track.pit_lane
    sign, edge = (1.0, LEFT) if lane.side == "left" else (-1.0, RIGHT)
    begin, rows = int(lane.entry_m / track.spacing), int(lane.length(track.length) / track.spacing)
    inside = (begin + np.arange(rows)) % len(track.table)
    near, far = (sign * (track.table[:, edge] + beyond) for beyond in LANE_M)
    _fill(axes, _ribbon(track, near, far)[inside], PIT_LANE, 5.5)


def _draw_sector_line(axes: Axes, track: Track, rows: NDArray[np.bool_], order: float) -> None:
    """The centre line in the colours of the sectors."""
    distance = np.flatnonzero(rows) * track.spacing
    line = track.table[:, [X, Y]]
    steps = np.stack([line, np.roll(line, -1, axis=0)], axis=1)[rows]
    colours = [SECTORS[index - 1] for index in np.searchsorted(track.sectors, distance, side="right")]
    axes.add_collection(
        LineCollection(list(steps), colors=colours, linewidths=1.6, zorder=order + 0.5), autolim=False
    )


def _draw_grid(axes: Axes, track: Track) -> None:
    grid, (length, width) = track.grid, CAR_M
    number = np.arange(PLACES, dtype=np.float64)
    lateral = np.where(number % 2 == 0, grid.lateral_m, -grid.lateral_m)
    x, y, heading = track.pose(grid.pole_m - grid.spacing_m * number, lateral)
    along = np.stack([np.cos(heading), np.sin(heading)], axis=1)[:, None] * length / 2
    aside = np.stack([-np.sin(heading), np.cos(heading)], axis=1)[:, None] * width / 2
    centre = np.stack([x, y], axis=1)[:, None]
    cars = centre + np.array([1, 1, -1, -1])[:, None] * along + np.array([1, -1, -1, 1])[:, None] * aside
    axes.add_collection(
        PolyCollection(list(cars), facecolors=PLACE, edgecolors=INK, linewidths=0.3, zorder=6), autolim=False
    )


def _row(track: Track, distance: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The row of the table at a distance, m, and the unit vector to the left there."""
    row = track.table[int(distance / track.spacing) % len(track.table)]
    return row, np.array([-row[TANGENT_Y], row[TANGENT_X]])


def _across(track: Track, distance: float, beyond: float) -> NDArray[np.float64]:
    """Ends, left and right, of a line across the road that sticks out beyond the edges, m, (2, 2)."""
    row, left = _row(track, distance)
    return row[[X, Y]] + np.outer([row[LEFT] + beyond, -row[RIGHT] - beyond], left)


def _draw_start(axes: Axes, track: Track, inch: float) -> NDArray[np.float64]:
    """The line, and an arrow in driving direction; returns the ends of the arrow, (2, 2)."""
    ends = _across(track, 0.0, 0.07 * inch)
    axes.plot(*ends.T, color="white", linewidth=4.0, zorder=6.5)
    axes.plot(*ends.T, color=START, linewidth=2.4, zorder=7)
    row, left = _row(track, 0.0)
    foot = row[[X, Y]] + left * (row[WALL_LEFT] + 0.14 * inch)
    tip = foot + inch * row[[TANGENT_X, TANGENT_Y]]
    arrow = {"arrowstyle": "-|>,head_width=0.5,head_length=0.9", "color": START, "linewidth": 3.0}
    axes.annotate("", xy=(tip[0], tip[1]), xytext=(foot[0], foot[1]), arrowprops=arrow, zorder=8)
    return np.stack([foot, tip])


def _draw_scale(axes: Axes, track: Track, inch: float) -> NDArray[np.float64]:
    """A scale and the north in the corner with the most room; returns its corners, m, (2, 2)."""
    low, high = np.stack([axes.get_xlim(), axes.get_ylim()], axis=1)
    metres = max(size for size in (50.0, 100.0, 200.0, 500.0, 1000.0, 2000.0) if size < max(2.5 * inch, 51.0))
    size = np.array([metres + 0.5 * inch, 0.85 * inch])
    feet = [np.array([x, y]) for x in (low[0], high[0] - size[0]) for y in (low[1], high[1] - size[1])]
    line = track.table[:, [X, Y]]
    foot = max(feet, key=lambda foot: float(np.hypot(*(line - foot - size / 2).T).min()))
    axes.plot(foot[0] + [0.0, metres], foot[[1, 1]], color=INK, linewidth=3, solid_capstyle="butt")
    axes.text(
        foot[0] + metres / 2, foot[1] + 0.08 * inch, f"{metres:.0f} m", ha="center", fontsize=9, color=INK
    )
    x, y = foot[0] + metres + 0.3 * inch, foot[1]
    north = {"arrowstyle": "-|>", "color": INK, "linewidth": 1.5}
    axes.annotate("", xy=(x, y + 0.62 * inch), xytext=(x, y), arrowprops=north)
    axes.text(x, y + 0.64 * inch, "N", ha="center", va="bottom", color=INK, fontsize=10, weight="bold")
    return np.stack([foot, foot + size])


class _Names:
    """Names beside the road, each where it covers neither the road nor what is written already."""

    def __init__(self, axes: Axes, track: Track, inch: float) -> None:
        self._axes, self._track, self._inch = axes, track, inch
        road = np.concatenate([*wall_lines(track), track.table[:, [X, Y]]])
        self._road = axes.transData.transform(road)
        self._written: list[Bbox] = []

    def avoid(self, corners: NDArray[np.float64]) -> None:
        """Keep a rectangle free, given by two opposite corners, m, (2, 2)."""
        pixels = self._axes.transData.transform(corners)
        self._written.append(Bbox([pixels.min(axis=0), pixels.max(axis=0)]).padded(6.0))

    def write_sector(self, number: int, start: float) -> None:
        """A line where a sector begins, with a badge at its end."""
        colour = SECTORS[number - 1]
        self._axes.plot(
            *_across(self._track, start, 0.1 * self._inch).T, color=colour, linewidth=2.4, zorder=6
        )
        badge = {"boxstyle": "round,pad=0.25", "facecolor": colour, "edgecolor": "none"}
        text = self._axes.text(
            0, 0, f"Sector {number}", fontsize=9, color="white", weight="bold", zorder=8, bbox=badge
        )
        self._put(text, start, 1.0)

    def write_section(self, section: NamedSection) -> None:
        """The name of a section at its middle, or where a corner bends the most, on the outside."""
        table, spacing = self._track.table, self._track.spacing
        first, last = int(section.start_m / spacing), int(section.end_m / spacing)
        inside = np.arange(first, max(last, first + 1))
        bend = table[inside % len(table), CURVATURE] if section.kind == "corner" else np.ones(len(inside))
        weight = np.abs(bend) + LEAST_BEND
        middle = float(spacing * (inside * weight).sum() / weight.sum())
        outside = -1.0 if bend.sum() > 0 else 1.0
        if section.kind == "straight":
            text = self._axes.text(0, 0, section.name, fontsize=9, color=FAINT, style="italic", zorder=7)
            self._put(text, middle, outside)
            return
        text = self._axes.text(0, 0, section.name, fontsize=11.5, color=INK, weight="bold", zorder=9)
        foot, place = self._put(text, middle, outside)
        self._axes.plot(*np.stack([foot, place]).T, color=FAINT, linewidth=0.8, zorder=3.5)
        text.set_bbox({"boxstyle": "round,pad=0.15", "facecolor": PAPER, "edgecolor": "none"})

    def _put(
        self, text: Text, distance: float, side: float
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Move a text to its best place; returns the point of the wall that it belongs to, and the place."""
        text.set(ha="center", va="center")
        places = list(self._places(distance, side))
        boxes = []
        for _, place in places:
            text.set_position((place[0], place[1]))
            boxes.append(text.get_window_extent().padded(5.0))
        # Earlier places are better ones.
        best = int(np.argmin([self._covered(box) + 0.7 * rank for rank, box in enumerate(boxes)]))
        text.set_position((places[best][1][0], places[best][1][1]))
        self._written.append(boxes[best])
        return places[best]

    def _places(
        self, distance: float, side: float
    ) -> Iterator[tuple[NDArray[np.float64], NDArray[np.float64]]]:
        """Points of the walls, and places for a name beside them, the preferred side (+1 left) first."""
        row, left = _row(self._track, distance)
        for inches in (0.28, 0.4, 0.55, 0.75, 1.0, 1.3):
            for chosen in (side, -side):
                foot = row[[X, Y]] + chosen * left * (row[WALL_LEFT] if chosen > 0 else row[WALL_RIGHT])
                yield foot, foot + chosen * left * inches * self._inch

    def _covered(self, box: Bbox) -> float:
        """How much a box covers: points of the road, and more for names and for what lies beyond the plan."""
        road = ((self._road >= box.min) & (self._road <= box.max)).all(axis=1).sum()
        names = sum(box.overlaps(other) for other in self._written)
        plan = self._axes.bbox
        beyond = not (plan.contains(box.x0, box.y0) and plan.contains(box.x1, box.y1))
        return float(road + 100 * names + 400 * beyond)
