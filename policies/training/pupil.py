"""Pupils: policies that learn from a teacher alone, see `nathlon.policies.training.imitation`."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, Protocol

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.nn.functional import smooth_l1_loss

from nathlon.policies.checkpoint import ACTION_SIZE, Card, encoded
from nathlon.policies.policy import Policy, StatelessPolicy
from nathlon.policies.training.actor import Actor, Trained
from nathlon.policies.training.instruction import Taught
from nathlon.policies.training.mirrored import mirror, turned
from nathlon.policies.weights import mean_network

STEERING = 4.0
"""How much more an error of the steering counts than one of the pedals."""
NEAR = 0.02
"""Error of an action up to which it counts by its square, and beyond which in proportion."""
DEVIATION = -3.0
"""Logarithm of the deviation of actions that a checkpoint names; nobody has learnt one."""

Rows = Mapping[str, Tensor]
"""What was noted in a round, by name; a row for each step of each car."""


class Pupil(Protocol):
    """A policy that learns from a teacher.

    Attributes:
        trained: its tensors.
        note: the rows that it keeps of what was driven.
    """

    @property
    def trained(self) -> Trained: ...

    @property
    def note(self) -> Callable[[Taught], dict[str, NDArray[Any]]]: ...

    @property
    def policy(self) -> Policy:
        """As it is, to drive with."""
        ...

    def losses(self, rounds: Sequence[Rows], rng: np.random.Generator) -> Iterator[Tensor]:
        """The loss of one minibatch after the other, without end, each of the tensors as they are then.

        Args:
            rounds: what was noted in them.
            rng: draws the minibatches.
        """
        ...

    def averaged(self) -> dict[str, NDArray[np.float32]]:
        """The average of its tensors, as described by a card's `shapes`."""
        ...


def note_numbers(drive: Taught) -> dict[str, NDArray[Any]]:
    """What was seen and said, step by step, where somebody was asked."""
    told = drive.driving & np.isfinite(drive.said).all(axis=2)
    return {"seen": drive.seen[told], "said": drive.said[told]}


class NumbersPupil:
    """A pupil that is told numbers and remembers nothing.

    Attributes:
        trained, note: as of `Pupil`.
    """

    def __init__(
        self, card: Card, batch: int, mirrored: bool, tensors: dict[str, NDArray[np.float32]]
    ) -> None:
        """A pupil at its beginning.

        Args:
            card: of the policy.
            batch: rows of a minibatch.
            mirrored: whether half of them are seen in the mirror.
            tensors: its first ones, of the card's shapes.
        """
        self._card, self._batch = card, batch
        self._mirror = mirror(card.observation) if mirrored else None
        self._tensors = tensors
        self.trained = Actor(encoded(card, self._tensors, mean_network(self._tensors, ACTION_SIZE)))
        self.note = note_numbers

    @property
    def policy(self) -> Policy:
        """As it is, to drive with."""
        return StatelessPolicy(self._card.observation, self.trained.network)

    def losses(self, rounds: Sequence[Rows], rng: np.random.Generator) -> Iterator[Tensor]:
        """As of `Pupil`."""
        seen, said = (torch.cat([rows[name] for rows in rounds]) for name in ("seen", "said"))
        while True:
            chosen = torch.from_numpy(rng.integers(len(seen), size=self._batch))
            inputs, targets = seen[chosen], said[chosen]
            if self._mirror is not None:
                half = self._batch // 2
                inputs[:half], targets[:half] = self._mirror.seen(inputs[:half]), turned(targets[:half])
            yield error(self.trained.means(inputs), targets)

    def averaged(self) -> dict[str, NDArray[np.float32]]:
        """As of `Pupil`."""
        tensors = {name: tensor.copy() for name, tensor in self._tensors.items()}
        for name, layer in self.trained.averages():
            tensors[name][..., : layer.shape[-1]] = layer
        return tensors


def error(means: Tensor, said: Tensor) -> Tensor:
    """How far actions (.., 2) are from what was said."""
    weights = torch.tensor([1.0, STEERING])
    return smooth_l1_loss(weights * means, weights * said, beta=NEAR)


def fresh(card: Card, rng: np.random.Generator) -> dict[str, NDArray[np.float32]]:
    """Tensors of a policy that has learnt nothing: uniform within 1 / sqrt(fan in), as those of torch.nn.

    Args:
        card: which the tensors have the shapes of.
        rng: draws them.
    """
    tensors: dict[str, NDArray[np.float32]] = {}
    rows = card.widths[0]
    for name, shape in card.shapes.items():
        if len(shape) > 1:
            rows = math.prod(shape[1:]) if len(shape) > 2 else shape[0]
        tensors[name] = rng.uniform(-1.0, 1.0, shape).astype(np.float32) / np.float32(math.sqrt(rows))
    last = len(card.hidden)
    tensors[f"{last}.weight"][:, ACTION_SIZE:] = 0.0
    tensors[f"{last}.bias"][ACTION_SIZE:] = DEVIATION
    return tensors
