"""Simulations of verdicts, and the row that many of them make."""

from __future__ import annotations

import zlib
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from scipy.stats import binomtest, norm

SEED = 20_261_128
SURE = 0.95
"""Of the intervals of rows."""


class Outcome(NamedTuple):
    """What one simulation came to.

    Attributes:
        false: share of false claims: of the claims for a false discovery rate, or 0 or 1 for any at all.
        claims: claims that were made, or that could have been made and were not.
        found: share of what is true and could be found that was; None where nothing was to be found.
    """

    false: float
    claims: int
    found: float | None


Simulate = Callable[[np.random.Generator], Outcome]


class Case(NamedTuple):
    """A verdict under a noise.

    Attributes:
        verdict: filter, battery, round robin, gate, matrix or recipes.
        claim: what is claimed falsely.
        noise: of the runs.
        goal: share of false claims, at most.
        simulate: one outcome.
    """

    verdict: str
    claim: str
    noise: str
    goal: float
    simulate: Simulate


def simulated(case: Case, numbers: range) -> list[Outcome]:
    """Some simulations of a case, each with a seed of its own."""
    own = zlib.crc32("|".join((case.verdict, case.claim, case.noise)).encode())
    return [case.simulate(np.random.default_rng([SEED, own, number])) for number in numbers]


def row(case: Case, outcomes: Sequence[Outcome]) -> dict[str, Any]:
    """A row of the result: shares over simulations, with the interval of that of false claims."""
    false = np.array([outcome.false for outcome in outcomes])
    found = [outcome.found for outcome in outcomes if outcome.found is not None]
    low, high = _interval(false)
    return {
        "verdict": case.verdict,
        "claim": case.claim,
        "noise": case.noise,
        "claims": int(sum(outcome.claims for outcome in outcomes)),
        "false_share": round(float(false.mean()), 4),
        "low": round(low, 4),
        "high": round(high, 4),
        "goal": case.goal,
        "power": round(float(np.mean(found)), 4) if found else None,
    }


def missed(one: dict[str, Any]) -> bool:
    """Whether a row is proven to lie above its goal."""
    return bool(one["low"] > one["goal"])


def _interval(false: np.ndarray) -> tuple[float, float]:
    """Exact where each simulation is right or wrong (Clopper and Pearson), normal where it has a share."""
    if np.isin(false, (0.0, 1.0)).all():
        interval = binomtest(int(false.sum()), len(false)).proportion_ci(SURE)
        return float(interval.low), float(interval.high)
    half = float(norm.ppf((1 + SURE) / 2) * false.std(ddof=1) / np.sqrt(len(false)))
    return max(float(false.mean()) - half, 0.0), min(float(false.mean()) + half, 1.0)
