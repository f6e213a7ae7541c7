"""Ballots: what members of a committee prefer, the one order that follows, and how far they agree.

Whatever a member says comes down to preferences between two candidates, (n, n) int8: 1 where the
row's candidate is preferred to the column's, -1 the other way round, 0 where the member says nothing.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy.special import expit

from nathlon.tournament.bradley_terry import bradley_terry

Preferences = NDArray[np.int8]


@dataclass(frozen=True)
class Ballot:
    """A member's opinion of all candidates.

    Attributes:
        approve: those that are fit to go on.
        rank: the best first; others may be left out, and come after those of their kind that are ranked.
    """

    approve: tuple[str, ...]
    rank: tuple[str, ...]

    def preferences(self, candidates: Sequence[str]) -> Preferences:
        """Who is approved before who is not; among each, who is ranked in that order, then the others."""
        level = np.array([self._level(candidate) for candidate in candidates])
        return np.sign(level - level[:, None]).astype(np.int8)

    def _level(self, candidate: str) -> int:
        last = len(self.rank)
        place = self.rank.index(candidate) if candidate in self.rank else last
        return place if candidate in self.approve else last + 1 + place


def support(preferences: Sequence[Preferences], n: int) -> NDArray[np.int64]:
    """How many members prefer each of n candidates to each, (n, n)."""
    return np.count_nonzero(np.stack([np.zeros((n, n), np.int8), *preferences]) > 0, axis=0)


def order(support: NDArray[np.int64]) -> tuple[list[int], NDArray[np.float64]]:
    """Candidates from first to last, and the favour in which each stands.

    The order is Schulze's (Social Choice and Welfare 36, 2011): a candidate that a majority prefers to each
    other one is first. Where it leaves a tie, the one in higher favour is before the other, and then
    the one that comes first among the candidates.

    Args:
        support: (n, n), how many members prefer the row's to the column's.

    Returns:
        indices of the candidates; favour (n,), see `favour`.
    """
    paths = _strongest_paths(support)
    beaten_by = (paths < paths.T).sum(axis=1)
    liked = favour(support)
    return [int(index) for index in np.lexsort((-liked, beaten_by))], liked


def _strongest_paths(support: NDArray[np.int64]) -> NDArray[np.int64]:
    """The strength of the strongest path from each to each, by winning votes, with Floyd and Warshall."""
    paths = np.where(support > support.T, support, 0)
    for middle in range(len(paths)):
        paths = np.maximum(paths, np.minimum(paths[:, middle, None], paths[middle]))
    return paths


def favour(support: NDArray[np.int64]) -> NDArray[np.float64]:
    """How often each would be preferred to one of the others, by the model of Bradley and Terry.

    The model is fitted as though one more member had called every two equal: without, those
    whom all prefer would have no finite strength.

    Args:
        support: (n, n), how many members prefer the row's to the column's.

    Returns:
        (n,) share of such answers, 0 to 1, to six decimals; 0.5 where there is no other.
    """
    if len(support) < 2:
        return np.full(len(support), 0.5)
    strength = bradley_terry(support + 0.5 * (1 - np.eye(len(support))))
    preferred = expit(strength[:, None] - strength)
    return np.round((preferred.sum(axis=1) - 0.5) / (len(support) - 1), 6)


def agreement(preferences: Sequence[Preferences]) -> float | None:
    """How far members agree: 1 where all order alike, -1 where two order the other way round, 0 by chance.

    It is the share of answers alike less the share of contrary ones, of all questions "A or B?" that two
    members both answer, over every two members. For two rankings without ties this is Kendall's tau,
    and otherwise the gamma of Goodman and Kruskal.

    Returns:
        None where no two members answer the same question.
    """
    alike = both = 0
    for one, other in combinations(preferences, 2):
        product = one * other
        alike += int(product.sum())
        both += int(np.abs(product).sum())
    return alike / both if both else None
