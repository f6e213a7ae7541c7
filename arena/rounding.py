"""Numbers that are computed on different ways and are the same: equal within rounding is equal."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

ROUNDING = 1e-12
"""Share of some numbers, or of 1 where they are smaller, by which what is computed of them may err."""


def differing(differences: Floats, scale: Floats | float, rounding: float = ROUNDING) -> Floats:
    """Differences of numbers as large as `scale`; 0 where rounding alone may have made them."""
    alike = np.abs(differences) <= rounding * np.maximum(scale, 1.0)
    return np.where(alike & np.isfinite(differences), 0.0, differences)


def levelled(values: Floats, rounding: float = ROUNDING) -> Floats:
    """Values (n,) of which those that are equal within rounding are equal."""
    if not len(values):
        return values
    order = np.argsort(values, kind="stable")
    ordered = values[order]
    size = np.maximum(np.abs(ordered[1:]), np.abs(ordered[:-1]))
    with np.errstate(invalid="ignore"):
        opens = np.concatenate([[True], differing(np.diff(ordered), size, rounding) != 0])
    level = np.empty_like(values)
    level[order] = ordered[opens][np.cumsum(opens) - 1]
    return level
