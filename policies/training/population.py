"""Populations: who drives the cars that the learner does not, drawn anew at each start."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from nathlon.policies.apart import load_guest
from nathlon.policies.checkpoint import open_checkpoint
from nathlon.policies.policy import Policy
from nathlon.policies.training.config import PAST, SELF, Opponent
from nathlon.policies.training.pairs import Pair


class Population:
    """Policies that are drawn by their weights.

    `self` and `past` are the first of the others until they have been met.

    Attributes:
        policies: one for each opponent of the configuration, in their order.
    """

    def __init__(self, opponents: Sequence[Opponent], pair: Pair) -> None:
        """Opponents on a circuit and in a car; at least one is neither `self` nor `past`.

        Raises:
            InputError: if one is not known or cannot be read.
        """
        self._names = [opponent.policy for opponent in opponents]
        loaded = {
            name: load_guest(pair.wise(name), pair.circuit, pair.car)
            for name in self._names
            if name not in (SELF, PAST)
        }
        self.policies: list[Policy] = [loaded.get(name, next(iter(loaded.values()))) for name in self._names]
        weights = np.array([opponent.weight for opponent in opponents])
        self._chances = weights / weights.sum()
        self._past: tuple[Path, ...] = ()

    def meet(self, current: Policy | None, past: Sequence[Path], rng: np.random.Generator) -> list[int]:
        """Know the policy in training, and its checkpoints.

        When there are new checkpoints, `past` becomes one of them all.

        Args:
            current: drives `self`; None leaves it as it is.
            past: the checkpoints of the run so far.
            rng: draws one of them.

        Returns:
            indices of the policies that are others now.

        Raises:
            InputError: if a checkpoint cannot be read.
        """
        changed = []
        renewed = bool(past) and tuple(past) != self._past
        for index, name in enumerate(self._names):
            if name == SELF and current is not None and self.policies[index] is not current:
                self.policies[index] = current
                changed.append(index)
            elif name == PAST and renewed:
                self.policies[index] = open_checkpoint(past[int(rng.integers(len(past)))])
                changed.append(index)
        self._past = tuple(past)
        return changed

    def draw(self, count: int, rng: np.random.Generator) -> NDArray[np.int64]:
        """Indices of policies, (count,)."""
        return rng.choice(len(self.policies), count, p=self._chances)
