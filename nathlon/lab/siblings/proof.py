"""Whether a training run is worse than its siblings, by what their policies did with the same seeds."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from nathlon.arena.decision import Decision
from nathlon.arena.statistics import Floats
from nathlon.tournament.non_inferiority import NonInferiority, Sample

RISK = 0.05
"""Probability to stop a run that is as good as all of its siblings, over its whole length."""
FIRST = 24
"""Episodes below which only what is far worse is proved to be."""
BY_CHANCE = 0.25
"""Probability that one of two equals loses an episode that the other wins, at most."""


def proved_worse(own: Floats, others: Iterable[Floats], margin: float, looks: int) -> bool:
    """Whether a run is worse than one of the others, for sure.

    The test of the gate (`nathlon.tournament.non_inferiority`), once for each sibling and each look: all
    share the risk. It tells a run that is worse by the margin from one that is as good; what lies between
    the two may be called either.

    Args:
        own: (N,) returns of the run's policy.
        others: (N,) each, of the siblings' policies in episodes of the same seeds.
        margin: in returns; positive.
        looks: how often it is asked, at most.
    """
    compared = [own - other for other in others if len(other) == len(own)]
    risk = RISK / (looks * max(1, len(compared)))
    # Where an episode is won or lost, equals lose so many against wins, one after another, by chance.
    if BY_CHANCE ** len(own) > risk:
        return False
    test = NonInferiority(margin, beta=risk, first=FIRST)
    return any(test.verdict(Sample.of(np.asarray(one))) == Decision.FAIL for one in compared)
