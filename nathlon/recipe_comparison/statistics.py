"""What the scores of a recipe's runs say: aggregates over seeds, comparisons, and the best checkpoint.

Aggregates and stratified bootstrap after Agarwal et al., Deep reinforcement learning at the edge of the
statistical precipice (2021): runs are resampled within each task, and the interval is that of percentiles.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy.stats import trim_mean

from nathlon.arena.statistics import Floats

Aggregate = Callable[[Floats], Floats]
"""Of scores (..., runs, tasks) over the last two axes."""


class Estimate(NamedTuple):
    """A figure and the bounds of its interval; NaN where there is one run alone."""

    value: float
    low: float
    high: float


def mean(scores: Floats) -> Floats:
    """Mean over runs and tasks."""
    return np.asarray(scores.mean(axis=(-2, -1)))


def interquartile_mean(scores: Floats) -> Floats:
    """Mean of the middle half of all scores, which no single run of luck or failure moves far."""
    flat = scores.reshape(*scores.shape[:-2], -1)
    return np.asarray(trim_mean(flat, 0.25, axis=-1))


def optimality_gap(target: float) -> Aggregate:
    """By how much runs fall short of a target, on average; what lies above it does not make up for it."""
    return lambda scores: np.asarray(np.maximum(target - scores, 0.0).mean(axis=(-2, -1)))


def estimate(
    scores: Floats, aggregate: Aggregate, rng: np.random.Generator, resamples: int, confidence: float
) -> Estimate:
    """An aggregate of scores (runs, tasks) with its interval."""
    value = float(aggregate(scores))
    if len(scores) < 2:
        return Estimate(value, np.nan, np.nan)
    return Estimate(value, *_bounds(aggregate(_resampled(scores, resamples, rng)), confidence))


def probability_of_improvement(
    scores: Floats, others: Floats, rng: np.random.Generator, resamples: int, confidence: float
) -> Estimate:
    """How likely a run of the one (runs, tasks) scores more than a run of the other (runs, tasks).

    The mean over tasks of Mann and Whitney's statistic; ties count half.
    """
    value = float(_improvement(scores, others))
    if min(len(scores), len(others)) < 2:
        return Estimate(value, np.nan, np.nan)
    drawn = _improvement(_resampled(scores, resamples, rng), _resampled(others, resamples, rng))
    return Estimate(value, *_bounds(drawn, confidence))


def shrunk(values: Floats, errors: Floats) -> Floats:
    """Values (N,) with their standard errors, drawn to their mean by as much of their spread as is noise.

    The best of many is the one that was also lucky: this is what it may be expected to score again (empirical
    Bayes with a normal prior; Efron and Morris, J. Am. Stat. Assoc. 70, 1975, with unequal errors).
    """
    if len(values) < 2:
        return values
    noise = errors**2
    spread = max(float(values.var(ddof=1) - noise.mean()), 0.0)
    if spread == 0.0:
        return np.full(len(values), values.mean())
    weights = 1 / (spread + noise)
    middle = float(weights @ values / weights.sum())
    return np.asarray(middle + spread / (spread + noise) * (values - middle))


def _improvement(scores: Floats, others: Floats) -> Floats:
    gaps = scores[..., :, None, :] - others[..., None, :, :]
    return np.asarray(((gaps > 0) + 0.5 * (gaps == 0)).mean(axis=(-3, -2, -1)))


def _resampled(scores: Floats, resamples: int, rng: np.random.Generator) -> Floats:
    """(resamples, runs, tasks) scores, runs drawn with replacement in each task by itself."""
    runs, tasks = scores.shape
    drawn = rng.integers(runs, size=(resamples, runs, tasks))
    return np.asarray(scores[drawn, np.arange(tasks)])


def _bounds(drawn: Floats, confidence: float) -> tuple[float, float]:
    low, high = np.quantile(drawn, [(1 - confidence) / 2, (1 + confidence) / 2])
    return float(low), float(high)
