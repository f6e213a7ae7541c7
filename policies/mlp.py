"""Multilayer perceptrons, run by numpy."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from nathlon.policies.policy import Batch
from nathlon.sim.kernel import lean_kernel

FEW = 4
"""Rows up to which they are multiplied one by one."""


@lean_kernel
def _relu(sums: Batch, bias: Batch) -> None:
    for row in range(len(sums)):
        for unit in range(len(bias)):
            total = sums[row, unit] + bias[unit]
            sums[row, unit] = np.float32(0.0) if total < 0.0 else total  # so that nan stays nan


def _weigh(layer: Batch, weight: Batch) -> Batch:
    """Their product. Of a few rows one by one: for a matrix, BLAS would first copy all weights."""
    if len(layer) > FEW:
        return layer @ weight
    sums = np.empty((len(layer), weight.shape[1]), np.float32)
    for row, total in zip(layer, sums, strict=True):
        np.dot(row, weight, out=total)
    return sums


def _tanh(sums: Batch, bias: Batch) -> None:
    sums += bias
    np.tanh(sums, out=sums)


def _clip(sums: Batch, bias: Batch) -> None:
    sums += bias
    np.clip(sums, -1.0, 1.0, out=sums)


def _linear(sums: Batch, bias: Batch) -> None:
    sums += bias


FUNCTIONS = {"relu": _relu, "tanh": _tanh, "clip": _clip, "linear": _linear}
"""Of a layer's weighted inputs (n, outputs) and bias (outputs,), in place."""


@dataclass(frozen=True)
class Mlp:
    """Layers with one function between them and another one after the last.

    Attributes:
        layers: weight (inputs, outputs) and bias (outputs,) of each, float32.
        hidden: function of each layer but the last.
        output: function of the last; `clip` is to [-1, 1], `linear` none.
    """

    layers: tuple[tuple[Batch, Batch], ...]
    hidden: Literal["relu", "tanh"]
    output: Literal["tanh", "clip", "linear"]

    def __call__(self, inputs: Batch) -> Batch:
        """Outputs (n, outputs) float32 of inputs (n, inputs) float32, which are left as they are."""
        layer = inputs
        for index, (weight, bias) in enumerate(self.layers, 1):
            layer = _weigh(layer, weight)
            FUNCTIONS[self.hidden if index < len(self.layers) else self.output](layer, bias)
        return layer
