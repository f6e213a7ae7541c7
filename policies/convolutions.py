"""Convolutions of pictures, run by a kernel, and the network that Stable-Baselines3 calls `NatureCNN`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from nathlon.policies.mlp import Mlp, accumulate
from nathlon.policies.policy import Batch
from nathlon.sim.kernel import lean_kernel

STRIDES = (4, 2, 1)
"""Of its three layers."""


@dataclass(frozen=True)
class NatureCnn:
    """Three convolutions and a layer of units, each with ReLU (Mnih et al., 2015).

    Attributes:
        layers: weights (outputs, channels, height, width) and bias (outputs,) of each convolution, float32.
        last: the layer of units, of all that the last convolution gives.
    """

    layers: tuple[tuple[Batch, Batch], ...]
    last: Mlp

    def __call__(self, pictures: NDArray[np.float32]) -> Batch:
        """Features (n, units) float32 of pictures (n, channels, height, width) float32."""
        seen = pictures
        for (weight, bias), stride in zip(self.layers, STRIDES, strict=True):
            seen = convolved(seen, weight, bias, stride)
        return self.last(np.ascontiguousarray(seen.reshape(len(seen), -1)))


def size_after(height: int, width: int, layers: Sequence[tuple[int, int]]) -> tuple[int, int]:
    """Height and width that layers, given by side and stride, leave of a picture; 0 if it is too small."""
    for side, stride in layers:
        height, width = ((size - side) // stride + 1 if size >= side else 0 for size in (height, width))
    return height, width


def convolved(seen: NDArray[np.float32], weight: Batch, bias: Batch, stride: int) -> NDArray[np.float32]:
    """ReLU of convolutions of pictures (n, channels, h, w) by weights (outputs, channels, high, wide).

    What comes of a picture does not depend, to the last bit, on those beside it.
    """
    outputs, channels, high, wide = weight.shape
    height, width = (
        (size - side) // stride + 1 for size, side in zip(seen.shape[2:], (high, wide), strict=True)
    )
    sums = np.empty((len(seen), outputs, height * width), np.float32)
    columns = np.empty((channels, high, wide, height, width), np.float32)
    rows = columns.reshape(channels * high * wide, height * width)
    every = np.arange(len(rows))
    _convolve(
        np.ascontiguousarray(seen), weight.reshape(outputs, -1), bias, stride, columns, rows, every, sums
    )
    return sums.reshape(len(seen), outputs, height, width)


@lean_kernel
def _convolve(
    pictures: NDArray[np.float32],
    weights: Batch,
    bias: Batch,
    stride: int,
    columns: NDArray[np.float32],
    rows: Batch,
    every: NDArray[np.int64],
    sums: NDArray[np.float32],
) -> None:
    """Sums (n, outputs, places) of pictures.

    `columns`, (channels, high, wide, height, width), takes what each place sees of one, `rows` are they
    with a row for each input of a filter, and `every` has the indices of all rows.
    """
    channels, high, wide, height, width = columns.shape
    _, outputs, places = sums.shape
    for picture in range(len(pictures)):
        for channel in range(channels):
            for down in range(high):
                for across in range(wide):
                    for y in range(height):
                        for x in range(width):
                            columns[channel, down, across, y, x] = pictures[
                                picture, channel, y * stride + down, x * stride + across
                            ]
        for output in range(outputs):
            for place in range(places):
                sums[picture, output, place] = bias[output]
        accumulate(weights, 0, outputs, every, rows, sums[picture])
        for output in range(outputs):
            for place in range(places):
                if sums[picture, output, place] < np.float32(0.0):
                    sums[picture, output, place] = np.float32(0.0)
