"""Circuits without end: a seed gives a circuit, always the same.

An alignment of straights, clothoids and arcs is drawn in a style; heights follow from hilly ground; and
what stands beside the road from its shape, as of imported circuits.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from nathlon.sim.errors import InputError
from nathlon.sim.track import Track, build_track
from nathlon.sim.track.alignment import Clothoid, sample, straight
from nathlon.sim.track.circuit_folder import DIGITS, Circuit, new_folder, write_circuit
from nathlon.sim.track.drawn_alignment import draw_alignment
from nathlon.sim.track.layout import (
    PLACE_SPACING_M,
    PLACES,
    POLE_M,
    ROWS_PER_POINT,
    Road,
    Roadside,
    edges_cross,
    lay_out,
)
from nathlon.sim.track.relief import draw_bank, draw_heights, draw_width
from nathlon.sim.track.styles import STYLES, Style

LENGTH_M = (1500.0, 10_000.0)
TRIES = 5000
GRID_M = PLACES * PLACE_SPACING_M - POLE_M
BETWEEN_M = 2.0
"""Between the walls of neighbouring parts of the lap."""
BEHIND_LINE = 0.55
"""Most of the first straight that lies behind the line, as a share."""


def generate_circuit(seed: int, style: str = "grand-prix", length: float | None = None) -> Circuit:
    """The circuit of a seed; the same one each time.

    Args:
        seed: not negative.
        style: one of `nathlon.sim.track.styles.STYLES`.
        length: of the lap, m; drawn in the style where none is given.

    Raises:
        InputError: if there is no such style, or the length is out of range or too short for its bends.
    """
    if style not in STYLES:
        raise InputError(f"--style: {style!r}, expected one of {', '.join(STYLES)}")
    if length is not None and not LENGTH_M[0] <= length <= LENGTH_M[1]:
        raise InputError(
            f"--length: {length:g}, expected a lap of {LENGTH_M[0]:,g} to {LENGTH_M[1]:,g} metres"
        )
    kind, rng = STYLES[style], np.random.default_rng(seed)
    lap = length or float(rng.uniform(*kind.length_m))
    lap = ROWS_PER_POINT * round(lap / ROWS_PER_POINT)
    return _laid_out(f"{style}-{seed}", _draw_road(kind, lap, seed, rng), kind, rng)


def generate_track(seed: int, style: str = "grand-prix", length: float | None = None) -> Track:
    """The circuit of a seed ready to drive on, without files; see `generate_circuit`."""
    circuit = generate_circuit(seed, style, length)
    return build_track(circuit.points, circuit.facts)


def write_generated(folder: Path, seed: int, style: str = "grand-prix", length: float | None = None) -> Path:
    """Write the circuit of a seed as the folder `folder/STYLE-SEED`; see `generate_circuit`.

    Returns:
        the path of the circuit's TOML file.

    Raises:
        InputError: also if the folder is there already, or cannot be written.
    """
    target = new_folder(folder, f"{style}-{seed}")
    return write_circuit(target, generate_circuit(seed, style, length), f"Generated: {style}, seed {seed}.")


def _draw_road(style: Style, lap: float, seed: int, rng: np.random.Generator) -> Road:
    """The first road drawn that does not meet itself."""
    width = rng.uniform(*style.width_m)
    apart = width + 2.0 * style.roadside.runoff_m + BETWEEN_M
    for _ in range(TRIES):
        alignment = draw_alignment(style, lap, apart, rng)
        if alignment is None:
            continue
        road = _road(_from_the_line(alignment, rng), lap, width, rng)
        if edges_cross(road) is None:
            return road
    raise InputError(
        f"--seed {seed}: no lap of {lap:,.0f} m closed in {TRIES:,} tries, expected another seed or length"
    )


def _from_the_line(alignment: list[Clothoid], rng: np.random.Generator) -> list[Clothoid]:
    """The lap from the start line on; the grid stands on the first straight too."""
    whole = alignment[0].length
    behind = rng.uniform(GRID_M, max(GRID_M, BEHIND_LINE * whole))
    return [straight(whole - behind), *alignment[1:], straight(behind)]


def _road(pieces: list[Clothoid], lap: float, width: float, rng: np.random.Generator) -> Road:
    rows = round(lap)
    position, heading, curvature = sample(pieces, np.arange(rows, dtype=np.float64))
    north = rng.uniform(0.0, 2.0 * np.pi)
    turned = np.array([[np.cos(north), np.sin(north)], [-np.sin(north), np.cos(north)]])
    return Road(
        position=position @ turned,
        tangent=np.stack([np.cos(heading + north), np.sin(heading + north)], axis=1),
        curvature=curvature,
        right=draw_width(rows, 1.0, width, rng),
        left=draw_width(rows, 1.0, width, rng),
        spacing=1.0,
    )


def _laid_out(name: str, road: Road, style: Style, rng: np.random.Generator) -> Circuit:
    height = draw_heights(road.position, road.curvature, 1.0, rng.uniform(*style.relief_m), rng)
    bank = draw_bank(road.curvature, 1.0, style, rng)
    profile = f"{np.ptp(height):.0f} m from its lowest to its highest place"
    facts, wall_right, wall_left = lay_out(road, name, profile, _draw_roadside(style, rng))
    table = np.column_stack([road.position, height, road.right, road.left, bank, wall_right, wall_left])
    written = [column.round(digits) for column, digits in zip(table[::ROWS_PER_POINT].T, DIGITS, strict=True)]
    return Circuit(facts, np.stack(written, axis=1) + 0.0)  # no negative zeros


def _draw_roadside(style: Style, rng: np.random.Generator) -> Roadside:
    beside = style.roadside
    surface = style.runoffs[rng.integers(len(style.runoffs))]
    return beside._replace(
        runoff_m=beside.runoff_m * rng.uniform(0.8, 1.3),
        bend_runoff_m=beside.bend_runoff_m * rng.uniform(0.7, 1.3),
        gravel_m=np.inf if surface == "tarmac" else beside.gravel_m,
        surface=surface,
    )
