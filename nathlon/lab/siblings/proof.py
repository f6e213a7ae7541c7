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


def proved_worse(own: Floats, others: Iterable[Floats], margin: float, looks: int) -> bool:
    """Whether one of the others is better by more than a margin, for sure.

    The test of the gate (`nathlon.tournament.non_inferiority`), once for each sibling and each look: all
    share the risk.

    Args:
        own: (N,) returns of the run's policy.
        others: (N,) each, of the siblings' policies in episodes of the same seeds.
        margin: in returns; positive.
        looks: how often it is asked, at most.
    """
    compared = [own - other for other in others if len(other) == len(own)]
    test = NonInferiority(margin, beta=RISK / (looks * max(1, len(compared))), first=FIRST)
    return any(test.verdict(Sample.of(np.asarray(one))) == Decision.FAIL for one in compared)
