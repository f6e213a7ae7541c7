"""What few runs in each of many cells tell: shrunk estimates for the order, tests for the verdicts."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr
from scipy.stats import false_discovery_control

from nathlon.tournament.non_inferiority import LOSS

Floats = NDArray[np.float64]

PRIOR_FREEDOM = 2.0
"""Degrees of freedom that the usual variance of a cell counts for beside a cell's own."""
LOOKS_WORSE = 0.5
"""Probability of being worse by the margin from which on a cell is driven again."""
EARLY_SHARE = 0.25
"""Of the false discovery rate, for all looks but the last."""
FIRST_RUNS = 8
"""Of a cell that is driven again, before it is looked at."""
TRIED_RUNS = 16
"""Of a cell that is driven again, after which it is given up where they are no worse than the margin."""
STEPS = 60
"""Of expectation and maximisation, after which estimates change by less than a hundredth of their error."""
HALVINGS = 50
"""Of the interval in which a saddle point lies."""
NEAR = 1e-3
"""Standard deviations from the mean, within which a tail is taken for one half."""


class Shrunk(NamedTuple):
    """Means of cells, drawn towards what their rows and columns have in common.

    Attributes:
        mean, error: (cells,) posterior mean and standard deviation.
    """

    mean: Floats
    error: Floats

    def above(self, margin: float) -> Floats:
        """(cells,) probability that the truth lies above a margin."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(
                self.error > 0,
                ndtr((self.mean - margin) / self.error),
                np.where(self.mean > margin, 1.0, 0.0),
            )


def variances_of_means(differences: Floats) -> Floats:
    """Variances (cells,) of the means of `differences` (cells, runs), NaN where there was no run.

    A cell's own variance is drawn towards the usual one, as a few runs say little of it (Smyth, Statistical
    Applications in Genetics and Molecular Biology 3, 2004, with given prior degrees of freedom). The usual
    one is the median over cells, which a few wild cells do not move, or the mean where most do not vary.
    """
    runs = np.isfinite(differences).sum(axis=1)
    middle = np.nansum(differences, axis=1) / np.maximum(runs, 1)
    squares = np.nansum((differences - middle[:, None]) ** 2, axis=1)
    freedom = np.maximum(runs - 1, 0)
    own = squares[freedom > 0] / freedom[freedom > 0]
    usual = (float(np.median(own)) or float(own.mean())) if len(own) else 0.0
    variance: Floats = (PRIOR_FREEDOM * usual + squares) / (PRIOR_FREEDOM + freedom)
    return variance / np.maximum(runs, 1)


def shrink(means: Floats, variances: Floats, levels: NDArray[np.int64]) -> Shrunk:
    """The posterior of cells whose truth is the sum of effects of their levels and one of their own.

    All effects are normal about 0 but for a common mean; how large those of each dimension are is estimated
    from the cells by expectation and maximisation.

    Args:
        means: (cells,) observed.
        variances: (cells,) of `means`.
        levels: (cells, dimensions), the index of each cell's level in each dimension.
    """
    noise = np.maximum(variances, 1e-12 * (float(means.var()) + float(variances.mean())) + 1e-300)
    sizes = levels.max(axis=0, initial=0) + 1
    design = np.concatenate(
        [np.ones((len(means), 1)), *(np.eye(n)[levels[:, d]] for d, n in enumerate(sizes))], axis=1
    )
    owner = np.concatenate([[0], np.repeat(np.arange(1, len(sizes) + 1), sizes)])
    spread = np.full(len(sizes) + 1, max(float(means.var()), float(noise.mean())) / (len(sizes) + 1))
    own = spread[0]
    for _ in range(STEPS):
        precision = np.where(owner > 0, 1.0 / spread[owner], 0.0)
        weight = 1.0 / (noise + own)
        covariance = np.linalg.inv((design.T * weight) @ design + np.diag(precision))
        effects = covariance @ (design.T @ (weight * means))
        fitted = design @ effects
        doubt = ((design @ covariance) * design).sum(axis=1)
        kept = own / (own + noise)
        for dimension in range(1, len(spread)):
            here = owner == dimension
            spread[dimension] = max(
                float((effects[here] ** 2 + np.diag(covariance)[here]).mean()), 1e-12 * float(noise.mean())
            )
        left = kept * (means - fitted)
        own = max(float((left**2 + kept * noise + kept**2 * doubt).mean()), 1e-12 * float(noise.mean()))
    kept = own / (own + noise)
    return Shrunk(fitted + kept * (means - fitted), np.sqrt(kept * noise + (1 - kept) ** 2 * doubt))


def mishap(differences: Floats, margin: float) -> float:
    """By how much a run may turn out better than is usual in its cell: as far as any did, or `LOSS` margins.

    Args:
        differences: (cells, runs), more is worse; NaN where there was no run.
        margin: in their unit.
    """
    some = differences[np.isfinite(differences).any(axis=1)]
    usual = np.nanmedian(some, axis=1, keepdims=True) if len(some) else some
    return max(LOSS * margin, float(np.nanmax(usual - some, initial=0.0)))


def p_worse(differences: Floats, margin: float, mishap: float) -> Floats:
    """One-sided p-values (cells,) that the mean of each row lies above a margin, whatever its noise is like.

    A mean is at the mercy of mishaps of the baseline that it survives: rare, large, and perhaps not seen yet.
    So the runs get random weights that add up to 1, evenly spread over all such weights, and with them one
    run more, the worst that the policy's lead may turn to. How often the weighted mean is no more than the
    margin is the p-value (Gaffke, Three test statistics for a nonparametric one-sided hypothesis on the mean
    of a nonnegative variable, 2005). Where runs have but two values it is that of the exact binomial test.

    Args:
        differences: (cells, runs), more is worse; NaN where there was no run. A row of fewer than two runs
            proves nothing.
        margin: in their unit.
        mishap: see the function of this name.
    """
    p = np.ones(len(differences))
    known = np.flatnonzero(np.isfinite(differences).sum(axis=1) >= 2)
    if len(known):
        runs = differences[known]
        worst = np.minimum(np.nanmedian(runs, axis=1) - mishap, np.nanmin(runs, axis=1))
        p[known] = _not_above_zero(np.nan_to_num(np.column_stack([runs, worst]) - margin))
    return p


def no_worse(differences: Floats, margin: float) -> NDArray[np.bool_]:
    """Which means of rows (cells, runs), NaN where there was no run, lie no higher than a margin."""
    return np.asarray(np.nansum(differences - margin, axis=1) <= 0)


def _not_above_zero(values: Floats) -> Floats:
    """Probability (cells,) that values (cells, runs), weighted at random, add up to no more than 0.

    Such weights are in proportion to exponential variables, so it is that of a sum of these: by the saddle
    point of its cumulants (Lugannani and Rice, Advances in Applied Probability 12, 1980), within a few
    percent. 1 where the plain mean is no more than 0.
    """
    p = np.where(values.sum(axis=1) > 0, 0.0, 1.0)
    mixed = np.flatnonzero((p == 0.0) & (values.min(axis=1) < 0))
    if not len(mixed):
        return p
    some = values[mixed]
    low, high = 1 / some.min(axis=1), np.zeros(len(some))
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        above = (some / (1 - some * middle[:, None])).sum(axis=1) > 0
        low, high = np.where(above, low, middle), np.where(above, middle, high)
    point = (low + high) / 2
    shrinking = 1 - some * point[:, None]
    w = -np.sqrt(2 * np.maximum(np.log(shrinking).sum(axis=1), 0.0))
    u = point * np.sqrt(((some / shrinking) ** 2).sum(axis=1))
    with np.errstate(divide="ignore", invalid="ignore"):
        tail = ndtr(w) + np.exp(-(w**2) / 2) / np.sqrt(2 * np.pi) * (1 / w - 1 / u)
    p[mixed] = np.where(w < -NEAR, np.clip(tail, 0.0, 0.5), 0.5)
    return p


class Mean(NamedTuple):
    """A mean over cells, and how well it is known.

    Attributes:
        mean, error: and standard error.
        freedom: degrees of freedom of `error`.
    """

    mean: float
    error: float
    freedom: int


def mean_over_cells(differences: Floats) -> Mean:
    """The mean of the means of `differences` (cells, runs), NaN where there was no run.

    The cells are those that are asked about, so only their runs make it uncertain.
    """
    runs = np.isfinite(differences).sum(axis=1)
    cells, runs = differences[runs > 0], runs[runs > 0]
    if not len(cells):
        return Mean(float("nan"), float("nan"), 0)
    means = np.nanmean(cells, axis=1)
    squares = float(np.nansum((cells - means[:, None]) ** 2))
    freedom = int((runs - 1).sum())
    variance = squares / max(freedom, 1)
    return Mean(float(means.mean()), float(np.sqrt(variance * (1 / runs).sum())) / len(cells), freedom)


def as_one_cell(differences: Floats) -> Floats:
    """(1, cells x runs) runs of cells as those of one cell, which has their `mean_over_cells`.

    How far apart the cells lie is taken out, as there, and deviations are as large as those from the truth.
    NaN where a cell has no second run.
    """
    runs = np.isfinite(differences).sum(axis=1, keepdims=True)
    some = np.where(runs > 0, differences, 0.0)
    means = np.nansum(some, axis=1, keepdims=True) / np.maximum(runs, 1)
    wider = np.sqrt(runs / np.where(runs > 1, runs - 1, np.nan))
    return np.asarray((mean_over_cells(differences).mean + wider * (differences - means)).reshape(1, -1))


def discovered(p: Floats, rate: float) -> NDArray[np.bool_]:
    """Which hypotheses (K,) are rejected at a false discovery rate.

    After Benjamini and Hochberg (Journal of the Royal Statistical Society B 57, 1995).
    """
    if not len(p):
        return np.zeros(0, np.bool_)
    return np.asarray(false_discovery_control(p, method="bh") <= rate)


def looks(most: int) -> list[int]:
    """Runs of a cell that is driven again after which it is looked at, each time twice as many."""
    ends = [FIRST_RUNS]
    while 2 * ends[-1] < most:
        ends.append(2 * ends[-1])
    return [*(end for end in ends if end < most), most]


def rate_of_look(end: int, ends: list[int], rate: float) -> float:
    """What a look may spend of a false discovery rate."""
    return (1 - EARLY_SHARE if end == ends[-1] else EARLY_SHARE / max(len(ends) - 1, 1)) * rate
