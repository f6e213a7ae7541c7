"""Multilayer perceptrons, run by plain numpy."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from policies.policy import Batch


def _relu(layer: Batch) -> Batch:
    return np.maximum(layer, 0.0, out=layer)


def _tanh(layer: Batch) -> Batch:
    return np.tanh(layer, out=layer)


def _clip(layer: Batch) -> Batch:
    return np.clip(layer, -1.0, 1.0, out=layer)


FUNCTIONS = {"relu": _relu, "tanh": _tanh, "clip": _clip}


@dataclass(frozen=True)
class Mlp:
    """Layers with one function between them and another one after the last.

    Attributes:
        layers: weight (inputs, outputs) and bias (outputs,) of each, float32.
        hidden: function of each layer but the last.
        output: function of the last; `clip` is to [-1, 1].
    """

    layers: tuple[tuple[Batch, Batch], ...]
    hidden: Literal["relu", "tanh"]
    output: Literal["tanh", "clip"]

    def __call__(self, inputs: Batch) -> Batch:
        """Outputs (n, outputs) float32 of inputs (n, inputs) float32, which are left as they are."""
        layer = inputs
        for index, (weight, bias) in enumerate(self.layers, 1):
            layer = layer @ weight
            layer += bias
            layer = FUNCTIONS[self.hidden if index < len(self.layers) else self.output](layer)
        return layer
