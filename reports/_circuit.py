"""The circuit of a replay: in space, and on the map."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, Protocol

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from nathlon.arena.circuit_mesh import RUNOFF, WALLS, band, mesh, surfaces
from nathlon.arena.race_log import Outline
from nathlon.reports._countryside import countryside

WALL_HEIGHT_M = 0.9
PANEL_ROWS = 2
ZONE_COLOUR = (242, 177, 52)
"""Where penalties are served."""
PAINT_M = 0.03
"""Height of painted lines above the road, so that they are seen."""


class Logging(Protocol):
    """Where entities are logged: a Rerun stream, or a part of one."""

    def log(self, entity_path: str, entity: Any, *extra: Any, static: bool = False) -> None:
        """Log something now or for ever."""

    def send_columns(self, entity_path: str, indexes: Iterable[Any], columns: Iterable[Any]) -> None:
        """Log something for many times."""


def log_circuit(stream: Logging, outline: Outline) -> None:
    """Draw the ground, painted lines, walls and the country around in the world's frame."""
    stream.log("world", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    vertices, triangles = countryside(outline)
    country = rr.Mesh3D(
        vertex_positions=vertices, triangle_indices=triangles, albedo_factor=_darker(RUNOFF["grass"])
    )
    stream.log("world/circuit/country", country, static=True)
    for name, (colour, quads) in surfaces(outline).items():
        stream.log(f"world/circuit/{name}", _mesh(quads, colour), static=True)
    edges = [_raised(_closed(edge), PAINT_M) for edge in (outline.left, outline.right)]
    stream.log("world/circuit/edges", rr.LineStrips3D(edges, radii=0.12, colors=[240, 240, 240]), static=True)
    if outline.zone.any():
        zones = [
            _raised(strip, 2 * PAINT_M)
            for edge in (outline.left, outline.right)
            for strip in _zones(edge, outline)
        ]
        paint = rr.LineStrips3D(zones, radii=0.25, colors=ZONE_COLOUR)
        stream.log("world/circuit/zones", paint, static=True)
    line = _raised(np.stack([outline.left[0], outline.right[0]]), PAINT_M)
    stream.log("world/circuit/line", rr.LineStrips3D([line], radii=0.4, colors=[255, 255, 255]), static=True)
    for side, foot in (("left", outline.wall_left), ("right", outline.wall_right)):
        quads = band(_raised(foot, WALL_HEIGHT_M), foot)
        for panel, colour in enumerate(WALLS[side]):
            mine = np.arange(len(quads)) // PANEL_ROWS % len(WALLS[side]) == panel
            stream.log(f"world/circuit/wall_{side}/{panel}", _mesh(quads[mine], colour), static=True)


def log_map(stream: Logging, outline: Outline) -> None:
    """Draw the road from above."""
    half_width_m = float(np.mean(np.linalg.norm(outline.left - outline.right, axis=1))) / 2
    surface = rr.LineStrips2D([north_up(_closed(outline.centre))], radii=half_width_m, colors=[70, 72, 78])
    stream.log("map/circuit/asphalt", surface, static=True)
    edges = [north_up(_closed(edge)) for edge in (outline.left, outline.right)]
    stream.log("map/circuit/edges", rr.LineStrips2D(edges, radii=-0.75, colors=[190, 190, 190]), static=True)
    if outline.zone.any():
        zones = [north_up(strip) for strip in _zones(outline.centre, outline)]
        paint = rr.LineStrips2D(zones, radii=-2.0, colors=ZONE_COLOUR)
        stream.log("map/circuit/zones", paint, static=True)
    line = north_up(np.stack([outline.left[0], outline.right[0]]))
    stream.log("map/circuit/line", rr.LineStrips2D([line], radii=-1.5, colors=[255, 255, 255]), static=True)


def north_up(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Points (n, 2) or (n, 3) of the world on a map (n, 2), whose y points down the screen."""
    return points[:, :2] * np.array([1.0, -1.0])


def _zones(line: NDArray[np.float64], outline: Outline) -> NDArray[np.float64]:
    """Stretches (n, 2, 3) of a line of the circuit on which penalties are served, from row to row."""
    return np.stack([line, np.roll(line, -1, axis=0)], axis=1)[outline.zone]


def _mesh(quads: NDArray[np.float64], colour: tuple[int, int, int]) -> rr.Mesh3D:
    vertices, triangles = mesh(quads)
    return rr.Mesh3D(vertex_positions=vertices, triangle_indices=triangles, albedo_factor=colour)


def _darker(colour: tuple[int, int, int]) -> tuple[int, ...]:
    return tuple(round(0.85 * part) for part in colour)


def _raised(points: NDArray[np.float64], above_m: float) -> NDArray[np.float64]:
    return points + np.array([0.0, 0.0, above_m])


def _closed(line: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.concatenate([line, line[:1]])
