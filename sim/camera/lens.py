"""From the world to the picture. Seen from a camera, x is to the right, y down and z ahead, m."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from nathlon.sim.camera.canvas import Colour, Polygons, keep, shows
from nathlon.sim.camera_spec import MOUNTS, CameraSpec
from nathlon.sim.kernel import lean_inlined
from nathlon.sim.state import CarRecord

NEAR_M = np.float32(0.25)
"""What is nearer is not drawn."""
POSE = 12
"""Numbers of a pose: where something is, then its three axes, in the world's frame."""
PLACE, RIGHT, DOWN, AHEAD = 0, 3, 6, 9
"""Where they begin in the pose of a camera."""
FORWARD, LEFT, UP = 3, 6, 9
"""The same in the pose of a car."""


class Lens(NamedTuple):
    """What the kernels read of a camera.

    Attributes:
        focal_x, focal_y: distance from which the picture is to be seen, pixels.
        middle_x, middle_y: of the picture, pixels.
        width, height: of the picture, pixels.
        forward, above, sine, cosine: of the mount, whose height is `above`; the last two are of its pitch.
        sees_itself: whether its own car is in the picture.
    """

    focal_x: np.float32
    focal_y: np.float32
    middle_x: np.float32
    middle_y: np.float32
    width: int
    height: int
    forward: float
    above: float
    sine: float
    cosine: float
    sees_itself: bool


def lens_of(spec: CameraSpec) -> Lens:
    """The kernels' view of a camera."""
    mount = MOUNTS[spec.mount]
    across, up = spec.focal
    return Lens(
        np.float32(across),
        np.float32(up),
        np.float32(spec.width / 2.0),
        np.float32(spec.height / 2.0),
        spec.width,
        spec.height,
        mount.forward,
        mount.height,
        math.sin(mount.pitch),
        math.cos(mount.pitch),
        mount.sees_itself,
    )


@lean_inlined
def stand(car: CarRecord, pose: np.ndarray) -> None:
    """Set the pose of a car, (POSE,), on the plane of the road under it."""
    length = 1.0 / math.sqrt(1.0 + car.slope_x * car.slope_x)
    ahead_x, ahead_y, ahead_z = car.cos_yaw * length, car.sin_yaw * length, car.slope_x * length
    left_x, left_y, left_z = -car.sin_yaw, car.cos_yaw, car.slope_y
    along = ahead_z * left_z
    left_x, left_y, left_z = left_x - along * ahead_x, left_y - along * ahead_y, left_z - along * ahead_z
    length = 1.0 / math.sqrt(left_x * left_x + left_y * left_y + left_z * left_z)
    left_x, left_y, left_z = left_x * length, left_y * length, left_z * length
    pose[PLACE], pose[PLACE + 1], pose[PLACE + 2] = car.x, car.y, car.z
    pose[FORWARD], pose[FORWARD + 1], pose[FORWARD + 2] = ahead_x, ahead_y, ahead_z
    pose[LEFT], pose[LEFT + 1], pose[LEFT + 2] = left_x, left_y, left_z
    pose[UP] = ahead_y * left_z - ahead_z * left_y
    pose[UP + 1] = ahead_z * left_x - ahead_x * left_z
    pose[UP + 2] = ahead_x * left_y - ahead_y * left_x


@lean_inlined
def aim(body: np.ndarray, lens: Lens, pose: np.ndarray) -> None:
    """Set the pose of a camera, (POSE,), on a car with the pose `body`."""
    for axis in range(3):
        forward, up = body[FORWARD + axis], body[UP + axis]
        pose[PLACE + axis] = body[PLACE + axis] + lens.forward * forward + lens.above * up
        pose[RIGHT + axis] = -body[LEFT + axis]
        pose[AHEAD + axis] = lens.cosine * forward - lens.sine * up
        pose[DOWN + axis] = -lens.sine * forward - lens.cosine * up


@lean_inlined
def add_polygon(
    solid: np.ndarray, count: int, seams: int, colour: Colour, glows: bool, lens: Lens, polygons: Polygons
) -> int:
    """Add what a polygon in space looks like, without what is too near, if that is anything.

    Args:
        solid: (n, 3) float32, its corners as seen from the camera, the first `count` of which count.
        count: at least 3.
        seams: bit i is set where the edge after corner i is a seam.
        colour: packed.
        glows: whether it counts even between the middles of two rows of pixels.
        lens: of the camera.
        polygons: added to.

    Returns:
        how many corners it has.
    """
    place = polygons.number[0]
    xs, ys, kept = polygons.xs[place], polygons.ys[place], polygons.seams[place]
    seen = 0
    for i in range(count):
        x, y, z = solid[i, 0], solid[i, 1], solid[i, 2]
        seam = np.float32(seams >> i & 1)
        if z >= NEAR_M:
            xs[seen] = lens.middle_x + lens.focal_x * x / z
            ys[seen] = lens.middle_y + lens.focal_y * y / z
            kept[seen] = seam
            seen += 1
        j = i + 1 if i + 1 < count else 0
        after = solid[j, 2]
        if (z >= NEAR_M) != (after >= NEAR_M):
            share = (NEAR_M - z) / (after - z)
            x, y = x + share * (solid[j, 0] - x), y + share * (solid[j, 1] - y)
            xs[seen] = lens.middle_x + lens.focal_x * x / NEAR_M
            ys[seen] = lens.middle_y + lens.focal_y * y / NEAR_M
            kept[seen] = seam
            seen += 1
    if seen < 3:
        return 0
    if not (glows or shows(xs, ys, seen, lens.width, lens.height)):
        return 0
    keep(seen, colour, polygons)
    return seen
