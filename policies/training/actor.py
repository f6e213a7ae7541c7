"""Policies in training: tensors that follow their gradients, their average, and their optimiser."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.nn.functional import linear
from torch.optim.adam import adam

from nathlon.policies.checkpoint import ENCODER
from nathlon.policies.mlp import EncodedMlp, Mlp
from nathlon.policies.policy import Batch, Observations

LEAST_SLOPE, UTMOST = 0.1, 0.9993
"""Of the tangent, and the action beyond which it has its own."""
MOMENTS = ("exp_avg", "exp_avg_sq")
"""Adam's, by PyTorch's names."""


class Saturating(torch.autograd.Function):
    """The hyperbolic tangent, with a slope that lets go of what saturates.

    Its own slope all but ends where a pedal is down, so that no return could lift a foot. Further out than
    `UTMOST` nothing is pushed, so that it stays within reach.
    """

    @staticmethod
    def forward(context: Any, sums: Tensor) -> Tensor:
        means = torch.tanh(sums)
        context.save_for_backward(means)
        return means

    @staticmethod
    def backward(context: Any, gradient: Tensor) -> Tensor:
        (means,) = context.saved_tensors
        slope = 1.0 - means.square()
        outward = (gradient * means < 0.0) & (means.abs() > UTMOST)
        return gradient * torch.where(outward, slope, slope.clamp(min=LEAST_SLOPE))


class Trained:
    """Tensors that are trained by their gradients."""

    def __init__(self, parameters: Sequence[Tensor]) -> None:
        """Float32 tensors that require gradients."""
        self._all = list(parameters)
        self._averages = [tensor.detach().clone() for tensor in self._all]
        self._adam = [
            {"step": torch.tensor(0.0)} | {name: torch.zeros_like(tensor.detach()) for name in MOMENTS}
            for tensor in self._all
        ]

    def step(self, loss: Tensor, rate: float) -> None:
        """Move the tensors down the gradient of a loss, by Adam."""
        gradients = torch.autograd.grad(loss, self._all)
        step, mean, square = ([state[name] for state in self._adam] for name in ("step", *MOMENTS))
        # As a function: `torch.optim.Adam` reads PyTorch's compiler, which takes seconds.
        with torch.no_grad():
            adam(
                self._all, list(gradients), mean, square, [], step, foreach=False, amsgrad=False,
                beta1=0.9, beta2=0.999, lr=rate, weight_decay=0.0, eps=1e-8, maximize=False,
            )  # fmt: skip

    def average(self, share: float) -> None:
        """Move the average of the tensors towards them as they are.

        Args:
            share: of the way, in 0..1.
        """
        for average, tensor in zip(self._averages, self._all, strict=True):
            average.lerp_(tensor.detach(), share)

    def tensors(self) -> dict[str, Tensor]:
        """The tensors, their average and the optimiser's state, by name."""
        tensors = {}
        for index, tensor in enumerate(self._all):
            tensors[f"parameter.{index}"] = tensor.detach().clone()
            tensors[f"average.{index}"] = self._averages[index].clone()
            for name, value in self._adam[index].items():
                tensors[f"adam.{index}.{name}"] = value.clone()
        return tensors

    def load(self, tensors: Mapping[str, Tensor]) -> None:
        """Go on from what `tensors` gave.

        Raises:
            ValueError: naming the one that is missing, of another shape or type, or not finite.
        """
        expected = self.tensors()
        for name, own in expected.items():
            found = tensors.get(name)
            if found is None:
                raise ValueError(f"tensor {name!r} is missing")
            if found.shape != own.shape or found.dtype != own.dtype or not found.isfinite().all():
                raise ValueError(
                    f"tensor {name!r} is {tuple(found.shape)} {found.dtype}, "
                    f"expected {tuple(own.shape)} finite numbers of {own.dtype}"
                )
        for index, tensor in enumerate(self._all):
            tensor.data.copy_(tensors[f"parameter.{index}"])
            self._averages[index].copy_(tensors[f"average.{index}"])
            self._adam[index] = {name: tensors[f"adam.{index}.{name}"] for name in ("step", *MOMENTS)}


class Actor(Trained):
    """Layers that are trained by their gradients.

    Attributes:
        layers: weight (in, out) and bias (out,) of each, float32.
        encoder: the same of the encoder; empty where there is none.
    """

    def __init__(self, network: Mlp | EncodedMlp) -> None:
        """Copies of a network's layers."""
        trunk = network.network if isinstance(network, EncodedMlp) else network
        self.layers = _parameters(trunk)
        self.encoder = _parameters(network.encoder) if isinstance(network, EncodedMlp) else []
        self._facts = network.facts if isinstance(network, EncodedMlp) else 0
        super().__init__([tensor for layer in (*self.layers, *self.encoder) for tensor in layer])

    @property
    def network(self) -> Mlp | EncodedMlp:
        """The layers as they are, to drive with."""
        trunk = Mlp(_arrays(self.layers), "relu", "tanh")
        if not self.encoder:
            return trunk
        return EncodedMlp(Mlp(_arrays(self.encoder), "relu", "relu"), trunk, self._facts)

    def inputs(self, seen: Observations, memory: Batch) -> tuple[Tensor, ...]:
        """What `means` takes, for observations (n, size); nothing is remembered."""
        return (torch.from_numpy(seen),)

    def means(self, seen: Tensor) -> Tensor:
        """Mean actions (n, 2) for observations (n, size)."""
        *hidden, (weight, bias) = self.layers
        layer = seen
        if self.encoder:
            facts = seen[:, -self._facts :]
            for each, shift in self.encoder:
                facts = torch.relu(linear(facts, each.T, shift))
            layer = torch.cat([seen[:, : -self._facts], facts], dim=1)
        for each, shift in hidden:
            layer = torch.relu(linear(layer, each.T, shift))
        means: Tensor = Saturating.apply(linear(layer, weight.T, bias))
        return means

    def averages(self) -> Iterator[tuple[str, NDArray[np.float32]]]:
        """The average of the layers, by the names that they have in a checkpoint."""
        averages = iter(self._averages)
        for prefix, layers in (("", self.layers), (ENCODER, self.encoder)):
            for index in range(len(layers)):
                yield f"{prefix}{index}.weight", next(averages).numpy()
                yield f"{prefix}{index}.bias", next(averages).numpy()


def _parameters(network: Mlp) -> list[tuple[Tensor, Tensor]]:
    return [
        (torch.from_numpy(weight.copy()).requires_grad_(), torch.from_numpy(bias.copy()).requires_grad_())
        for weight, bias in network.layers
    ]


def _arrays(
    layers: Sequence[tuple[Tensor, Tensor]],
) -> tuple[tuple[NDArray[np.float32], NDArray[np.float32]], ...]:
    return tuple((weight.detach().numpy(), bias.detach().numpy()) for weight, bias in layers)
