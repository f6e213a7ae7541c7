"""How the world's functions are compiled: one setting for all of them."""

from numba import njit

kernel = njit(nogil=True, cache=True, error_model="numpy", fastmath={"contract", "arcp", "nsz"})
"""Divisions are unchecked and may become products with a reciprocal; nan keeps its meaning, since
it marks a lap that was not driven. The order of sums is kept, so that results do not depend on how
races are batched."""
