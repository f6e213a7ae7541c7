"""The ground drawn is the ground there is."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from nathlon.arena.circuit_mesh import mesh, surfaces
from tests.support.race_logs import LAP_M, RADIUS_M, oval_outline


def areas(quads: NDArray[np.float64]) -> NDArray[np.float64]:
    """Signed areas of the triangles on the map, + where their corners go round counter-clockwise."""
    vertices, triangles = mesh(quads)
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    return ((b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])) / 2


def strip_area(inner_m: float, outer_m: float) -> float:
    """Area between two offsets to the left of the oval's centre line, where the bends are narrower."""
    return LAP_M * (outer_m - inner_m) - np.pi * (outer_m**2 - inner_m**2)


@pytest.mark.parametrize(
    ("names", "area"),
    [
        (("road",), strip_area(-6.0, 6.0)),
        (("kerb_0", "kerb_1"), strip_area(6.0, 7.0) / 2),
        (("grass",), strip_area(6.0, 7.0) / 2 + strip_area(7.0, 10.0)),
        (("gravel",), strip_area(-10.0, -6.0)),
        (("pit_lane",), 100.0 * 4.0),
    ],
)
def test_each_surface_covers_its_part_and_faces_up(names: tuple[str, ...], area: float) -> None:
    found = surfaces(oval_outline())
    drawn = np.concatenate([areas(found[name].quads) for name in names])
    assert drawn.min() > -1e-9
    assert drawn.sum() == pytest.approx(area, rel=0.02)


def test_the_pit_lane_lies_beside_the_road_and_is_not_hidden_by_the_ground() -> None:
    outline = oval_outline()
    vertices, _ = mesh(surfaces(outline)["pit_lane"].quads)
    away_m = np.linalg.norm(vertices[:, None, :2] - outline.right[None, :, :2], axis=2).min(axis=1)
    assert away_m.min() == pytest.approx(4.0, abs=0.1)
    assert away_m.max() == pytest.approx(8.0, abs=0.1)
    nearest = np.linalg.norm(vertices[:, None, :2] - outline.right[None, :, :2], axis=2).argmin(axis=1)
    assert (vertices[:, 2] > outline.right[nearest, 2]).all()


def test_only_what_is_there_is_drawn() -> None:
    assert set(surfaces(oval_outline())) == {"road", "kerb_0", "kerb_1", "grass", "gravel", "pit_lane"}


def test_the_road_lies_at_its_height() -> None:
    outline = oval_outline()
    vertices, _ = mesh(surfaces(outline)["road"].quads)
    edges = {tuple(point) for point in np.concatenate([outline.left, outline.right])}
    assert {tuple(point) for point in vertices} == edges
    assert np.ptp(vertices[:, 2]) > 12.0
    assert np.abs(vertices[:, 1]).max() - 6.1 < RADIUS_M
