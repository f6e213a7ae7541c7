"""Strengths by the model of Bradley and Terry."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.special import expit

Floats = NDArray[np.float64]

STEPS = 200
PRECISION = 1e-12
LONGEST_STEP = 2.0
"""Of log-odds: far from the maximum Newton's step would overshoot."""


def bradley_terry(wins: Floats) -> Floats:
    """The strengths s of the greatest likelihood, where the first beats the second with odds exp(s_1 - s_2).

    By Newton's method: the likelihood is concave (Hunter, The Annals of Statistics 32, 2004). It has a
    maximum where everybody has beaten, over however many others, everybody else: draws see to that.

    Args:
        wins: (n, n) how often the row's has beaten the column's; of a draw each has one half.

    Returns:
        (n,) log-odds, with mean 0.
    """
    met, won = wins + wins.T, wins.sum(axis=1)
    strength = np.zeros(len(wins))
    for _ in range(STEPS):
        expected = expit(strength[:, None] - strength)
        weight = met * expected * expected.T
        # Strengths are known but for a constant, which the mean fixes.
        curvature = np.diag(weight.sum(axis=1)) - weight + 1.0 / len(wins)
        step = np.linalg.solve(curvature, won - (met * expected).sum(axis=1))
        strength += step * min(1.0, LONGEST_STEP / max(float(np.abs(step).max()), PRECISION))
        if np.abs(step).max() < PRECISION:
            break
    return np.asarray(strength - strength.mean())
