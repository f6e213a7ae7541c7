"""Circuits: a closed ribbon of road in space, sampled evenly along its centre line."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
import scipy
from numpy.typing import NDArray
from pydantic import AfterValidator, Field, model_validator

from nathlon.sim.data_file import DATA, Section, find_data, read_toml
from nathlon.sim.errors import InputError
from nathlon.sim.names import printable, proper_name
from nathlon.sim.track.centre_line import COLUMNS, RIGHT_WIDTH, read_centre_line
from nathlon.sim.track.crossing import LEAST_CLEARANCE_M, find_crossings, levels
from nathlon.sim.track.pit_lane import PitLane, laid_out

SPACING_M = 2.0
TAPER_M = 8.0
"""Over this length a kerb grows to its width."""
SHORTEST_LANE_M = 50.0
# Columns of `Track.table`, so that what one look-up needs lies close together.
X, Y, TANGENT_X, TANGENT_Y, CURVATURE, LEFT, RIGHT, WALL_LEFT, WALL_RIGHT = range(9)
SLOPE, BANK, CREST, TWIST, KERB_LEFT, KERB_RIGHT, RUNOFF_LEFT, RUNOFF_RIGHT, Z, SECTION, ZONE = range(9, 20)
LEVEL, TABLE_WIDTH = 20, 21

SURFACES = ("tarmac", "kerb", "grass", "gravel")
Runoff = Literal["tarmac", "grass", "gravel"]
Side = Literal["left", "right"]
Positive = Annotated[float, Field(gt=0)]
NotNegative = Annotated[float, Field(ge=0)]
Name = Annotated[str, AfterValidator(proper_name)]


class Grid(Section):
    """Where the starting places lie."""

    pole_m: float
    spacing_m: Positive
    lateral_m: NotNegative


class Stretch(Section):
    """A part of the lap, m along the centre line."""

    start_m: NotNegative
    end_m: Positive

    @model_validator(mode="after")
    def _forward(self) -> Stretch:
        if self.start_m >= self.end_m:
            raise ValueError("start_m must lie before end_m")
        return self


class NamedSection(Stretch):
    """A stretch with a name of its own."""

    name: Name
    kind: Literal["corner", "chicane", "straight"]


class Kerb(Stretch):
    """A kerb beside the road: in bounds, with less grip."""

    side: Side
    width_m: Annotated[float, Field(gt=0, le=100)]


class RunoffStretch(Stretch):
    """Run-off that differs from the circuit's usual one."""

    side: Side
    surface: Runoff


class CircuitFile(Section):
    """The circuit's TOML file."""

    name: Name
    description: Annotated[str, AfterValidator(printable)]
    centre_line: str
    runoff: Runoff
    sectors_m: tuple[Positive, Positive]
    grid: Grid
    section: tuple[NamedSection, ...] = ()
    kerb: tuple[Kerb, ...] = ()
    runoff_stretch: tuple[RunoffStretch, ...] = ()
    penalty_zone: tuple[Stretch, ...] = ()
    pit_lane: PitLane | None = None

    @model_validator(mode="after")
    def _in_order(self) -> CircuitFile:
        if self.sectors_m[0] >= self.sectors_m[1]:
            raise ValueError("sectors_m must rise")
        for before, after in pairwise(self.section):
            if after.start_m < before.end_m:
                raise ValueError(f"section {after.name!r} must begin where {before.name!r} ends, or later")
        return self


@dataclass(frozen=True, eq=False)
class Track:
    """A circuit ready to drive on.

    Lengths, speeds and angles are those of the map, the projection on the horizontal plane.

    Attributes:
        table: (n, TABLE_WIDTH) float64, one row every `spacing` metres of centre line. World frame,
            x east, y north, z up. Position, unit tangent, curvature (1/m, + is left), distances from
            the centre line to edges and walls (m), slope dz/ds, bank dz/dn (n is left), their
            derivatives along the line (crest, twist, 1/m), widths of the kerbs (m), surfaces of the
            run-off (indices of SURFACES), index of the section or -1, whether it is a penalty zone, level
            near a bridge (see `nathlon.sim.track.crossing.levels`).
        edges: (n, 12) float32: x of left edge, centre line and right edge, a zero; y alike; z alike.
        length: of the centre line, m.
        spacing: of the rows, m.
        sectors: where the sectors begin, m; the first at 0.
        pit_lane: of the file, or laid out.
    """

    name: str
    description: str
    table: NDArray[np.float64]
    edges: NDArray[np.float32]
    length: float
    spacing: float
    sectors: tuple[float, ...]
    grid: Grid
    sections: tuple[NamedSection, ...]
    pit_lane: PitLane

    def offset_line(self, offset: NDArray[np.float64] | float) -> NDArray[np.float64]:
        """The closed line at `offset` metres left of the centre line, (n, 3)."""
        aside = np.broadcast_to(offset, len(self.table))
        table = self.table
        return np.stack(
            [
                table[:, X] - table[:, TANGENT_Y] * aside,
                table[:, Y] + table[:, TANGENT_X] * aside,
                table[:, Z] + table[:, BANK] * aside,
            ],
            axis=1,
        )

    def pose(
        self, distance: NDArray[np.float64], lateral: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """World x, y (m) and heading (rad) of points given along (m) and left of (m) the centre line."""
        at = np.mod(distance, self.length) / self.spacing
        low = at.astype(np.int64) % len(self.table)
        share = (at - np.floor(at))[..., None]
        high = (low + 1) % len(self.table)
        row = self.table[low] * (1 - share) + self.table[high] * share
        heading = np.arctan2(row[..., TANGENT_Y], row[..., TANGENT_X])
        x = row[..., X] - np.sin(heading) * lateral
        y = row[..., Y] + np.cos(heading) * lateral
        return x, y, heading

    def stretch(self, name: str) -> tuple[float, float]:
        """Where a section begins and ends, m.

        Args:
            name: of a section, or `longest straight`, `last chicane`.

        Raises:
            InputError: if the circuit has no such section.
        """
        kind = {"longest straight": "straight", "last chicane": "chicane"}.get(name)
        found = [section for section in self.sections if name == section.name or kind == section.kind]
        if not found:
            raise InputError(f"circuit {self.name!r} has no section {name!r}")
        section = max(found, key=lambda s: s.end_m - s.start_m) if kind == "straight" else found[-1]
        return section.start_m, section.end_m

    def section_at(self, distance: float) -> str:
        """Name of the section at a distance along the centre line, m; '' where there is none."""
        row = math.floor(distance / self.spacing) % len(self.table)
        index = int(self.table[row, SECTION])
        return self.sections[index].name if index >= 0 else ""


def _kerb_widths(kerbs: tuple[Kerb, ...], side: Side, distance: NDArray[np.float64]) -> NDArray[np.float64]:
    widths = np.zeros(len(distance))
    for kerb in kerbs:
        if kerb.side == side:
            inside = np.minimum(distance - kerb.start_m, kerb.end_m - distance)
            widths = np.maximum(widths, kerb.width_m * np.clip(inside / TAPER_M, 0.0, 1.0))
    return widths


def _runoff(facts: CircuitFile, side: Side, distance: NDArray[np.float64]) -> NDArray[np.int64]:
    surfaces = np.full(len(distance), SURFACES.index(facts.runoff))
    for stretch in facts.runoff_stretch:
        if stretch.side == side:
            surfaces[_within(stretch, distance)] = SURFACES.index(stretch.surface)
    return surfaces


def _within(stretch: Stretch, distance: NDArray[np.float64]) -> NDArray[np.bool_]:
    return (distance >= stretch.start_m) & (distance < stretch.end_m)


def build_track(points: NDArray[np.float64], facts: CircuitFile) -> Track:
    """A track through the points of a closed centre line.

    Args:
        points: (n, 8) float64, columns as in COLUMNS.
        facts: everything else about the circuit.

    Raises:
        InputError: if the road lies on itself, or has no direction somewhere.
    """
    closed = np.vstack([points, points[:1]])
    chord = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(closed[:, :2], axis=0).T))])
    line = scipy.interpolate.CubicSpline(chord, closed[:, :3], bc_type="periodic")
    fine = np.linspace(0.0, chord[-1], 20 * len(points) + 1)
    arc = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(line(fine)[:, :2], axis=0).T))])
    length = float(arc[-1])
    rows = round(length / SPACING_M)
    spacing = length / rows
    distance = np.arange(rows).astype(np.float64) * spacing
    at = np.interp(distance, arc, fine)
    position, first, second = line(at), line(at, 1), line(at, 2)
    speed = np.hypot(first[:, 0], first[:, 1])
    if not speed.min() > 0.0:
        raise InputError("no smooth road goes through the points, expected them some way apart, evenly")
    tangent = first[:, :2] / speed[:, None]
    right, left, bank_angle, wall_right, wall_left = (
        np.interp(at, chord, closed[:, column]) for column in range(RIGHT_WIDTH, len(COLUMNS))
    )
    slope, bank = first[:, 2] / speed, np.tan(bank_angle)

    table = np.zeros((rows, TABLE_WIDTH))
    table[:, [X, Y, Z]] = position
    table[:, [TANGENT_X, TANGENT_Y]] = tangent
    table[:, CURVATURE] = (first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]) / speed**3
    table[:, LEFT], table[:, RIGHT] = left, right
    table[:, WALL_LEFT], table[:, WALL_RIGHT] = wall_left, wall_right
    table[:, SLOPE], table[:, BANK] = slope, bank
    # Slope and bank run straight from row to row, so that no energy comes from their steps.
    table[:, CREST] = (np.roll(slope, -1) - slope) / spacing
    table[:, TWIST] = (np.roll(bank, -1) - bank) / spacing
    table[:, KERB_LEFT] = _kerb_widths(facts.kerb, "left", distance)
    table[:, KERB_RIGHT] = _kerb_widths(facts.kerb, "right", distance)
    table[:, RUNOFF_LEFT] = _runoff(facts, "left", distance)
    table[:, RUNOFF_RIGHT] = _runoff(facts, "right", distance)
    table[:, SECTION] = -1
    for index, section in enumerate(facts.section):
        table[_within(section, distance), SECTION] = index
    for zone in facts.penalty_zone:
        table[_within(zone, distance), ZONE] = 1.0
    table[:, LEVEL] = levels(position, spacing)

    track = Track(
        name=facts.name,
        description=facts.description,
        table=table,
        edges=np.zeros((rows, 12), np.float32),
        length=length,
        spacing=spacing,
        sectors=(0.0, *facts.sectors_m),
        grid=facts.grid,
        sections=facts.section,
        pit_lane=facts.pit_lane or laid_out(table[:, CURVATURE], wall_left, wall_right, spacing),
    )
    for place, offset in enumerate((left, np.zeros(rows), -right)):
        track.edges[:, [place, place + 4, place + 8]] = track.offset_line(offset)
    return track


def _check_on_lap(path: Path, facts: CircuitFile, track: Track) -> None:
    for field in ("section", "kerb", "runoff_stretch", "penalty_zone"):
        for stretch in getattr(facts, field):
            if stretch.end_m > track.length + track.spacing:
                raise InputError(
                    f"{path}: {field}: end_m is {stretch.end_m:g}, "
                    f"expected at most the lap's {track.length:.1f} m"
                )
    for name, value in (("pole_m", facts.grid.pole_m), ("spacing_m", facts.grid.spacing_m)):
        if abs(value) > track.length:
            raise InputError(
                f"{path}: grid.{name} is {value:g}, expected at most the lap's {track.length:.1f} m"
            )
    lane = facts.pit_lane
    if lane is not None and not max(lane.entry_m, lane.exit_m) < track.length:
        raise InputError(f"{path}: pit_lane is not on the lap of {track.length:.1f} m")
    if lane is not None and not SHORTEST_LANE_M <= lane.length(track.length) <= track.length / 2.0:
        raise InputError(
            f"{path}: pit_lane is {lane.length(track.length):.1f} m long, expected at least "
            f"{SHORTEST_LANE_M:g} m and at most half of the lap"
        )
    widest = float(track.table[:, [LEFT, RIGHT]].max())
    if facts.grid.lateral_m > widest:
        raise InputError(
            f"{path}: grid.lateral_m is {facts.grid.lateral_m:g}, expected places on the road, "
            f"at most {widest:.1f} m from its centre line"
        )
    if facts.sectors_m[1] >= track.length:
        raise InputError(
            f"{path}: sectors_m: {facts.sectors_m[1]:g} is not on the lap of {track.length:.1f} m"
        )


def _check_bridges(path: Path, track: Track) -> None:
    table = track.table
    for first, second, _ in find_crossings(table[:, [X, Y]]):
        between = abs(table[first, Z] - table[second, Z])
        if between < LEAST_CLEARANCE_M:
            raise InputError(
                f"{path}: near x_m {table[first, X]:.0f}, y_m {table[first, Y]:.0f} the road crosses itself: "
                f"z_m differs by {between:.1f} m, expected a bridge of at least {LEAST_CLEARANCE_M:g} m"
            )


def read_track(path: Path) -> Track:
    """Read and check a circuit file and its centre line.

    Raises:
        InputError: if a file cannot be read, or a field is missing, unknown or out of range.
    """
    facts = read_toml(path, CircuitFile, "circuit")
    centre_line = path.parent / facts.centre_line
    points = read_centre_line(centre_line)
    try:
        track = build_track(points, facts)
    except InputError as error:
        raise InputError(f"{centre_line}: x_m, y_m: {error}") from None
    _check_on_lap(path, facts, track)
    _check_bridges(centre_line, track)
    return track


@lru_cache
def load_track(name: str) -> Track:
    """A circuit by its shipped name, or by the path of a `.toml` file.

    Raises:
        InputError: if there is no such circuit or its file is wrong.
    """
    return read_track(find_data(name, "circuit", DATA / "circuits"))
