"""Multilayer perceptrons, run by numpy; those for a few rows by a kernel."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from nathlon.policies.policy import Batch
from nathlon.sim.kernel import fused, lean_inlined, lean_kernel

FEW = 4
"""Rows up to which a kernel is faster than BLAS, which would first copy all weights.

Its outputs of a row do not depend, to the last bit, on the rows beside it.
"""
AT_ONCE = 4
"""Inputs of a layer that are weighed between two looks at its sums."""
STARTS = tuple(np.array([0, rows]) for rows in range(FEW + 1))


FUNCTIONS: dict[str, Callable[[Batch], Any]] = {
    "relu": lambda sums: np.maximum(sums, 0.0, out=sums),
    "tanh": lambda sums: np.tanh(sums, out=sums),
    "clip": lambda sums: np.clip(sums, -1.0, 1.0, out=sums),
    "linear": lambda sums: sums,
}
"""Of a layer's sums, number by number, in place; what is not a number stays so."""


@lean_kernel
def _add_and_rectify(sums: Batch, bias: Batch) -> None:
    """Add the bias, then `relu`: numpy, in two goes, would make a network a seventh slower."""
    for row in range(len(sums)):
        for unit in range(len(bias)):
            total = sums[row, unit] + bias[unit]
            sums[row, unit] = np.float32(0.0) if total < 0.0 else total


@lean_inlined
def accumulate(
    inputs: Batch, begin: int, end: int, used: NDArray[np.int64], weights: Batch, sums: Batch
) -> None:
    """Add to rows of sums (n, outputs), from begin to end, those of inputs (n, inputs) by weights.

    A product is added to a sum in the order of the inputs, and both are rounded once, so that all processors
    come to the same.

    Args:
        used: indices of the inputs that count, rising.
    """
    units = weights.shape[1]
    whole = len(used) - len(used) % AT_ONCE
    for first in range(0, whole, AT_ONCE):
        i, j, k, m = used[first], used[first + 1], used[first + 2], used[first + 3]
        for row in range(begin, end):
            a, b, c, d = inputs[row, i], inputs[row, j], inputs[row, k], inputs[row, m]
            for unit in range(units):
                total = fused(a, weights[i, unit], sums[row, unit])
                total = fused(b, weights[j, unit], total)
                total = fused(c, weights[k, unit], total)
                sums[row, unit] = fused(d, weights[m, unit], total)
    for i in used[whole:]:
        for row in range(begin, end):
            for unit in range(units):
                sums[row, unit] = fused(inputs[row, i], weights[i, unit], sums[row, unit])


@lean_kernel
def _weigh(
    inputs: Batch,
    starts: NDArray[np.int64],
    weights: Batch,
    biases: Batch,
    used: NDArray[np.int64],
    sums: Batch,
) -> None:
    """Sums (n, outputs) of layers (networks, inputs, outputs); rows of a network begin and end at starts.

    Inputs that are 0 add nothing, and what units leave is 0 more often than not: their weights are not read.
    `used` has room for the indices of all inputs.
    """
    networks, size, units = weights.shape
    for network in range(networks):
        begin, end = starts[network], starts[network + 1]
        for row in range(begin, end):
            for unit in range(units):
                sums[row, unit] = biases[network, unit]
        count = 0
        for at in range(size):
            for row in range(begin, end):
                if inputs[row, at] != 0.0:
                    used[count] = at
                    count += 1
                    break
        accumulate(inputs, begin, end, used[:count], weights[network], sums)


@dataclass(frozen=True)
class Mlp:
    """Layers with one function between them and another one after the last.

    Attributes:
        layers: weight (inputs, outputs) and bias (outputs,) of each, float32.
        hidden: function of each layer but the last.
        output: function of the last; `clip` is to [-1, 1], `linear` none.
    """

    layers: tuple[tuple[Batch, Batch], ...]
    hidden: Literal["relu", "tanh", "linear"]
    output: Literal["relu", "tanh", "clip", "linear"]

    def __call__(self, inputs: Batch) -> Batch:
        """Outputs (n, outputs) float32 of inputs (n, inputs) float32, which are left as they are."""
        if len(inputs) <= FEW:
            return self._alone(inputs, STARTS[len(inputs)])
        layer = inputs
        for index, (weight, bias) in enumerate(self.layers, 1):
            layer = layer @ weight
            function = self.hidden if index < len(self.layers) else self.output
            if function == "relu":
                _add_and_rectify(layer, bias)
            else:
                layer += bias
                FUNCTIONS[function](layer)
        return layer

    @property
    def shape(self) -> tuple[object, ...]:
        """The same for networks that an `MlpStack` can hold together."""
        return (self.hidden, self.output, *(weight.shape for weight, _ in self.layers))

    @property
    def size(self) -> int:
        """How many weights it has, without biases."""
        return sum(weight.size for weight, _ in self.layers)

    def alike(self, inputs: Batch) -> Batch:
        """The same, of which each row is to the last bit what it is in any other batch."""
        return self._alone(inputs, np.array([0, len(inputs)]))

    @cached_property
    def _alone(self) -> MlpStack:
        return MlpStack([self])


class MlpStack:
    """Perceptrons of one shape, each for a few rows: outputs of a row are those that `Mlp` has for it."""

    def __init__(self, networks: Sequence[Mlp]) -> None:
        """Networks of the same `Mlp.shape`."""
        inner = len(networks[0].layers) - 1
        self._functions = [*[networks[0].hidden] * inner, networks[0].output]
        self._layers = [
            tuple(map(_stacked, zip(*layers, strict=True)))
            for layers in zip(*(network.layers for network in networks), strict=True)
        ]

    def __call__(self, inputs: Batch, starts: NDArray[np.int64]) -> Batch:
        """Outputs (n, outputs) float32.

        Args:
            inputs: (n, inputs) float32, those of the first network first.
            starts: (networks + 1,) int64, where the rows of each network begin, and n.
        """
        layer = np.ascontiguousarray(inputs, np.float32)
        for (weights, biases), function in zip(self._layers, self._functions, strict=True):
            _, size, units = weights.shape
            sums = np.empty((len(layer), units), np.float32)
            _weigh(layer, starts, weights, biases, np.empty(size, np.int64), sums)
            FUNCTIONS[function](sums)
            layer = sums
        return layer


def _stacked(parts: Sequence[Batch]) -> Batch:
    """Arrays of one shape as one; of a single one no copy, if its rows lie in a row."""
    return np.stack(parts) if len(parts) > 1 else np.ascontiguousarray(parts[0])[None]


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

    def __reduce__(self) -> tuple[object, ...]:
        # What it has folded last is none of its own.
        return type(self), (self.encoder, self.network, self.facts)

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
