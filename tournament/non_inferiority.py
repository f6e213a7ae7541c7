"""Non-inferiority: whether a candidate is no worse than a reference by more than a margin, unit by unit.

The unit is a difference, candidate less reference, turned so that more is better. The candidate is
inferior if the mean is at most -margin, and is not if it is at least 0; between the two either answer will
do. The test is the sequential one of `nathlon.tournament.stopping`: with the mean t and the margin m in
standard deviations of units, the likelihood is largest at max(t, 0) for what is not inferior and at
min(t, -m) for what is, so that

    LLR = N / 2 ln[(1 + (t - min(t, -m))^2) / (1 + (t - max(t, 0))^2)]

Several measures together are an intersection-union test (Berger, Technometrics 24, 1982): a candidate passes
if it does in each of them, and no level needs a correction for their number.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil, sqrt
from typing import NamedTuple

import numpy as np
from scipy.special import stdtrit

from nathlon.arena.decision import Decision
from nathlon.arena.statistics import Floats
from nathlon.tournament.stopping import FEWEST, TINY, log_likelihood_ratio, repeated, wald_bounds


class Sample(NamedTuple):
    """Units of evidence of one measure: how many, their mean, and the deviation of one of them."""

    units: float
    mean: float
    deviation: float

    @classmethod
    def of(cls, differences: Floats, floor: float = 0.0) -> Sample:
        """Of differences (N,), whose deviation is at least `floor`: rare events may not have happened yet."""
        deviation = float(differences.std(ddof=1)) if len(differences) > 1 else 0.0
        mean = float(differences.mean()) if len(differences) else 0.0
        return cls(float(len(differences)), mean, max(deviation, floor))


EARLY = 2.0
"""Times Wald's bound: the logarithm of the ratio at which one fails before the first look."""
MOST_UNITS = 1e6
"""Beyond so many, no number of units is said to decide."""
LOSS = 10.0
"""Margins: of a rare loss that a unit may show, such as all points of a skill test."""


def least_deviation(margin: float) -> float:
    """What a unit varies by, at least, in one who is worse by the margin because of rare losses alone.

    Of `LOSS` margins each they come in one unit of `LOSS`, and none may have been seen yet.
    """
    return sqrt(LOSS) * margin


@dataclass(frozen=True)
class NonInferiority:
    """A sequential test of one measure.

    Attributes:
        margin: by which the candidate may be worse, in the unit of the differences; positive.
        alpha: probability to pass a candidate that is worse by the margin or more.
        beta: probability to fail one that is as good.
        looks: how often the units are looked at, at most, after equal numbers of them.
        first: units before which nothing passes, and fails only what is far worse: the ratio is that of a
            normal mean, and where the noise is skewed a mean of few units is not.
        sweep: units below which nothing passes: as many as show a loss that is rare, but matters.
    """

    margin: float
    alpha: float = 0.05
    beta: float = 0.05
    looks: int = 1
    first: int = FEWEST
    sweep: int = 0

    def verdict(self, sample: Sample) -> Decision:
        """What the units so far say."""
        if sample.units < FEWEST:
            return Decision.CANNOT_TELL
        ratio = self._ratio(sample)
        fail, passed = wald_bounds(self.alpha, self.beta)
        early = sample.units < self.first
        if ratio <= (EARLY * fail if early else fail):
            return Decision.FAIL
        return Decision.CANNOT_TELL if early or ratio < passed or sample.units < self.sweep else Decision.PASS

    def needed(self, sample: Sample) -> int | None:
        """Units that decide, if mean and deviation stay as they are.

        None below `FEWEST` units, and where the mean lies so that no number does.
        """
        if sample.units < FEWEST:
            return None
        each = self._ratio(sample) / sample.units
        fail, passed = wald_bounds(self.alpha, self.beta)
        least = self.first if each < 0 else max(self.first, self.sweep)
        units = (fail if each < 0 else passed) / each if each else np.inf
        return max(ceil(units), least) if units < MOST_UNITS else None

    def _ratio(self, sample: Sample) -> float:
        """The logarithm of the likelihood ratio: positive for what is not inferior."""
        deviation = max(sample.deviation, TINY)
        t, margin = sample.mean / deviation, self.margin / deviation
        return float(log_likelihood_ratio(sample.units, t, min(t, -margin), max(t, 0.0)))

    def interval(self, sample: Sample) -> tuple[float | None, float | None]:
        """Bounds of the mean that hold at all looks together, each missed with probability alpha.

        None for both below two units.
        """
        if sample.units < 2:
            return None, None
        level = (1 + repeated(1 - 2 * self.alpha, self.looks)) / 2
        half = float(stdtrit(sample.units - 1, level)) * sample.deviation / np.sqrt(sample.units)
        return sample.mean - half, sample.mean + half


def together(verdicts: list[Decision]) -> Decision:
    """One verdict of several that must all pass."""
    if Decision.FAIL in verdicts:
        return Decision.FAIL
    return Decision.CANNOT_TELL if Decision.CANNOT_TELL in verdicts or not verdicts else Decision.PASS
