"""The network of a policy that sees, in training."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.nn.functional import conv2d, linear

from nathlon.policies.checkpoint import ACTION_SIZE, Card, SeeingPolicy
from nathlon.policies.policy import Batch, Observations, Policy
from nathlon.policies.training.actor import Saturating, Trained
from nathlon.policies.vision import PREFIX
from nathlon.sim.observation import NUMBERS, PICTURE


class SeeingActor(Trained):
    """The network of `nathlon.policies.vision` in PyTorch.

    Attributes:
        tensors_by_name: as of a card's `shapes`, and others that stand beside them.
    """

    def __init__(self, card: Card, tensors: Mapping[str, NDArray[np.float32]]) -> None:
        """Copies of tensors; the card has a vision."""
        assert card.vision is not None, "who sees has a vision"
        self._card, self._vision = card, card.vision
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
        known = torch.cat(
            [self._features(pictures.flatten(0, 1)).reshape(*pictures.shape[:2], -1), sensors], 2
        )
        if not self._vision.memory:
            return known, memory
        inputs, inputs_bias, own, own_bias = (
            self.tensors_by_name[f"{PREFIX}memory.{name}"]
            for name in ("inputs", "inputs_bias", "own", "own_bias")
        )
        weights = [inputs.T, own.T, inputs_bias, own_bias]
        known, after = torch.gru(known, memory[None], weights, True, 1, 0.0, False, False, True)
        return known, after[0]

    def _features(self, pictures: Tensor) -> Tensor:
        # The channels of a picture lie together, as those of `channels_last` do.
        seen = pictures.permute(0, 3, 1, 2).float() / 255.0
        for index, layer in enumerate(self._vision.convolutions):
            weight = self.tensors_by_name[f"{PREFIX}{index}.weight"].to(memory_format=torch.channels_last)
            seen = torch.relu(
                conv2d(seen, weight, self.tensors_by_name[f"{PREFIX}{index}.bias"], layer.stride)
            )
        return torch.relu(self.linear(f"{PREFIX}features.", seen.flatten(1)))

    def actions(self, known: Tensor) -> Tensor:
        """Mean actions (.., 2) by what is known, (.., k)."""
        last = len(self._card.hidden)
        for index in range(last):
            known = torch.relu(self.linear(f"{index}.", known))
        sums = self.linear(f"{last}.", known)[..., :ACTION_SIZE]
        means: Tensor = Saturating.apply(sums)
        return means

    def linear(self, prefix: str, inputs: Tensor) -> Tensor:
        """What a layer makes of inputs (.., i)."""
        return linear(
            inputs, self.tensors_by_name[f"{prefix}weight"].T, self.tensors_by_name[f"{prefix}bias"]
        )
