"""The networks of `nathlon.policies.vision` in PyTorch, as functions of tensors."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.nn import functional as F

from nathlon.policies.qrsac.networks import Perceptron, squashed_normal
from nathlon.policies.replay_buffer.passages import Observations, parts
from nathlon.policies.vision import PREFIX, memory_shapes
from nathlon.policies.weights import layer_shapes

Tensors = Mapping[str, Tensor]
"""By the names of a card's `shapes`."""


def linear(tensors: Tensors, prefix: str, inputs: Tensor) -> Tensor:
    """What a layer makes of inputs (.., i)."""
    return F.linear(inputs, tensors[f"{prefix}weight"].T, tensors[f"{prefix}bias"])


def features(tensors: Tensors, strides: Sequence[int], pictures: Tensor) -> Tensor:
    """Features (n, f) of pictures (n, height, width, channels) uint8."""
    # The channels of a picture lie together, as those of `channels_last` do.
    seen = pictures.permute(0, 3, 1, 2).float() / 255.0
    for index, stride in enumerate(strides):
        weight = tensors[f"{PREFIX}{index}.weight"].to(memory_format=torch.channels_last)
        seen = torch.relu(F.conv2d(seen, weight, tensors[f"{PREFIX}{index}.bias"], stride))
    return torch.relu(linear(tensors, f"{PREFIX}features.", seen.flatten(1)))


def recall(
    tensors: Tensors, strides: Sequence[int], seen: Sequence[Tensor], memory: Tensor
) -> tuple[Tensor, Tensor]:
    """What is known at each step of some passages.

    Args:
        tensors: of the network.
        strides: of its convolutions; empty for a network that is told numbers alone.
        seen: numbers (passages, steps, k) float32, then, if there are convolutions, pictures
            (passages, steps, height, width, channels) uint8.
        memory: (passages, m) float32, before the first step; m is 0 without a memory.

    Returns:
        (passages, steps, k), what the perceptron takes, and the memory after the last step.
    """
    known, *pictures = seen
    if strides:
        shown = features(tensors, strides, pictures[0].flatten(0, 1))
        known = torch.cat([shown.reshape(*known.shape[:2], -1), known], 2)
    if f"{PREFIX}memory.own" not in tensors:
        return known, memory
    inputs, inputs_bias, own, own_bias = (
        tensors[f"{PREFIX}memory.{name}"] for name in ("inputs", "inputs_bias", "own", "own_bias")
    )
    weights = [inputs.T, own.T, inputs_bias, own_bias]
    known, after = torch.gru(known, memory[None], weights, True, 1, 0.0, False, False, True)
    return known, after[0]


def perceptron(tensors: Tensors, hidden: int, known: Tensor, kept: Tensor | None = None) -> Tensor:
    """The outputs (.., o) by what is known, (.., k).

    Args:
        tensors: of the network.
        hidden: how many hidden layers it has.
        known: of `recall`.
        kept: factors (.., sum of the hidden widths) on the hidden units, or None.
    """
    first = 0
    for index in range(hidden):
        known = torch.relu(linear(tensors, f"{index}.", known))
        if kept is not None:
            known = known * kept[..., first : first + known.shape[-1]]
            first += known.shape[-1]
    return linear(tensors, f"{hidden}.", known)


@dataclass(frozen=True)
class RecurrentNetwork:
    """A policy that may see and remember, as a function of a flat vector of parameters.

    Attributes:
        shapes: of its tensors by name, in their order in the vector.
        strides: of its convolutions; empty where it is told numbers alone.
        hidden: how many hidden layers it has.
        memory: numbers that it remembers; 0 for none.
    """

    shapes: Mapping[str, tuple[int, ...]]
    strides: tuple[int, ...]
    hidden: int
    memory: int

    @classmethod
    def of_numbers(cls, size: int, memory: int, hidden: tuple[int, ...], actions: int) -> RecurrentNetwork:
        """One that is told so many numbers, and gives the means and log deviations of so many actions."""
        widths = (memory or size, *hidden, 2 * actions)
        return cls(memory_shapes(size, memory) | layer_shapes(widths), (), len(hidden), memory)

    def initial(self, generator: torch.Generator) -> Tensor:
        """Fresh parameters, (p,) float32: uniform within 1 / sqrt(fan in), as torch.nn."""
        parts, fan_in = [], 1
        for shape in self.shapes.values():
            if len(shape) > 1:
                fan_in = math.prod(shape[1:]) if len(shape) > 2 else shape[0]
            uniform = torch.rand(math.prod(shape), generator=generator, device=generator.device)
            parts.append((2.0 * uniform - 1.0) / math.sqrt(fan_in))
        return torch.cat(parts)

    def tensors(self, parameters: Tensor) -> dict[str, Tensor]:
        """Views of the parameters (p,) by name."""
        parts = torch.split(parameters, [math.prod(shape) for shape in self.shapes.values()])
        return {
            name: part.view(shape) for (name, shape), part in zip(self.shapes.items(), parts, strict=True)
        }

    def __call__(
        self,
        parameters: Tensor,
        seen: Sequence[Tensor],
        memory: Tensor,
        recalled: int,
        kept: Tensor | None = None,
    ) -> Tensor:
        """Outputs (passages, steps - recalled, o) for passages, see `recall`.

        Args:
            parameters: (p,).
            seen, memory: of `recall`.
            recalled: steps at first, which only bring the memory up to date, without a gradient.
            kept: factors on the hidden units of the others, see `perceptron`.
        """
        tensors = self.tensors(parameters)
        if recalled and self.memory:
            with torch.no_grad():
                _, memory = recall(tensors, self.strides, [part[:, :recalled] for part in seen], memory)
        known, _ = recall(tensors, self.strides, [part[:, recalled:] for part in seen], memory)
        return perceptron(tensors, self.hidden, known, kept)


Network = Perceptron | RecurrentNetwork


def act(
    network: Network,
    parameters: Tensor,
    seen: Observations,
    memory: NDArray[np.float32],
    generator: torch.Generator | None,
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Actions (n, a) in [-1, 1] of a policy without dropout, and its memory (n, m) after them.

    Args:
        network, parameters: the policy.
        seen: (n, d) numbers, or (n,) records as of `nathlon.sim.observation`.
        memory: (n, m) before; m is 0 without a memory.
        generator: on the parameters' device, draws the actions from the policy; None for the squashed mean.
    """
    device = parameters.device
    with torch.no_grad():
        there = [torch.as_tensor(part, device=device) for part in parts(seen)]
        after = torch.as_tensor(memory, device=device)
        if isinstance(network, Perceptron):
            outputs = network(parameters, there[0])
        else:
            tensors = network.tensors(parameters)
            known, after = recall(tensors, network.strides, [part[:, None] for part in there], after)
            outputs = perceptron(tensors, network.hidden, known[:, 0])
        if generator is None:
            actions = torch.tanh(outputs.chunk(2, dim=-1)[0])
        else:
            shape = (len(outputs), outputs.shape[1] // 2)
            noise = torch.randn(shape, generator=generator, device=device)
            actions = squashed_normal(outputs, noise)[0]
    return actions.cpu().numpy(), after.cpu().numpy()
