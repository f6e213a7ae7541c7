"""Intervals and comparisons for means of few observations in groups."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri, stdtr, stdtrit

from nathlon.arena.rounding import differing

Floats = NDArray[np.float64]
Sizes = NDArray[np.int64]  # rows of each group, at least 1; the groups lie one after the other


@dataclass(frozen=True)
class Precision:
    """How well the means of M groups are known. NaN where no group has two rows."""

    variance: Floats  # (M,) of the means
    freedom: Floats  # (M,) degrees of freedom of `variance`


@dataclass(frozen=True)
class Spread(Precision):
    """How far the means of M groups may lie from the truth."""

    draws: Floats  # (resamples, M) bootstrap deviations from the observed means


def resample_counts(sizes: Sizes, resamples: int, rng: np.random.Generator) -> NDArray[np.int64]:
    """How often each row is drawn when every group is resampled with replacement.

    Returns (resamples, rows).
    """
    return np.concatenate([rng.multinomial(n, np.full(n, 1 / n), size=resamples) for n in sizes], axis=1)


def group_sums(values: NDArray, sizes: Sizes) -> NDArray:
    """Sums of the last axis over consecutive groups."""
    return np.add.reduceat(values, np.cumsum(sizes) - sizes, axis=-1)


def _residuals(values: Floats, sizes: Sizes) -> Floats:
    means = np.repeat(group_sums(values, sizes) / sizes, sizes)
    return differing(values - means, np.maximum(np.abs(values), np.abs(means)))


def precision(values: Floats, sizes: Sizes, enough: int = 2) -> Precision:
    """Variance of the means of consecutive groups of `values` (rows,).

    A group of fewer than `enough` rows that are all alike, as one row is, shows no spread: it borrows the
    pooled one of the others. Coarse values want more than two, which may be equal by chance.
    """
    n = sizes.astype(np.float64)
    squares = group_sums(_residuals(values, sizes) ** 2, sizes)
    alike = _alike(values, sizes, enough)
    freedom = np.where(alike, (n - 1)[~alike].sum(), n - 1)
    with np.errstate(invalid="ignore"):
        variance = np.where(alike, squares[~alike].sum(), squares) / freedom / n
    return Precision(variance, freedom)


def _alike(values: Floats, sizes: Sizes, enough: int) -> NDArray[np.bool_]:
    """Which groups are fewer than `enough` rows of the same value."""
    same = group_sums(np.abs(_residuals(values, sizes)), sizes) == 0
    return np.asarray(same & (sizes < enough))


def spread(values: Floats, sizes: Sizes, resamples: int, rng: np.random.Generator, enough: int = 2) -> Spread:
    """Bootstrap the means of consecutive groups of `values` (rows,).

    A bootstrap mean of n rows varies (n - 1) / n as much as the mean itself, so the deviations are
    widened by sqrt(n / (n - 1)). `enough` as for `precision`.
    """
    n = sizes.astype(np.float64)
    known = precision(values, sizes, enough)
    deviations = group_sums(resample_counts(sizes, resamples, rng) * _residuals(values, sizes), sizes) / n
    draws = np.where(
        _alike(values, sizes, enough),
        rng.standard_normal(deviations.shape) * np.sqrt(known.variance),
        deviations * np.sqrt(n / np.maximum(n - 1, 1)),
    )
    return Spread(known.variance, known.freedom, draws)


def standard_error(weights: Floats, means: Precision) -> tuple[Floats, Floats]:
    """Standard errors (K,) of linear combinations `weights` (K, M) of group means.

    Beside them their degrees of freedom (K,) after Welch and Satterthwaite.
    """
    terms = weights**2 * means.variance
    total = terms.sum(axis=1)
    shares = np.divide(terms, total[:, None], out=np.ones_like(terms), where=total[:, None] > 0)
    freedom = 1 / (shares**2 / means.freedom).sum(axis=1) if np.all(means.freedom) else np.nan
    return np.sqrt(total), np.broadcast_to(np.asarray(freedom, dtype=np.float64), total.shape)


def interval(estimate: Floats, weights: Floats, means: Spread, confidence: float) -> tuple[Floats, Floats]:
    """Confidence intervals of K linear combinations of M group means.

    `estimate` (K,) are the combinations as observed, `weights` (K, M). The bootstrap quantiles are
    stretched from the normal to Student's t (Hesterberg, The American Statistician 69, 2015): with few rows
    a plain percentile interval is far too short.
    """
    tail = (1 + confidence) / 2
    _, freedom = standard_error(weights, means)
    low, high = np.quantile(means.draws @ weights.T, [1 - tail, tail], axis=0)
    stretch = stdtrit(freedom, tail) / ndtri(tail)
    return estimate + stretch * low, estimate + stretch * high


def p_values(estimate: Floats, error: Floats, freedom: Floats) -> Floats:
    """Two-sided p-values of estimates (K,) against 0 by Student's t; 1 where the error is not known."""
    with np.errstate(divide="ignore", invalid="ignore"):
        p = 2 * stdtr(freedom, -np.abs(estimate) / error)
    return np.where(np.isnan(p), 1.0, p)


def third_cumulants(values: Floats, sizes: Sizes) -> Floats:
    """Third cumulants (M,) of the means of consecutive groups of `values` (rows,), from their own moments."""
    return group_sums(_residuals(values, sizes) ** 3, sizes) / sizes.astype(np.float64) ** 3


def unskewed(estimate: Floats, error: Floats, third: Floats) -> Floats:
    """Estimates (K,) moved so that Student's t takes no skewness for a difference.

    The transformation of Hall (J. R. Statist. Soc. B 54, 1992). Where runs now and then go much worse, a mean
    that has not seen one yet looks better, and surer, than it is.

    Args:
        estimate: (K,) against 0.
        error: (K,) standard errors.
        third: (K,) third cumulants of the estimates.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        skewness, t = third / error**3, estimate / error
    moved = t + skewness * t**2 / 3 + skewness**2 * t**3 / 27 + skewness / 6
    return np.where(np.isfinite(moved), moved * error, estimate)


def holm(p: Floats) -> Floats:
    """p-values (K,) adjusted for their number (Holm, Scandinavian Journal of Statistics 6, 1979).

    To call different what has an adjusted value of at most alpha errs anywhere with probability alpha.
    """
    order = np.argsort(p)
    adjusted = np.empty_like(p)
    adjusted[order] = np.minimum(np.maximum.accumulate(p[order] * np.arange(len(p), 0, -1)), 1.0)
    return adjusted


def possible_ranks(better: NDArray[np.bool_]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The best and the worst rank (K,) that each of K entrants may have.

    `better` (K, K) says whether the first is proven better than the second. If all of these hold, so do all
    ranges at once.
    """
    return 1 + better.sum(axis=0), len(better) - better.sum(axis=1)
