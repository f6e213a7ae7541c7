"""The network of a policy that sees, in training."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from nathlon.policies.checkpoint import ACTION_SIZE, Card, SeeingPolicy
from nathlon.policies.policy import Batch, Observations, Policy
from nathlon.policies.qrsac.recurrent import linear, perceptron, recall
from nathlon.policies.training.actor import Saturating, Trained
from nathlon.sim.observation import NUMBERS, PICTURE


class SeeingActor(Trained):
    """The network of `nathlon.policies.vision` in PyTorch.

    Attributes:
        tensors_by_name: as of a card's `shapes`, and others that stand beside them.
    """

    def __init__(self, card: Card, tensors: Mapping[str, NDArray[np.float32]]) -> None:
        """Copies of tensors; the card has a vision."""
        assert card.vision is not None, "who sees has a vision"
        self._card, self._strides = card, card.vision.strides
        self.tensors_by_name = {
            name: torch.from_numpy(tensor.copy()).requires_grad_() for name, tensor in tensors.items()
        }
        super().__init__(list(self.tensors_by_name.values()))

    @property
    def policy(self) -> Policy:
        """The tensors as they are, to drive with."""
        own = {name: self.tensors_by_name[name].detach().numpy().copy() for name in self._card.shapes}
        return SeeingPolicy(self._card, "", own)

    def averages(self) -> Iterator[tuple[str, NDArray[np.float32]]]:
        """The average of the tensors that a checkpoint has, by name."""
        for name, tensor in zip(self.tensors_by_name, self._averages, strict=True):
            if name in self._card.shapes:
                yield name, tensor.numpy()

    def inputs(self, seen: Observations, memory: Batch) -> tuple[Tensor, ...]:
        """What `means` takes, for records (n,) and memory (n, m)."""
        parts = (seen[PICTURE], seen[NUMBERS], memory)
        return tuple(torch.from_numpy(np.ascontiguousarray(part)) for part in parts)

    def means(self, pictures: Tensor, sensors: Tensor, memory: Tensor) -> Tensor:
        """Mean actions (n, 2) of a step, given what was remembered before; see `inputs`."""
        known, _ = self.recall(pictures[:, None], sensors[:, None], memory)
        return self.actions(known[:, 0])

    def recall(self, pictures: Tensor, sensors: Tensor, memory: Tensor) -> tuple[Tensor, Tensor]:
        """What is known at each step of some passages.

        Args:
            pictures: (passages, steps, height, width, channels) uint8.
            sensors: (passages, steps, numbers) float32.
            memory: (passages, m) float32, before the first step.

        Returns:
            (passages, steps, k), what the perceptron takes, and the memory after the last step.
        """
        return recall(self.tensors_by_name, self._strides, [sensors, pictures], memory)

    def actions(self, known: Tensor) -> Tensor:
        """Mean actions (.., 2) by what is known, (.., k)."""
        sums = perceptron(self.tensors_by_name, len(self._card.hidden), known)[..., :ACTION_SIZE]
        means: Tensor = Saturating.apply(sums)
        return means

    def linear(self, prefix: str, inputs: Tensor) -> Tensor:
        """What a layer makes of inputs (.., i)."""
        return linear(self.tensors_by_name, prefix, inputs)
