"""The ground of a circuit from wall to wall, as coloured quadrangles for viewers to draw."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from nathlon.arena.race_log import Outline
from nathlon.sim.camera.scenery import LEFT_WALL, RIGHT_WALL
from nathlon.sim.physics.pit_lane import ASIDE_M
from nathlon.sim.track import SURFACES

ROAD = (62, 63, 68)
KERB = ((200, 45, 50), (232, 232, 232))
"""Stripes, in turn."""
STRIPE_ROWS = 2
LANE_M = ASIDE_M - 2.0, ASIDE_M + 2.0
"""How far beside the road the pit lane begins and ends."""
LANE_ABOVE_M = 0.02
"""Above the run-off, so that it is seen."""
WALLS = {"left": LEFT_WALL, "right": RIGHT_WALL}
"""Panels in turn, so that speed can be seen; sides differ as cameras on cars see them."""
RUNOFF = {"tarmac": (104, 106, 112), "grass": (80, 116, 64), "gravel": (190, 172, 128)}


class Surface(NamedTuple):
    """Ground of one colour (red, green and blue from 0 to 255): quadrangles (n, 4, 3), metres, world frame.

    The corners go round counter-clockwise, seen from above.
    """

    colour: tuple[int, int, int]
    quads: NDArray[np.float64]


def band(left: NDArray[np.float64], right: NDArray[np.float64]) -> NDArray[np.float64]:
    """Quadrangles (n, 4, 3) between two closed lines of n points each, in pairs."""
    return np.stack([left, right, np.roll(right, -1, axis=0), np.roll(left, -1, axis=0)], axis=1)


def mesh(quads: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.uint32]]:
    """Vertices (v, 3), none of them twice, of n quadrangles, and triangles (2n, 3) of vertex indices."""
    vertices, found = np.unique(quads.reshape(-1, 3), axis=0, return_inverse=True)
    corners = found.reshape(-1, 4).astype(np.uint32)
    return vertices, corners[:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3)


def surfaces(outline: Outline) -> dict[str, Surface]:
    """The ground of a circuit by what it is: road, kerbs, run-off and pit lane. None is empty."""
    kerbs, runoff, lanes = [], [], []
    for inner, outer, wall, surface, side in (
        (outline.left, outline.kerb_left, outline.wall_left, outline.runoff_left, 1),
        (outline.right, outline.kerb_right, outline.wall_right, outline.runoff_right, -1),
    ):
        kerbs.append(band(outer, inner)[:, ::side])
        runoff.append((band(wall, outer)[:, ::side], surface))
        near, far = (_beside(inner, outline.centre, away_m) for away_m in LANE_M)
        lanes.append(band(far, near)[outline.lane == side, ::side])
    found = {"road": Surface(ROAD, band(outline.left, outline.right))}
    for stripe, colour in enumerate(KERB):
        drawn = [
            quads[(np.arange(len(quads)) // STRIPE_ROWS % len(KERB) == stripe) & _has_area(quads)]
            for quads in kerbs
        ]
        found[f"kerb_{stripe}"] = Surface(colour, np.concatenate(drawn))
    for name, colour in RUNOFF.items():
        drawn = [quads[surface == SURFACES.index(name)] for quads, surface in runoff]
        found[name] = Surface(colour, np.concatenate(drawn))
    found["pit_lane"] = Surface(ROAD, np.concatenate(lanes))
    return {name: surface for name, surface in found.items() if len(surface.quads)}


def _beside(edge: NDArray[np.float64], centre: NDArray[np.float64], away_m: float) -> NDArray[np.float64]:
    """A line beside an edge of the road, as high as it, some metres farther from the centre line."""
    outwards = (edge - centre)[:, :2]
    outwards = outwards / np.maximum(np.linalg.norm(outwards, axis=1, keepdims=True), 1e-9)
    return np.column_stack([edge[:, :2] + away_m * outwards, edge[:, 2] + LANE_ABOVE_M])


def _has_area(quads: NDArray[np.float64]) -> NDArray[np.bool_]:
    sides = quads[:, [0, 3]] - quads[:, [1, 2]]
    return np.asarray(np.abs(sides).max(axis=(1, 2)) > 0.0)
