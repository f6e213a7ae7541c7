"""Long short-term memories, run by numpy."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from nathlon.policies.mlp import Mlp
from nathlon.policies.policy import Batch


def _sigmoid(values: Batch) -> Batch:
    return np.float32(0.5) * (np.tanh(np.float32(0.5) * values) + np.float32(1.0))  # never overflows


@dataclass(frozen=True)
class Lstm:
    """Layers of an LSTM (Hochreiter and Schmidhuber, 1997), and what follows the last one.

    Attributes:
        layers: of each, weights of the inputs (i, 4h) and of the layer's own outputs (h, 4h), and bias (4h,),
            float32. The quarters are input gate, forget gate, cell and output gate.
        head: from the outputs of the last layer.
    """

    layers: tuple[tuple[Batch, Batch, Batch], ...]
    head: Mlp

    def initial_memory(self, n: int) -> Batch:
        """Zeros (n, m): outputs and cells of each layer in turn."""
        return np.zeros((n, sum(2 * len(own) for _, own, _ in self.layers)), np.float32)

    def act(self, observations: Batch, memory: Batch) -> tuple[Batch, Batch]:
        """Numbers (n, k) float32 for observations (n, size) float32, and memory (n, m) float32."""
        inputs, kept, place = observations, [], 0
        for weight, own, bias in self.layers:
            units = len(own)
            before, cell = memory[:, place : place + units], memory[:, place + units : place + 2 * units]
            place += 2 * units
            sums = inputs @ weight + before @ own + bias
            enter, forget, new, leave = np.split(sums, 4, axis=1)
            cell = _sigmoid(forget) * cell + _sigmoid(enter) * np.tanh(new)
            inputs = _sigmoid(leave) * np.tanh(cell)
            kept += [inputs, cell]
        return self.head(inputs), np.concatenate(kept, axis=1)
