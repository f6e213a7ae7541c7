"""A race's circuit and cars in Foxglove's schema for scenes (https://docs.foxglove.dev/docs/sdk/schemas)."""

from __future__ import annotations

from functools import lru_cache
from typing import TypeVar

import numpy as np
from foxglove_schemas_protobuf.Color_pb2 import Color
from foxglove_schemas_protobuf.CubePrimitive_pb2 import CubePrimitive
from foxglove_schemas_protobuf.LinePrimitive_pb2 import LinePrimitive
from foxglove_schemas_protobuf.Pose_pb2 import Pose
from foxglove_schemas_protobuf.Quaternion_pb2 import Quaternion
from foxglove_schemas_protobuf.SceneEntity_pb2 import SceneEntity
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate
from foxglove_schemas_protobuf.TriangleListPrimitive_pb2 import TriangleListPrimitive
from foxglove_schemas_protobuf.Vector3_pb2 import Vector3
from numpy.typing import NDArray

from nathlon.arena.circuit_mesh import WALLS, mesh, surfaces
from nathlon.arena.protobuf_rows import encode
from nathlon.arena.race_log import Outline, RaceLog

Drawn = TypeVar("Drawn", LinePrimitive, TriangleListPrimitive)

CAR_HEIGHT_M = 1.25
TEAM_COLOURS: dict[int, tuple[int, int, int]] = {0: (51, 136, 238), 1: (245, 130, 32), -1: (190, 190, 190)}
"""Red, green and blue from 0 to 255, by team; -1 is a car without a team."""


def scene(log: RaceLog) -> SceneUpdate:
    """The circuit in the world's frame and every car as a box in its own, drawn for the whole race."""
    box = Pose(position=Vector3(z=CAR_HEIGHT_M / 2), orientation=Quaternion(w=1.0))
    size = Vector3(x=log.car_length_m, y=log.car_width_m, z=CAR_HEIGHT_M)
    cars = [
        SceneEntity(
            frame_id=f"car_{i}",
            id=f"car_{i}",
            frame_locked=True,
            cubes=[CubePrimitive(pose=box, size=size, color=_colour(*TEAM_COLOURS[team]))],
        )
        for i, team in enumerate(log.teams)
    ]
    return SceneUpdate(entities=[_circuit(log.outline), *cars])


@lru_cache(maxsize=2)
def _circuit(outline: Outline) -> SceneEntity:
    """Kept, since the races of a match share their outline."""
    here = Pose(orientation=Quaternion(w=1.0))
    ground = []
    for colour, quads in surfaces(outline).values():
        vertices, triangles = mesh(quads)
        primitive = TriangleListPrimitive(
            pose=here, indices=triangles.ravel().tolist(), color=_colour(*colour)
        )
        ground.append(_with_points(primitive, vertices, 0.0))
    lines = [
        _with_points(
            LinePrimitive(type=LinePrimitive.LINE_LOOP, pose=here, thickness=width_m, color=shade),
            line,
            above_m,
        )
        for line, above_m, width_m, shade in (
            (outline.left, 0.02, 0.3, _colour(235, 235, 235)),
            (outline.right, 0.02, 0.3, _colour(235, 235, 235)),
            (outline.wall_left, 0.5, 0.3, _colour(*WALLS["left"][0])),
            (outline.wall_right, 0.5, 0.3, _colour(*WALLS["right"][0])),
        )
    ]
    return SceneEntity(frame_id="world", id="circuit", triangles=ground, lines=lines)


def _with_points(primitive: Drawn, points: NDArray[np.float64], above_m: float) -> Drawn:
    """The primitive through points (n, 3), raised and encoded at once."""
    x, y, z = points.T
    primitive.MergeFromString(
        encode(primitive.DESCRIPTOR, {"points": {"x": x, "y": y, "z": z + above_m}}, len(points)).tobytes()
    )
    return primitive


def _colour(red: int, green: int, blue: int) -> Color:
    return Color(r=red / 255, g=green / 255, b=blue / 255, a=1.0)
