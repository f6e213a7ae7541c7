"""Lines that drivers of Assetto Corsa follow: `ai/fast_lane.ai`.

Little-endian: a version, the number of points and two more integers; for each point east, up, south and the
distance (float32) and its number; then the number of points again, and for each 18 float32, the sixth and
seventh of them the distances to the left and right edge.
"""

from __future__ import annotations

import struct

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from nathlon.sim.errors import InputError
from nathlon.sim.track.formats.outline import LARGEST, MOST_POINTS, CircuitLine, known_heights

HEADER, EXTRA, LEFT, RIGHT = 16, 18, 5, 6
NEWEST = 64
POINT = np.dtype([("position", "<f4", 3), ("distance", "<f4"), ("number", "<i4")])
WIDEST_M, SMOOTHED = 15.0, 17
"""The most that counts as road on a side, and over how many points widths are smoothed."""


def is_fast_lane(content: bytes) -> bool:
    """Whether a file begins as such lines do."""
    if len(content) < HEADER:
        return False
    version, points = struct.unpack_from("<ii", content)
    return 0 < version < NEWEST and points > 0 and len(content) >= HEADER + min(points, 2) * POINT.itemsize


def read_fast_lane(content: bytes) -> CircuitLine:
    """Read such a line, moved to the middle of the road where the file knows its edges.

    Raises:
        InputError: if the file ends before its points, or holds what is no number.
    """
    (count,) = struct.unpack_from("<i", content, 4)
    if not 0 < count <= MOST_POINTS:
        raise InputError(f"{count:,} points, expected at most {MOST_POINTS:,}")
    end = HEADER + count * POINT.itemsize
    if len(content) < end:
        raise InputError(f"{len(content):,} bytes, expected {end:,} for {count:,} points")
    with np.errstate(invalid="ignore"):
        east, up, south = np.frombuffer(content, POINT, count, HEADER)["position"].astype(np.float64).T
    line = np.column_stack([east, -south])
    sides = _sides(content, end, count)
    if not (np.abs(np.column_stack([line, up])) < LARGEST).all():
        raise InputError(f"a position that is no number, expected coordinates of less than {LARGEST:g}")
    notes: tuple[str, ...] = ()
    right = left = None
    if sides is not None:
        ahead = np.roll(line, -1, axis=0) - np.roll(line, 1, axis=0)
        ahead /= np.maximum(np.hypot(*ahead.T), 1e-9)[:, None]
        to_left = np.column_stack([-ahead[:, 1], ahead[:, 0]])
        line = line + to_left * ((sides[:, 0] - sides[:, 1]) / 2)[:, None]
        left = right = sides.mean(axis=1)
        notes = ("the line that cars take, moved to the middle between the edges",)
    return CircuitLine(
        "fast_lane.ai of Assetto Corsa",
        line,
        [f"point {number}" for number in range(1, count + 1)],
        right=right,
        left=left,
        height=known_heights(up),
        surveyed=False,
        notes=notes,
    )


def _sides(content: bytes, start: int, count: int) -> NDArray[np.float64] | None:
    """Distances to the left and right edge, (n, 2), m; none where the file has none that can be."""
    if len(content) < start + 4 + count * EXTRA * 4:
        return None
    if struct.unpack_from("<i", content, start)[0] != count:
        return None
    extra = np.frombuffer(content, "<f4", count * EXTRA, start + 4).reshape(count, EXTRA)
    with np.errstate(invalid="ignore"):
        sides = extra[:, [LEFT, RIGHT]].astype(np.float64)
    usable = np.isfinite(sides).all() and (sides >= 0.0).all() and (sides.sum(axis=1) > 1.0).all()
    # Recorded widths jump where pit lanes and exits begin.
    return median_filter(np.minimum(sides, WIDEST_M), (SMOOTHED, 1), mode="wrap") if usable else None
