"""The country around a circuit, as replays show it: it meets the walls and rolls from one to the next."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import Delaunay, cKDTree

from nathlon.arena.race_log import Outline

MARGIN_M = 300.0
GRID_M = 40.0
NEIGHBOURS = 24
"""Points of the walls from which the height of a place in the country is taken."""


def countryside(outline: Outline) -> tuple[NDArray[np.float64], NDArray[np.uint32]]:
    """Vertices (n, 3) in metres and triangles (m, 3) of the land outside of a circuit's walls.

    Places away from the walls are as high as the walls near them, the nearer the more.
    """
    walls = np.concatenate([outline.wall_left, outline.wall_right])
    low, high = walls[:, :2].min(axis=0) - MARGIN_M, walls[:, :2].max(axis=0) + MARGIN_M
    axes = [np.arange(a, b + GRID_M, GRID_M) for a, b in zip(low, high, strict=True)]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)
    grid = grid[~_on_circuit(grid, outline)]
    distance, near = cKDTree(walls[:, :2]).query(grid, min(NEIGHBOURS, len(walls)))
    weight = 1.0 / np.maximum(distance, 1.0) ** 2
    height = (weight * walls[near, 2]).sum(axis=1) / weight.sum(axis=1)
    vertices = np.concatenate([walls, np.column_stack([grid, height])])
    triangles = Delaunay(vertices[:, :2]).simplices
    outside = ~_on_circuit(vertices[triangles, :2].mean(axis=1), outline)
    return vertices, triangles[outside].astype(np.uint32)


def _on_circuit(points: NDArray[np.float64], outline: Outline) -> NDArray[np.bool_]:
    """Whether points (n, 2) lie between the walls, seen from the nearest point of the centre line."""
    _, row = cKDTree(outline.centre[:, :2]).query(points)
    centre = outline.centre[row, :2]
    across = outline.wall_left[row, :2] - centre
    left_m = np.linalg.norm(across, axis=1)
    right_m = np.linalg.norm(outline.wall_right[row, :2] - centre, axis=1)
    lateral = ((points - centre) * across).sum(axis=1) / left_m
    return np.asarray((lateral < left_m) & (lateral > -right_m))
