"""How much of the road's width a car's line may use: as far as tyres, kerbs and walls allow."""

from __future__ import annotations

import numpy as np
import scipy

from nathlon.policies.driver.speed_profile import Line, path_of
from nathlon.sim.track import CURVATURE, KERB_LEFT, KERB_RIGHT, LEFT, RIGHT, WALL_LEFT, WALL_RIGHT, Track

KERB_MARGIN_M = 0.95
"""From the far side of the kerbs to the racing line: the tyres stay on road and kerbs."""
WALL_MARGIN_M = 1.6
WALL_CLEAR_M, HALF_LENGTH_M, HALF_WIDTH_M = 0.4, 2.35, 1.0
"""From a wall to the corners of the car, which reach further where the racing line runs askew to the road."""
EDGE_MARGIN_M = 1.1
WALL_MARGIN_ASIDE_M = 1.9
"""From the edge of the road and from a wall, for a car off the racing line."""
AROUND_M = 4.0
"""To either side of a place that lacks room, it becomes less."""
EDGES = (LEFT, KERB_LEFT), (RIGHT, KERB_RIGHT)


def room(track: Track) -> tuple[Line, Line]:
    """How far (m) to the left and to the right of the centre line the racing line may go, (rows,) each."""
    left, right = (track.table[:, [edge, kerb]].sum(axis=1) for edge, kerb in EDGES)
    return _within(track, left - KERB_MARGIN_M, right - KERB_MARGIN_M, WALL_MARGIN_M)


def room_aside(track: Track) -> tuple[Line, Line]:
    """How far (m) a driver may go that makes way for others, where it has not practised, (rows,) each."""
    left, right = (track.table[:, edge] for edge, _ in EDGES)
    return _within(track, left - EDGE_MARGIN_M, right - EDGE_MARGIN_M, WALL_MARGIN_ASIDE_M)


def _within(track: Track, left: Line, right: Line, from_wall: float) -> tuple[Line, Line]:
    walls = track.table[:, [WALL_LEFT, WALL_RIGHT]] - from_wall
    return np.minimum(left, walls[:, 0]), np.minimum(right, walls[:, 1])


def lacking(track: Track, offset: Line) -> tuple[Line, Line]:
    """How far (m) the car's corners on a line come too near the walls to the left and right, (rows,) each.

    They are where `nathlon.sim.physics.course.meet_walls` takes them to be.
    """
    _, heading = path_of(track, offset)
    sine, cosine = np.sin(heading), np.cos(heading)
    left, right = np.zeros((2, len(offset)))
    for x in (HALF_LENGTH_M, -HALF_LENGTH_M):
        for y in (HALF_WIDTH_M, -HALF_WIDTH_M):
            ahead = x * cosine - y * sine
            lateral = offset + x * sine + y * cosine - 0.5 * track.table[:, CURVATURE] * ahead**2
            left = np.maximum(left, lateral - track.table[:, WALL_LEFT] + WALL_CLEAR_M)
            right = np.maximum(right, -lateral - track.table[:, WALL_RIGHT] + WALL_CLEAR_M)
    return left, right


def less(track: Track, space: Line, missing: Line) -> Line:
    """Room (m) without what is lacking around each row, half of it left in any case, (rows,)."""
    around = 2 * round(AROUND_M / track.spacing) + 1
    left: Line = space - np.minimum(scipy.ndimage.maximum_filter1d(missing, around, mode="wrap"), 0.5 * space)
    return left
