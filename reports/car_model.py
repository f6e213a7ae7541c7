"""The shape of a car in replays: a low-poly coupé, shaded face by face."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

WINDOWS = (28, 32, 40)
TYRES = (18, 18, 18)
LIGHTS = (190, 20, 30)

# The corners of a block: bottom then top, each counter-clockwise from rear right.
FACES = np.array(
    [[4, 5, 6, 7], [0, 3, 2, 1], [1, 2, 6, 5], [3, 0, 4, 7], [2, 3, 7, 6], [0, 1, 5, 4]]
)  # top, bottom, front, rear, left, right
SHADES = np.array([1.0, 0.4, 0.75, 0.7, 0.85, 0.85])


def car_model(
    length_m: float, width_m: float, colour: tuple[int, int, int]
) -> tuple[NDArray[np.float32], NDArray[np.uint32], NDArray[np.uint8]]:
    """Vertices (n, 3) in metres, triangles (m, 3) and vertex colours (n, 3) in the car's frame.

    x is forward, y left and z up from the road; the origin lies below the car's centre.
    """
    half, side = length_m / 2, width_m / 2
    blocks = [
        _block((-half, half), (-0.97 * half, 0.90 * half), (side, 0.94 * side), (0.22, 0.62), colour),
        _block(
            (-0.97 * half, 0.90 * half),
            (-0.92 * half, 0.35 * half),
            (0.94 * side, 0.84 * side),
            (0.62, 0.80),
            colour,
        ),
        _block(
            (-0.80 * half, 0.35 * half),
            (-0.42 * half, -0.02 * half),
            (0.82 * side, 0.64 * side),
            (0.80, 1.18),
            WINDOWS,
        ),
        _block(
            (-0.44 * half, 0.0),
            (-0.42 * half, -0.02 * half),
            (0.65 * side, 0.63 * side),
            (1.18, 1.24),
            colour,
        ),
        _block((-half, -0.86 * half), (-half, -0.86 * half), (0.96 * side, 0.96 * side), (1.08, 1.14), TYRES),
    ]
    for y in (-0.7 * side, 0.7 * side):
        corners, colours = _block((-0.02, 0.0), (-0.02, 0.0), (0.22, 0.22), (0.44, 0.56), LIGHTS)
        blocks.append((corners + np.array([-0.99 * half, y, 0.0]), colours))
    for x in (-0.62 * half, 0.62 * half):
        for y in (0.16 - side, side - 0.16):
            corners, colours = _block(
                (x - 0.34, x + 0.34), (x - 0.30, x + 0.30), (0.16, 0.16), (0.0, 0.66), TYRES
            )
            blocks.append((corners + np.array([0.0, y, 0.0]), colours))
    vertices = np.concatenate([corners for corners, _ in blocks]).astype(np.float32)
    colours = np.concatenate([colours for _, colours in blocks])
    quads = np.arange(len(vertices)).reshape(-1, 4)
    triangles = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]).astype(np.uint32)
    return vertices, triangles, colours


def _block(
    bottom_x: tuple[float, float],
    top_x: tuple[float, float],
    half_widths: tuple[float, float],
    z: tuple[float, float],
    colour: tuple[int, int, int],
) -> tuple[NDArray[np.float64], NDArray[np.uint8]]:
    """Four vertices a face (24, 3) and their colours of a block whose top and bottom may differ in size."""
    corners = np.array(
        [
            [x, y, height]
            for (rear, front), half_width, height in zip((bottom_x, top_x), half_widths, z, strict=True)
            for x, y in ((rear, -half_width), (front, -half_width), (front, half_width), (rear, half_width))
        ]
    )
    shades = np.repeat(SHADES, 4)[:, None] * np.array(colour)
    return corners[FACES.ravel()], shades.astype(np.uint8)
