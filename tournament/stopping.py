"""When to stop: which two entrants need no more races, decided from the units raced so far.

The sequential test is that of normalized Elo (Van den Bergh, Comments on normalized Elo, 2020), on point
differences of units instead of game pairs. With the mean m and the standard deviation s of N differences,
and hypotheses "the mean is t0 s" and "the mean is t1 s", the normal likelihood with its variance free is
largest at s^2 + (m - t s)^2, so that the logarithm of the ratio is, with t = m / s,

    LLR = N / 2 ln[(1 + (t - t0)^2) / (1 + (t - t1)^2)]
"""

from __future__ import annotations

import itertools
from collections.abc import Container, Mapping
from dataclasses import dataclass
from functools import lru_cache
from math import ceil, log

import numpy as np
import polars as pl
from numpy.typing import NDArray
from scipy.optimize import brentq
from scipy.special import ndtr, ndtri

from nathlon.arena.statistics import Floats
from nathlon.tournament.evidence import Evidence

FEWEST = 4
"""Units below which nothing is decided: they show too little of how much units vary."""

OPEN, EQUAL, DIFFERENT = 0, 1, 2
"""What the test of two entrants says."""

FOLLOWED = 128
"""Looks that are followed one by one to find the confidence of each."""

TINY = 1e-9
"""Points: stands for no deviation at all."""


@dataclass(frozen=True)
class Stopping:
    """When two entrants need no more races.

    Attributes:
        effect: the least mean difference of a unit that matters, in standard deviations of units.
        alpha: probability to tell two equal entrants apart, for each two of them.
        beta: probability to take two that differ by `effect` for equal.
        drop: standard errors behind the leader beyond which an entrant races no more.
    """

    effect: float
    drop: float
    alpha: float = 0.05
    beta: float = 0.05

    @property
    def bounds(self) -> tuple[float, float]:
        """Log-likelihood ratios at which two entrants are taken for equal, and for different.

        Either of them may be the better, and by any mean from `effect` upwards: each choice halves alpha.
        """
        return wald_bounds(self.alpha / 4, self.beta)

    def verdict(self, units: Floats, t: Floats) -> NDArray[np.int64]:
        """What the test says of matchups after so many units with a mean of t standard deviations, t >= 0.

        That one is better is tested against equality with all means from `effect` upwards: against `effect`
        alone, the ratio would fall again where one is far better.
        """
        ratio = log_likelihood_ratio(units, t, 0.0, np.maximum(t, self.effect))
        equal, different = self.bounds
        said = np.where(ratio >= different, DIFFERENT, np.where(ratio <= equal, EQUAL, OPEN))
        return np.where(units >= FEWEST, said, OPEN)


def wald_bounds(alpha: float, beta: float) -> tuple[float, float]:
    """Log-likelihood ratios at which a test with these errors ends (Wald, Ann. Math. Statist. 16, 1945)."""
    return log(beta / (1 - alpha)), log((1 - beta) / alpha)


def log_likelihood_ratio(
    units: Floats | float, t: Floats | float, t0: Floats | float, t1: Floats | float
) -> Floats:
    """Logarithm of the likelihood of a normalized mean t1 over that of t0, `t` being observed in `units`."""
    ratio: Floats = units / 2 * np.log((1 + (t - t0) ** 2) / (1 + (t - t1) ** 2))
    return ratio


def settled(results: pl.DataFrame, stopping: Stopping, weights: Mapping[str, float]) -> set[frozenset[str]]:
    """Every two entrants of a tournament so far, RESULTS, that need not race on.

    That is where one is better, where they differ by less than `effect`, and where one is too far behind the
    leader.
    """
    evidence = Evidence(results, weights)
    if evidence.seen.is_empty():
        return set()
    names = np.array(evidence.entrants)
    decided = names[evidence.matchups[_decided(evidence, stopping)]].tolist()
    leader = int(np.argmax(evidence.estimates(evidence.solution)))
    dropped = names[_behind(evidence, leader) > stopping.drop].tolist()
    return {frozenset(two) for two in decided} | {
        frozenset((entrant, other)) for entrant in dropped for other in evidence.entrants if other != entrant
    }


def settled_in_gauntlet(
    results: pl.DataFrame, stopping: Stopping, weights: Mapping[str, float], references: Container[str]
) -> set[frozenset[str]]:
    """Every newcomer and reference of a gauntlet so far, RESULTS, that need not race on.

    Whom to send is a question between newcomers, who are compared by what they score against the same
    references: a newcomer is done when every other is told apart from it, close enough, or too far behind.
    One alone is compared with the references.
    """
    evidence = Evidence(results, weights)
    names = evidence.entrants
    new = [number for number, name in enumerate(names) if name not in references]
    if len(new) < 2:
        return settled(results, stopping, weights)
    scores = evidence.estimates(evidence.solution)
    leader = new[int(np.argmax(scores[new]))]
    dropped = _behind(evidence, leader) > stopping.drop
    racing = [number for number in new if not dropped[number]]
    open_ = {
        number
        for two in itertools.combinations(racing, 2)
        if not _told(evidence, stopping, evidence.solution[two[0]] - evidence.solution[two[1]])
        for number in two
    }
    return {
        frozenset((names[number], other))
        for number in new
        if number not in open_
        for other in names
        if other in references
    }


def _told(evidence: Evidence, stopping: Stopping, contrast: Floats) -> bool:
    """Whether the test of a (cells,) contrast of the means has ended.

    Its units are as many as a matchup would need for the same standard error.
    """
    variances = np.maximum(evidence.cells["deviation"].fill_null(0.0).to_numpy(), TINY) ** 2
    deviation = np.sqrt(variances.mean())
    variance = contrast**2 @ (variances / evidence.cells["units"].to_numpy())
    t = np.abs(evidence.estimates(contrast)) / deviation
    return bool(stopping.verdict(deviation**2 / variance, t) != OPEN)


def _decided(evidence: Evidence, stopping: Stopping) -> NDArray[np.bool_]:
    """(M,) whether the test of a matchup has ended."""
    cells, units = evidence.cells, evidence.units
    variance = evidence.shares**2 @ (cells["deviation"] ** 2 / cells["units"]).fill_null(0.0).to_numpy()
    deviation = np.maximum(np.sqrt(variance * units), TINY)
    verdicts = stopping.verdict(units, np.abs(evidence.estimates(evidence.shares)) / deviation)
    return np.asarray(verdicts != OPEN)


def _behind(evidence: Evidence, leader: int) -> Floats:
    """(K,) how far every entrant lies from the leader: standard errors of a normal distribution.

    With few units an error is itself uncertain, and as many of them say less: by Student's t, how much less.
    """
    p = evidence.p_values(evidence.solution[leader] - evidence.solution)
    raced = np.bincount(evidence.matchups.ravel(), np.repeat(evidence.units, 2))
    return np.where(raced >= FEWEST, -ndtri(p / 2), 0.0)


@lru_cache
def repeated(confidence: float, looks: int) -> float:
    """The confidence that each of `looks` intervals must have for all of them to hold with `confidence`.

    Whoever looks at growing results again and again and stops when they please finds intervals of plain
    confidence too short, and false differences too often. Repeated confidence intervals (Jennison and
    Turnbull, J. R. Statist. Soc. B 51, 1989) hold at all looks together, whatever the rule of stopping. The
    looks come after equal shares of the units, and all intervals have the same confidence (Pocock,
    Biometrika 64, 1977).
    """
    return float(2 * ndtr(brentq(lambda c: _all_within(c, looks) - confidence, 0.1, 10.0)) - 1)


def _all_within(bound: float, looks: int) -> float:
    """Probability that a normal mean stays within `bound` standard errors of the truth at every look.

    Beyond `FOLLOWED` looks it is what the last doublings before them tend to. The logarithm falls by as much
    with every doubling of the looks, but for a part that goes with the root of the time between two of them,
    as of any walk that is watched now and then (Siegmund, Sequential Analysis, 1985, chapter 4). At 2,000
    looks this errs by less than 0.0001.
    """
    kept = _followed(bound, min(looks, FOLLOWED))
    if looks <= FOLLOWED:
        return float(kept[-1])
    at = np.array([FOLLOWED // 4, FOLLOWED // 2, FOLLOWED])
    lost = -np.diff(np.log(kept[at - 1]))
    steady, watched = np.linalg.solve(np.stack([np.diff(np.log(at)), -np.diff(at**-0.5)], 1), lost)
    further = steady * log(looks / FOLLOWED) + watched * (FOLLOWED**-0.5 - looks**-0.5)
    return float(kept[-1] * np.exp(-further))


def _followed(bound: float, looks: int) -> Floats:
    """(looks,) the probability that the mean has stayed within bounds until each look.

    The density of the sum, which is even, is followed from look to look (Armitage, McPherson and Rowe, J. R.
    Statist. Soc. A 132, 1969), by Gauss and Legendre's quadrature over the sums that are within bounds: they
    spread from look to look, their steps do not, so that more and more nodes are needed.
    """
    density, kept = np.ones(1), np.zeros(looks)
    sums, weights = np.zeros(1), np.ones(1)
    for look in range(1, looks + 1):
        reach = bound * look**0.5
        nodes, shares = _quadrature(max(24, 8 * ceil(0.2 * reach)))
        steps = np.stack([nodes * reach - sums[:, None], nodes * reach + sums[:, None]])
        passed = np.exp(-(steps**2) / 2).sum(axis=0) / np.sqrt(2 * np.pi)
        # From the beginning, 0, both ways are one.
        density = (weights * density) @ passed / (2 if look == 1 else 1)
        sums, weights = nodes * reach, shares * reach
        kept[look - 1] = 2 * weights @ density
    return kept


@lru_cache
def _quadrature(nodes: int) -> tuple[Floats, Floats]:
    """Nodes and weights of Gauss and Legendre's quadrature from 0 to 1 of an even function."""
    at, weights = np.polynomial.legendre.leggauss(2 * nodes)
    return at[nodes:], weights[nodes:]
