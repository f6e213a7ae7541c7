"""Advantages without critics: of cars that set out from the same moment and chose differently.

What an action brings is told by the return that follows it, less what was to be expected. That is the mean
over the group that left the same start, as in GRPO (Shao et al., 2024), here at each step of its way; and as
the group drifts apart, a hyperplane over how each car moves takes the place of the mean. It needs no critic,
and tells apart actions that are worth a thousandth of what critics err by.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

OUTLYING = 300.0
"""Spreads of returns beyond which a return or a charge counts no more; ten would make a spin cheap."""
AFAR = 6.0
"""The same of motion, where a plane is fitted."""
RIDGE = 1e-3

Array = NDArray[np.float64]


def discounted(rewards: Array, discount: float) -> Array:
    """Returns (steps, ..) of rewards (steps, ..): each and all that follow, discounted by step."""
    returns = np.empty_like(rewards)
    later = np.zeros(rewards.shape[1:])
    for step in reversed(range(len(rewards))):
        later = returns[step] = rewards[step] + discount * later
    return returns


def advantages(returns: Array, charges: Array, motion: Array) -> Array:
    """By how much returns differ from what is usual in their group for cars that move so.

    Args:
        returns: (.., group).
        charges: (.., group), returns that motion does not foretell: their mean is what is usual.
        motion: (.., group, quantities), in any units.

    Returns:
        (.., group).
    """
    excess, spread = _from_median(returns, axis=-1)
    excess = np.clip(excess, -OUTLYING * spread, OUTLYING * spread)
    charges = np.clip(charges, -OUTLYING * spread, OUTLYING * spread)
    plane, spread = _from_median(motion, axis=-2)
    plane = np.clip(plane / np.maximum(spread, np.finfo(np.float64).tiny), -AFAR, AFAR)
    plane = np.concatenate([plane, np.ones((*plane.shape[:-1], 1))], axis=-1)
    across = np.swapaxes(plane, -1, -2)
    squares = across @ plane + RIDGE * plane.shape[-2] * np.eye(plane.shape[-1])
    usual = plane @ np.linalg.solve(squares, across @ excess[..., None])
    return excess - usual[..., 0] + charges - charges.mean(axis=-1, keepdims=True)


def _from_median(values: Array, axis: int) -> tuple[Array, Array]:
    """Distances from the median, and the spread: 1.5 times the median distance, about one deviation."""
    distances = values - np.median(values, axis=axis, keepdims=True)
    return distances, 1.5 * np.median(np.abs(distances), axis=axis, keepdims=True)
