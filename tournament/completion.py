"""Completion: whether a policy breaks down in fewer of its runs than a rate that matters, run by run.

A mean says nothing of what is rare: breakdowns in 5 % of the runs are not among the first eight in two cases
of three, and nothing in those eight shows that they exist. So they are counted by themselves, and exactly.

A policy passes with k breakdowns from a number of runs on at which so few are improbable if the rate is the
one that matters. The probability alpha to pass such a policy at any look at all is shared out: a pass
without a breakdown may spend `SPENT` of it, one with k breakdowns `SPENT` of what is left. As breakdowns
only become more, who has k of them can have passed at these numbers of runs alone, whatever the looks: the
binomial sum over them is exact for a look after each run, and looks that are fewer err less.

It fails where it breaks down more often than a reference from the same starts: of the runs in which one of
the two alone did, each is as likely the one's as the other's if both are equal. Against that stands any
higher probability p, all being equally likely; the ratio of the likelihoods

    E = 2 ∫ p^a (1 - p)^b dp 2^(a + b)    from 1/2 to 1

reaches 1 / beta with probability beta at most, at all looks together (Ville, 1939; Robbins, Ann. Math.
Statist. 41, 1970).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from math import ceil, log, log1p
from typing import NamedTuple

import numpy as np
from scipy.special import bdtr, betainc, betaln

from nathlon.arena.decision import Decision

SPENT = 0.8
"""Of what is left of alpha, by a pass with one more breakdown."""


class Completed(NamedTuple):
    """Runs of two policies from the same starts.

    Attributes:
        runs: of each.
        both, alone, other: runs in which both broke down, the one that is judged alone, and the other alone.
    """

    runs: int
    both: int
    alone: int
    other: int

    @property
    def broken(self) -> int:
        """Runs in which the one that is judged broke down."""
        return self.both + self.alone

    @property
    def others_broken(self) -> int:
        """Runs in which the other one did."""
        return self.both + self.other


@dataclass(frozen=True)
class Completion:
    """A sequential test of one policy's runs.

    Attributes:
        rate: share of breakdowns that matters, between 0 and 1.
        alpha: probability to pass a policy that breaks down as often, or more often.
        beta: probability to fail one that breaks down no more often than the reference.
    """

    rate: float
    alpha: float = 0.05
    beta: float = 0.05

    def verdict(self, seen: Completed) -> Decision:
        """What the runs so far say."""
        needed = enough(self.rate, self.alpha, seen.runs)
        if seen.broken < len(needed):
            return Decision.PASS
        return Decision.FAIL if breaks_more(seen.alone, seen.other) >= 1 / self.beta else Decision.CANNOT_TELL

    def needed(self, broken: int) -> int:
        """Runs after which so many breakdowns are few enough to pass."""
        most = clean_sweep(self.rate, self.alpha)
        while len(found := enough(self.rate, self.alpha, most)) <= broken:
            most *= 2
        return found[broken]

    def ruled_out(self, seen: Completed) -> float | None:
        """The least rate of breakdowns with which the runs so far would pass; None where none would."""

        def passes(rate: float) -> bool:
            return seen.broken < len(enough(rate, self.alpha, seen.runs))

        low, high = 0.0, 1.0 - 1e-6
        if not passes(high):
            return None
        while high - low > 1e-4:
            middle = (low + high) / 2
            low, high = (low, middle) if passes(middle) else (middle, high)
        return high


@lru_cache(maxsize=4096)
def enough(rate: float, alpha: float, most: int) -> tuple[int, ...]:
    """Runs from which on 0, 1, 2, ... breakdowns are few enough to pass, as far as `most` runs go."""
    needed: list[int] = []
    left, runs = alpha, 0
    open_ = np.ones(1)  # by breakdowns so far, the probability of them and of no pass yet
    while True:
        failures = len(needed)
        # Those pass that had as many breakdowns at the number of runs before, and none since.
        chance = float(open_[failures]) if failures < len(open_) else 0.0
        more = max(ceil(log(SPENT * left / chance) / log1p(-rate)), 1) if chance > 0 else 1
        runs += more
        if runs > most:
            return tuple(needed)
        open_ = np.convolve(open_, np.diff(bdtr(np.arange(more + 1), more, rate), prepend=0.0))
        left -= float(open_[failures])
        open_[failures] = 0.0
        needed.append(runs)


def clean_sweep(rate: float, alpha: float) -> int:
    """Runs that must all be completed before a test of `Completion` can pass."""
    return max(ceil(log(SPENT * alpha) / log1p(-rate)), 1)


def breaks_more(alone: int, other: int) -> float:
    """How much likelier it is that one breaks down more often than another than that it does not: E."""
    upper = 1.0 - float(betainc(alone + 1, other + 1, 0.5))
    return float(2.0 * upper * np.exp(betaln(alone + 1, other + 1) + (alone + other) * log(2.0)))
