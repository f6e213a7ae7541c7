"""Convolutions of pictures, run by numpy, and the network that Stable-Baselines3 calls `NatureCNN`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from nathlon.policies.mlp import Mlp
from nathlon.policies.policy import Batch

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
    """ReLU of convolutions of pictures (n, channels, h, w) by weights (outputs, channels, high, wide)."""
    outputs, channels, high, wide = weight.shape
    windows = sliding_window_view(seen, (high, wide), axis=(2, 3))[:, :, ::stride, ::stride]
    n, _, height, width, _, _ = windows.shape
    rows = windows.transpose(0, 2, 3, 1, 4, 5).reshape(n * height * width, channels * high * wide)
    sums = rows @ weight.reshape(outputs, -1).T + bias
    rectified = np.maximum(sums, np.float32(0.0), out=sums)
    return rectified.reshape(n, height, width, outputs).transpose(0, 3, 1, 2)
