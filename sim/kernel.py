"""How the world's functions are compiled: one setting for all of them.

Divisions are unchecked and may become products with a reciprocal; nan keeps its meaning, since it
marks a lap that was not driven. The order of sums is kept, so that results do not depend on how
races are batched.
"""

from typing import Any

from numba import njit

OPTIONS: dict[str, Any] = {
    "nogil": True,
    "cache": True,
    "error_model": "numpy",
    "fastmath": {"contract", "arcp", "nsz"},
}

kernel = njit(**OPTIONS)
"""For functions that Python calls."""

inlined = njit(**OPTIONS, forceinline=True)
"""For functions that kernels call. A call would hand over every number of the car's parameters by
value, which costs about as much as the arithmetic."""
