"""The magic formula's curve, kept as a table of cubic polynomials.

A tyre's force grows with its combined slip k, normalised so that the peak stands at 1, as
sin(C atan(B k)) with B = tan(pi / 2C). What the kernels need is that over k, for which a table is a
few times faster than the functions and as good as them to 1e-8.
"""

from __future__ import annotations

import numpy as np
import scipy
from numpy.typing import NDArray

CELLS = 256


def curve_cells(shape: float) -> NDArray[np.float64]:
    """Polynomials in each of CELLS cells of k / (1 + k) in [0, 1).

    Args:
        shape: the shape factor C of the magic formula.

    Returns:
        (CELLS, 4) float64, coefficients of rising powers of the share of the cell.
    """
    stiffness = np.tan(np.pi / (2 * shape))
    knots = np.linspace(0.0, 1.0, CELLS + 1)
    slip = knots[1:-1] / (1.0 - knots[1:-1])
    values = np.concatenate([[shape * stiffness], np.sin(shape * np.arctan(stiffness * slip)) / slip, [0.0]])
    spline = scipy.interpolate.CubicSpline(knots, values)
    return np.ascontiguousarray(spline.c[::-1].T * (1.0 / CELLS) ** np.arange(4))
