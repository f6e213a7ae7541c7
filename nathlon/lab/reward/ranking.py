"""Who is compared with whom, and what comes of it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from itertools import combinations

import numpy as np

from nathlon.lab.reward.alignment import Preference
from nathlon.lab.reward.clips import Clips
from nathlon.lab.reward.judging import ClipPair
from nathlon.tournament.bradley_terry import bradley_terry
from nathlon.tournament.ratings import PRIOR


def strengths(names: Sequence[str], preferences: Iterable[Preference]) -> dict[str, float]:
    """Bradley and Terry's strengths by name, log-odds with mean 0; a draw counts half to each.

    Everybody is given half a drawn comparison with everybody, so that nobody is infinitely better.

    Args:
        names: who were compared.
        preferences: those between them count.
    """
    index = {name: number for number, name in enumerate(names)}
    wins = 0.5 * PRIOR * (1.0 - np.eye(len(names)))
    for one in preferences:
        if one.first in index and one.second in index:
            first, second = index[one.first], index[one.second]
            wins[first, second] += 0.5 + 0.5 * one.better
            wins[second, first] += 0.5 - 0.5 * one.better
    return dict(zip(names, bradley_terry(wins).tolist(), strict=True))


def some_pairs(clips: Mapping[str, Clips], count: int, rng: np.random.Generator) -> list[ClipPair]:
    """So many pairs of clips of the library, each from the same start, no pair twice."""
    starts = min(len(one.driven) for one in clips.values())
    everything = [ClipPair(*pair, start) for start in range(starts) for pair in combinations(clips, 2)]
    drawn = rng.permutation(len(everything))[:count]
    return [everything[index] for index in drawn]


def all_pairs(names: Sequence[str], starts: int, each: int, rng: np.random.Generator) -> list[ClipPair]:
    """All pairs of some who drive, each from some of the starts that are drawn.

    Args:
        names: who drive.
        starts: how many there are.
        each: how many of them for a pair, at most.
        rng: draws them, and who comes first.
    """
    pairs = []
    for pair in combinations(names, 2):
        for start in sorted(rng.permutation(starts)[:each].tolist()):
            first, second = pair if rng.random() < 0.5 else pair[::-1]
            pairs.append(ClipPair(first, second, start))
    return pairs
