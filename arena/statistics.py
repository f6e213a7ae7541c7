"""Bootstrap intervals for means of few observations in groups."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri, stdtrit

Floats = NDArray[np.float64]
Sizes = NDArray[np.int64]  # rows of each group, at least 1; the groups lie one after the other


@dataclass(frozen=True)
class Spread:
    """How far the means of M groups may lie from the truth. NaN where no group has two rows."""

    draws: Floats  # (resamples, M) bootstrap deviations from the observed means
    variance: Floats  # (M,) of the means
    freedom: Floats  # (M,) degrees of freedom of `variance`


def resample_counts(sizes: Sizes, resamples: int, rng: np.random.Generator) -> NDArray[np.int64]:
    """How often each row is drawn when every group is resampled with replacement.

    Returns (resamples, rows).
    """
    return np.concatenate([rng.multinomial(n, np.full(n, 1 / n), size=resamples) for n in sizes], axis=1)


def group_sums(values: NDArray, sizes: Sizes) -> NDArray:
    """Sums of the last axis over consecutive groups."""
    return np.add.reduceat(values, np.cumsum(sizes) - sizes, axis=-1)


def spread(values: Floats, sizes: Sizes, resamples: int, rng: np.random.Generator) -> Spread:
    """Bootstrap the means of consecutive groups of `values` (rows,).

    A bootstrap mean of n rows varies (n - 1) / n as much as the mean itself, so the deviations are
    widened by sqrt(n / (n - 1)). A group of one row shows no spread: it borrows the pooled one of
    the other groups.
    """
    n = sizes.astype(np.float64)
    residuals = values - np.repeat(group_sums(values, sizes) / n, sizes)
    squares = group_sums(residuals**2, sizes)
    deviations = group_sums(resample_counts(sizes, resamples, rng) * residuals, sizes) / n

    alone = n == 1
    freedom = np.where(alone, (n - 1).sum(), n - 1)
    with np.errstate(invalid="ignore"):
        variance = np.where(alone, squares.sum(), squares) / freedom / n
    draws = np.where(
        alone,
        rng.standard_normal(deviations.shape) * np.sqrt(variance),
        deviations * np.sqrt(n / np.maximum(n - 1, 1)),
    )
    return Spread(draws, variance, freedom)


def interval(estimate: Floats, weights: Floats, means: Spread, confidence: float) -> tuple[Floats, Floats]:
    """Confidence intervals of K linear combinations of M group means.

    `estimate` (K,) are the combinations as observed, `weights` (K, M). The bootstrap quantiles are
    stretched from the normal to Student's t with Welch and Satterthwaite's degrees of freedom
    (Hesterberg, The American Statistician 69, 2015): with few rows a plain percentile interval is far
    too short.
    """
    tail = (1 + confidence) / 2
    terms = weights**2 * means.variance
    total = terms.sum(axis=1)
    shares = np.divide(terms, total[:, None], out=np.ones_like(terms), where=total[:, None] > 0)
    freedom = 1 / (shares**2 / means.freedom).sum(axis=1) if np.all(means.freedom) else np.nan
    low, high = np.quantile(means.draws @ weights.T, [1 - tail, tail], axis=0)
    stretch = stdtrit(freedom, tail) / ndtri(tail)
    return estimate + stretch * low, estimate + stretch * high


def tied_ranks(low: Floats, high: Floats) -> NDArray[np.int64]:
    """1 + the number of others whose `low` lies above one's `high`; NaN bounds tie with everything."""
    return 1 + (low[None, :] > high[:, None]).sum(axis=1)
