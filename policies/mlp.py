"""Multilayer perceptrons, run by numpy."""

from __future__ import annotations

from dataclasses import dataclass, replace
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
    output: Literal["relu", "tanh", "clip", "linear"]

    def __call__(self, inputs: Batch) -> Batch:
        """Outputs (n, outputs) float32 of inputs (n, inputs) float32, which are left as they are."""
        layer = inputs
        for index, (weight, bias) in enumerate(self.layers, 1):
            layer = _weigh(layer, weight)
            FUNCTIONS[self.hidden if index < len(self.layers) else self.output](layer, bias)
        return layer


class EncodedMlp:
    """Layers behind an encoder of the inputs' last numbers, which hardly ever change.

    What the encoder adds to the first layer is a bias, made anew only where those numbers change.

    Attributes:
        encoder: of the facts.
        network: of the other inputs, then what the encoder gives.
        facts: how many of the inputs, the last ones, are encoded.
    """

    def __init__(self, encoder: Mlp, network: Mlp, facts: int) -> None:
        """A network and its encoder; see the attributes."""
        (weight, bias), *others = network.layers
        self.encoder, self.network, self.facts = encoder, network, facts
        self._rows = len(weight) - len(encoder.layers[-1][1])
        self._of_facts, self._bias = weight[self._rows :], bias
        self._weight, self._others = weight[: self._rows], tuple(others)
        self._fold(np.zeros(facts, np.float32))

    def __call__(self, inputs: Batch) -> Batch:
        """Outputs (n, outputs) float32 of inputs (n, inputs) float32, which are left as they are."""
        seen, facts = inputs[:, : self._rows], inputs[:, self._rows :]
        if (facts == self._known).all():
            return self._folded(seen)
        if (facts == facts[0]).all():
            return self._fold(facts[0])(seen)
        outputs = np.empty((len(inputs), len(self._others[-1][1])), np.float32)
        kinds, which = np.unique(facts, axis=0, return_inverse=True)
        for kind, row in enumerate(kinds):
            rows = np.flatnonzero(which == kind)
            outputs[rows] = self._fold(row)(seen[rows])
        return outputs

    def _fold(self, facts: Batch) -> Mlp:
        """The layers for these facts, (facts,)."""
        bias = self._bias + (self.encoder(facts[None]) @ self._of_facts)[0]
        self._folded = replace(self.network, layers=((self._weight, bias), *self._others))
        self._known = facts.copy()
        return self._folded
