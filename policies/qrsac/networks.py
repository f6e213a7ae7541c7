"""Policy and critics as functions of flat parameter vectors.

A network's parameters lie in one vector, so that clipping, Adam and target mixing are a few operations
on one tensor each, and a compiled update sees plain tensors only.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import ClassVar, TypeVar

import torch
from torch import Tensor
from torch.nn import functional as F

T = TypeVar("T")

# Of the covariance clipped to (e^-40, e^4).
LOG_STD_RANGE = (-20.0, 2.0)


@dataclass(frozen=True)
class Perceptron:
    """Shape of a multi-layer perceptron with ReLU between its layers, or of a stack of equal ones.

    With an encoder, the last numbers of the input first go through layers of their own: what they say in many
    numbers, and always the same in a race, then reaches the others in few.

    Attributes:
        widths: sizes of the input, each hidden layer and the output; with an encoder, its output stands for
            what it encodes.
        encoder: sizes of what is encoded and of each of its layers, all with ReLU; empty for none.
        stack: () for one network, (n,) for n networks that run as one batched product.
        layer_norm: whether each hidden layer is standardised before its ReLU.
        precision: of the hidden layers' matrix products; all else is float32. So is the last product: returns
            of 100 rounded to bfloat16 are off by up to 0.25, more than most actions matter.
    """

    widths: tuple[int, ...]
    encoder: tuple[int, ...] = ()
    stack: tuple[int, ...] = ()
    layer_norm: bool = False
    precision: torch.dtype = torch.float32
    memory: ClassVar[int] = 0
    """It remembers nothing."""

    @property
    def shapes(self) -> list[tuple[int, ...]]:
        """Shapes of weight (*stack, in, out) and bias (*stack, 1, out) of each layer, the encoder's first."""
        return [(*self.stack, rows, width) for fan_in, width in self._layers for rows in (fan_in, 1)]

    @property
    def _layers(self) -> list[tuple[int, int]]:
        return [*pairwise(self.encoder), *pairwise(self.widths)]

    def initial(self, generator: torch.Generator) -> Tensor:
        """Fresh parameters, (p,) float32: uniform within 1 / sqrt(fan in), as torch.nn.Linear."""
        parts = []
        for (weight, bias), (fan_in, _) in zip(_pairs(self.shapes), self._layers, strict=True):
            for shape in (weight, bias):
                uniform = torch.rand(math.prod(shape), generator=generator, device=generator.device)
                parts.append((2.0 * uniform - 1.0) / math.sqrt(fan_in))
        return torch.cat(parts)

    def tensors(self, parameters: Tensor) -> list[Tensor]:
        """The weights and biases in the order of `shapes`: views of the parameters (p,)."""
        parts = torch.split(parameters, [math.prod(shape) for shape in self.shapes])
        return [part.view(shape) for part, shape in zip(parts, self.shapes, strict=True)]

    def __call__(
        self, parameters: Tensor, inputs: Tensor, exact: Tensor | None = None, kept: Tensor | None = None
    ) -> Tensor:
        """The outputs (*stack, n, widths[-1]) for inputs of widths[0] numbers in all, those encoded apart.

        Args:
            parameters: (p,).
            inputs: (*stack, n, i), one matrix of rows for each network of the stack.
            exact: (*stack, n, e), further inputs behind these, multiplied in float32 and on their own: what
                wants a gradient of such alone does without the product for all others.
            kept: factors (n, sum of the hidden widths) on the hidden units: 0 for a dropped one,
                1 / (1 - dropout) for a kept one; None for evaluation.
        """
        hidden = self.widths[1:-1]
        factors = torch.split(kept, list(hidden), dim=-1) if kept is not None else None
        *layers, (last_weight, last_bias) = _pairs(self.tensors(parameters))
        if self.encoder:
            steps = len(self.encoder) - 1
            inputs, layers = self._encoded(inputs, layers[:steps]), layers[steps:]
        if exact is not None:
            (weight, bias), *others = layers
            rows = inputs.shape[-1]
            layers = [(weight[..., :rows, :], bias + exact @ weight[..., rows:, :]), *others]
        for i, (weight, bias) in enumerate(layers):
            inputs = (inputs.to(self.precision) @ weight.to(self.precision)).float() + bias
            if self.layer_norm:
                inputs = F.layer_norm(inputs, inputs.shape[-1:])
            inputs = torch.relu(inputs)
            if factors is not None:
                inputs = inputs * factors[i]
        return inputs @ last_weight + last_bias

    def _encoded(self, inputs: Tensor, layers: list[tuple[Tensor, Tensor]]) -> Tensor:
        """The inputs, of which the last ones have gone through these layers."""
        facts = inputs[..., -self.encoder[0] :]
        for weight, bias in layers:
            facts = torch.relu((facts.to(self.precision) @ weight.to(self.precision)).float() + bias)
        return torch.cat([inputs[..., : -self.encoder[0]], facts], dim=-1)


def _pairs(items: list[T]) -> list[tuple[T, T]]:
    return list(zip(items[::2], items[1::2], strict=True))


def squashed_normal(outputs: Tensor, noise: Tensor) -> tuple[Tensor, Tensor]:
    """Actions of a tanh-squashed diagonal normal and the logarithm of their density.

    Args:
        outputs: (n, 2a), the policy's outputs: means, then logarithms of the standard deviations.
        noise: (n, a), standard normal.

    Returns:
        actions (n, a) in [-1, 1] and log densities (n,).
    """
    mean, log_std = outputs.chunk(2, dim=-1)
    log_std = log_std.clamp(*LOG_STD_RANGE)
    raw = mean + log_std.exp() * noise
    log_normal = -0.5 * noise.square() - log_std - 0.5 * math.log(2.0 * math.pi)
    # log(1 - tanh(x)^2) in a form that does not cancel for large x
    log_slope = 2.0 * (math.log(2.0) - raw - F.softplus(-2.0 * raw))
    return torch.tanh(raw), (log_normal - log_slope).sum(-1)
