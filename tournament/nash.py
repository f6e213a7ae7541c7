"""Nash averaging: the mixture of entrants that nobody scores more against (Balduzzi et al., NeurIPS 2018).

Entrants play a symmetric zero-sum game in which one picks who races for it. Of the equilibria the one of
most entropy is unique; copies of an entrant share its weight and change nobody's average.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import linprog, minimize

from nathlon.arena.statistics import Floats

LEAST = 0.005
"""Weights below which an entrant is left out of the mixture: what a solver leaves of 0."""


def nash_weights(payoff: Floats) -> Floats:
    """The mixture (K,) of most entropy that no entrant beats, weights that add up to 1.

    Args:
        payoff: (K, K) by how much the row's entrant scores more than the column's; antisymmetric.

    Raises:
        ValueError: if it is not antisymmetric.
    """
    if not np.allclose(payoff, -payoff.T):
        raise ValueError("payoff is not antisymmetric")
    count = len(payoff)
    scaled = payoff / max(float(np.abs(payoff).max()), 1e-12)
    one = np.ones((1, count))
    start = linprog(np.zeros(count), A_ub=-scaled.T, b_ub=np.zeros(count), A_eq=one, b_eq=[1.0]).x
    found = minimize(
        lambda p: p @ np.log(np.maximum(p, 1e-12)),
        (start + 1e-3) / (1 + 1e-3 * count),
        jac=lambda p: 1 + np.log(np.maximum(p, 1e-12)),
        bounds=[(0.0, 1.0)] * count,
        constraints=[
            {"type": "ineq", "fun": lambda p: scaled.T @ p, "jac": lambda _: scaled.T},
            {"type": "eq", "fun": lambda p: p.sum() - 1.0, "jac": lambda _: one},
        ],
        method="SLSQP",
        options={"maxiter": 500, "ftol": 1e-12},
    )
    weights = np.where(found.x < LEAST, 0.0, found.x)
    return np.asarray(weights / weights.sum())
