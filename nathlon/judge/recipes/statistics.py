"""What the scores of a recipe's runs say: aggregates over seeds, comparisons, and the best checkpoint.

Aggregates after Agarwal et al., Deep reinforcement learning at the edge of the statistical precipice (2021).
Their bootstrap resamples runs in each task by itself. Here one training run meets all tasks, the references,
and is good or bad against them all: runs are resampled whole, and intervals widened for few of them.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import combinations
from math import comb
from typing import NamedTuple

import numpy as np
from scipy.special import ndtri, stdtrit
from scipy.stats import trim_mean

from nathlon.arena.statistics import Floats

Aggregate = Callable[[Floats], Floats]
"""Of scores (..., runs, tasks) over the last two axes."""


class Estimate(NamedTuple):
    """A figure and the bounds of its interval; NaN where they are not known, as with one run alone."""

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
    drawn = aggregate(_resampled(scores, resamples, rng))
    return Estimate(value, *_bounds(value, drawn, len(scores), confidence))


def probability_of_improvement(
    scores: Floats, others: Floats, rng: np.random.Generator, resamples: int, confidence: float
) -> Estimate:
    """How likely a run of the one (runs, tasks) scores more than a run of the other (runs, tasks).

    The mean over tasks of Mann and Whitney's statistic; ties count half. Its interval is that of Brunner and
    Munzel (Biometrical Journal 42, 2000). It excludes one half only where a permutation test over whole runs
    does too, which errs no more often than it says however few runs there are: of a few, all of the one may
    well beat all of the other by chance.
    """
    beaten = _beaten(np.concatenate([scores, others]))
    runs, more = len(scores), len(others)
    placed = beaten[:runs, runs:]
    value = float(placed.mean())
    if min(runs, more) < 2:
        return Estimate(value, np.nan, np.nan)
    terms = [placed.mean(axis=1 - side).var(ddof=1) / n for side, n in enumerate((runs, more))]
    freedom = sum(terms) ** 2 / max(terms[0] ** 2 / (runs - 1) + terms[1] ** 2 / (more - 1), 1e-300)
    half = float(stdtrit(max(freedom, 1.0), (1 + confidence) / 2) * np.sqrt(sum(terms)))
    low, high = max(value - half, 0.0), min(value + half, 1.0)
    if _permuted(beaten, runs, rng, resamples) > 1 - confidence:
        low, high = min(low, 0.5), max(high, 0.5)
    return Estimate(value, low, high)


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


def _beaten(scores: Floats) -> Floats:
    """(runs, runs) in which share of the tasks the one scores more than the other; ties count half."""
    gaps = scores[:, None, :] - scores[None, :, :]
    return np.asarray(((gaps > 0) + 0.5 * (gaps == 0)).mean(axis=-1))


def _permuted(beaten: Floats, runs: int, rng: np.random.Generator, resamples: int) -> float:
    """Two-sided p-value that the first `runs` are like the others.

    All ways to deal the runs are gone through, or `resamples` drawn ones if there are more.
    """
    total = len(beaten)
    if comb(total, runs) <= resamples:
        dealt = np.array(list(combinations(range(total), runs)))
    else:
        drawn = rng.permuted(np.tile(np.arange(total), (resamples, 1)), axis=1)[:, :runs]
        dealt = np.concatenate([np.arange(runs)[None], drawn])
    ours = np.zeros((len(dealt), total))
    np.put_along_axis(ours, dealt, 1.0, axis=1)
    shares = ((ours @ beaten) * (1 - ours)).sum(axis=1) / (runs * (total - runs))
    seen = abs(beaten[:runs, runs:].mean() - 0.5)
    return float((np.abs(shares - 0.5) >= seen - 1e-9).mean())


def _resampled(scores: Floats, resamples: int, rng: np.random.Generator) -> Floats:
    """(resamples, runs, tasks) scores, whole runs drawn with replacement."""
    return np.asarray(scores[rng.integers(len(scores), size=(resamples, len(scores)))])


def _bounds(value: float, drawn: Floats, runs: int, confidence: float) -> tuple[float, float]:
    """Percentiles about a value, widened for few runs as those of `nathlon.arena.statistics` are."""
    tail = (1 + confidence) / 2
    wider = np.sqrt(runs / (runs - 1)) * stdtrit(runs - 1, tail) / ndtri(tail)
    low, high = value + wider * (np.quantile(drawn, [1 - tail, tail]) - value)
    return float(low), float(high)
