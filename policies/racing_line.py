"""The racing line: least curvature first, then least time by the quasi-steady speed profile."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BSpline
from scipy.optimize import minimize
from scipy.sparse import coo_array, csr_array, diags_array, vstack
from scipy.sparse.linalg import spsolve

from policies.envelope import Envelope
from policies.speed_profile import Line, Path, curvature_and_step, path_of, pull_back, time_gradient
from sim.track import LEFT, RIGHT, TANGENT_X, TANGENT_Y, WALL_LEFT, WALL_RIGHT, Track, X, Y

EDGE_MARGIN_M = 1.1
"""From the edge to the racing line. Kerbs would save half a second a lap, but upset the car at times."""
WALL_MARGIN_M = 1.9
"""From a wall: room for a car that slides at an angle."""
RELINEARISATIONS = 5
OUTSIDE_COST = 3.0
"""s / m^3: what a metre of road costs on which the line leaves its room, times its distance squared."""
KNOT_M = 10.0
"""Between the knots of the spline by which a line is moved."""
SMOOTHNESS = 3e5
"""s m^3: what the square of the curvature's change costs beside time, for no car turns in at once."""


def room(track: Track) -> tuple[Line, Line]:
    """How far (m) to the left and to the right of the centre line a driver may go, (rows,) each."""
    table = track.table
    return (
        np.minimum(table[:, LEFT] - EDGE_MARGIN_M, table[:, WALL_LEFT] - WALL_MARGIN_M),
        np.minimum(table[:, RIGHT] - EDGE_MARGIN_M, table[:, WALL_RIGHT] - WALL_MARGIN_M),
    )


def minimum_curvature(track: Track) -> Line:
    """Lateral offsets (rows of the track table,) of the line of least squared curvature, m, + is left.

    Curvature is linear in the offsets where the distances between points are given; these are taken
    from the last line, from the centre line on.
    """
    step = 3
    table = track.table[::step]
    left, right = (side[::step] for side in room(track))
    normal = np.stack([-table[:, TANGENT_Y], table[:, TANGENT_X]], axis=1)
    offset = np.zeros(len(table))
    for _ in range(RELINEARISATIONS):
        points = table[:, [X, Y]] + normal * offset[:, None]
        gap = np.hypot(*(np.roll(points, -1, axis=0) - points).T)
        bend = _curvature_of_points(gap)
        matrix = vstack([bend @ diags_array(normal[:, axis]) for axis in range(2)]).tocsr()
        target = -np.concatenate([bend @ table[:, X], bend @ table[:, Y]])
        offset = 0.5 * (offset + _bounded_least_squares(matrix, target, -right, left))
    rows = np.arange(len(track.table))
    return np.interp(rows, np.append(np.arange(len(table)) * step, len(rows)), np.append(offset, offset[0]))


def _curvature_of_points(gap: Line) -> csr_array:
    """What makes of closed points, one coordinate at a time, their curvature times the root of the way.

    Args:
        gap: (n,) from each point to the next, m.
    """
    n = len(gap)
    before = np.roll(gap, 1)
    way = 0.5 * (gap + before)
    index = np.arange(n)
    rows = np.concatenate([index, index, index])
    columns = np.concatenate([np.roll(index, -1), index, np.roll(index, 1)])
    values = np.concatenate([1.0 / gap, -1.0 / gap - 1.0 / before, 1.0 / before]) / np.tile(np.sqrt(way), 3)
    return coo_array((values, (rows, columns)), shape=(n, n)).tocsr()


def _bounded_least_squares(matrix: csr_array, target: Line, low: Line, high: Line) -> Line:
    """The x within (low, high) of least |matrix x - target|^2, by a primal barrier method."""
    square = (matrix.T @ matrix).tocsc()
    gradient_at_zero = matrix.T @ target
    x = 0.5 * (low + high)
    weight = 1.0
    while weight > 1e-9:
        for _ in range(8):
            to_low, to_high = x - low, high - x
            gradient = square @ x - gradient_at_zero - weight / to_low + weight / to_high
            hessian = square + diags_array(weight / to_low**2 + weight / to_high**2, format="csc")
            move = spsolve(hessian, -gradient)
            with np.errstate(divide="ignore"):
                reach = np.where(move > 0, to_high / move, -to_low / move)
            x = x + min(1.0, 0.95 * reach.min()) * move
            if np.abs(move).max() < 1e-4:
                break
        weight *= 0.2
    return x


def _splines(rows: int, every: int) -> csr_array:
    """Periodic cubic B-splines over the rows of a lap, about `every` rows apart, (rows, splines)."""
    count = rows // every
    knots = np.arange(-3, count + 4) * (rows / count)
    matrix = BSpline.design_matrix(np.arange(rows, dtype=np.float64), knots, 3).tocoo()
    return coo_array((matrix.data, (matrix.row, matrix.col % count)), shape=(rows, count)).tocsr()


def minimum_time(track: Track, limits: Envelope, grip: float, iterations: int = 200) -> Line:
    """Lateral offsets (rows of the track table,) of the line of least quasi-steady lap time, m, + is left.

    Starts from the line of least curvature and moves the coefficients of a spline; leaving the room that
    the road gives costs time. What the road's shape asks of the car is taken from the first line.

    Args:
        track: the circuit.
        limits: of the car.
        grip: share of the tyres' grip to use.
        iterations: of the search at most.
    """
    splines = _splines(len(track.table), round(KNOT_M / track.spacing))
    left, right = room(track)
    start = np.clip(minimum_curvature(track), -right, left)
    road, _ = path_of(track, start)
    held = splines.tocsc()
    fitted = spsolve((held.T @ held).tocsc(), held.T @ start)
    by_curvature, by_step = np.empty(len(start)), np.empty(len(start))

    def cost(coefficients: NDArray[np.float64]) -> tuple[float, NDArray[np.float64]]:
        offset = splines @ coefficients
        curvature, step = curvature_and_step(track, offset)
        path = Path(curvature, step, road.climb, road.camber, road.heave)
        time = time_gradient(path, grip, limits, by_curvature, by_step)
        change = np.roll(curvature, -1) - curvature
        weight = SMOOTHNESS / track.spacing
        uneven = 2 * weight * (np.roll(change, 1) - change)
        gradient = pull_back(track, offset, by_curvature + uneven, by_step)
        outside = np.maximum(offset - left, 0.0) - np.maximum(-right - offset, 0.0)
        price = OUTSIDE_COST * track.spacing
        total = time + weight * float(change @ change) + price * float(outside @ outside)
        return total, splines.T @ (gradient + 2 * price * outside)

    found = minimize(
        cost,
        fitted,
        jac=True,
        method="L-BFGS-B",
        options={"maxiter": iterations, "maxcor": 30},
    )
    line: Line = splines @ found.x
    return line
