"""How good whom one would send is after so many races of a round robin."""

from __future__ import annotations

from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from nathlon.arena.statistics import Floats


def leads(gaps: Floats) -> Floats:
    """By how many points a race each of K beats all of them on average, by (K, K) mean differences."""
    return gaps.mean(axis=1)


def expected_lead(
    pairs: dict[tuple[int, int], Floats], entrants: int, races: int, draws: int, rng: np.random.Generator
) -> float:
    """The lead of whoever has the most points after so many races, on average over draws.

    Each draw deals the pairs of every two to two halves. From one half a round robin is drawn, with
    replacement, as even as it can be; the other tells how good the one is that it would send. So nobody
    looks good by the luck that had it chosen.

    Args:
        pairs: point differences of all raced mirrored pairs of the first and the second, by their numbers.
        entrants: how many there are.
        races: of the round robin, two a pair.
        draws: how often.
    """
    twos = list(combinations(range(entrants), 2))
    total = 0.0
    for _ in range(draws):
        seen, judge = np.zeros((2, entrants, entrants))
        raced = dealt(len(twos), races // 2, rng)
        for (first, second), count in zip(twos, raced, strict=True):
            shuffled = rng.permutation(pairs[first, second])
            half = len(shuffled) // 2
            judge[first, second] = shuffled[half:].mean()
            if count:
                seen[first, second] = rng.choice(shuffled[:half], count).mean()
        met = np.zeros((entrants, entrants))
        met[tuple(np.array(twos).T)] = raced
        scores = fitted(seen - seen.T, met + met.T)
        best = np.flatnonzero(scores >= scores.max() - 1e-9)
        total += leads(judge - judge.T)[rng.choice(best)]
    return total / draws


def dealt(matchups: int, pairs: int, rng: np.random.Generator) -> NDArray[np.int64]:
    """How many of some pairs every matchup gets: as many, and one more for some by lot."""
    raced = np.full(matchups, pairs // matchups)
    raced[rng.permutation(matchups)[: pairs % matchups]] += 1
    return raced


def fitted(gaps: Floats, weight: Floats) -> Floats:
    """Scores (K,) that fit mean differences (K, K) by least squares, weighted; their mean is 0.

    As `nathlon.tournament.evidence.Evidence.solution`, for thousands of small tables.
    """
    laplacian = np.diag(weight.sum(axis=1)) - weight
    scores: Floats = np.linalg.pinv(laplacian, hermitian=True) @ (weight * gaps).sum(axis=1)
    return scores


def enough(curve: dict[int, float], gain: float) -> int:
    """The fewest races after which the most bring less than so many points more."""
    most = curve[max(curve)]
    return min(races for races, lead in curve.items() if most - lead < gain)
