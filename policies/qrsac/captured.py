"""Updates of QR-SAC as one CUDA graph."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import NamedTuple

import torch
from torch import Tensor

from nathlon.policies.qrsac.update import Metrics, Minibatch, Noise, Pace, State
from nathlon.policies.replay_buffer.table import Batch

Run = Callable[[State, Pace, Minibatch, Noise], Metrics]
"""One update, which overwrites the state."""


class Inputs(NamedTuple):
    """All that an update needs besides the state."""

    pace: Pace
    batch: Minibatch
    noise: Noise

    def tensors(self) -> list[Tensor]:
        """Those there are, in one order."""
        assert isinstance(self.batch, Batch), "passages are not captured"
        parts = (*self.pace, *self.batch, *self.noise)
        return [tensor for tensor in parts if tensor is not None]

    def clone(self) -> Inputs:
        """Copies in memory of their own."""
        assert isinstance(self.batch, Batch), "passages are not captured"
        seed = self.noise.seed
        return Inputs(
            Pace(*(tensor.clone() for tensor in self.pace)),
            Batch(*(tensor.clone() for tensor in self.batch)),
            Noise(
                self.noise.action.clone(),
                self.noise.next_action.clone(),
                seed.clone() if seed is not None else None,
            ),
        )


class CapturedUpdates:
    """A number of updates in a row that the processor starts as one, as networks of a few hundred units
    take the device less time than it takes to start their kernels one by one.
    """

    def __init__(self, run: Run, state: State, example: Inputs, count: int) -> None:
        """Capture them; the state is as before afterwards.

        Args:
            run: one update.
            state: on the device; the graph overwrites these very tensors.
            example: inputs of the shapes to come, on the device.
            count: of updates.
        """
        self._inputs = [example.clone() for _ in range(count)]
        before = [tensor.clone() for tensor in state]
        # What is compiled or allocated once must be there before the capture, made beside the main stream.
        stream = torch.cuda.Stream()  # type: ignore[no-untyped-call]
        stream.wait_stream(torch.cuda.current_stream())
        with torch.cuda.stream(stream):
            run(state, *self._inputs[0])
        torch.cuda.current_stream().wait_stream(stream)
        self._graph = torch.cuda.CUDAGraph()
        with torch.cuda.graph(self._graph):
            for inputs in self._inputs:
                self._metrics = run(state, *inputs)
        for tensor, old in zip(state, before, strict=True):
            tensor.copy_(old)

    def __call__(self, inputs: Iterable[Inputs]) -> Metrics:
        """Makes the updates, taking as many inputs, one after the other; the metrics are of the last."""
        for place, fresh in zip(self._inputs, inputs, strict=True):
            for old, new in zip(place.tensors(), fresh.tensors(), strict=True):
                old.copy_(new)
        self._graph.replay()
        return {name: value.clone() for name, value in self._metrics.items()}
