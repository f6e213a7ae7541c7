"""The network of pictures that Stable-Baselines3 calls `NatureCNN` (Mnih et al., 2015), run by numpy."""

from __future__ import annotations

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
    """Three convolutions and a layer of units, each with ReLU.

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
            seen = _convolved(seen, weight, bias, stride)
        return self.last(np.ascontiguousarray(seen.reshape(len(seen), -1)))


def size_after(height: int, width: int, layers: tuple[tuple[Batch, Batch], ...]) -> int:
    """How many numbers the last convolution gives for a picture; 0 if that is too small."""
    for (weight, _), stride in zip(layers, STRIDES, strict=True):
        height, width = (
            (size - side) // stride + 1 for size, side in zip((height, width), weight.shape[2:], strict=True)
        )
        if height < 1 or width < 1:
            return 0
    return height * width * len(layers[-1][1])


def _convolved(seen: NDArray[np.float32], weight: Batch, bias: Batch, stride: int) -> NDArray[np.float32]:
    outputs, channels, high, wide = weight.shape
    windows = sliding_window_view(seen, (high, wide), axis=(2, 3))[:, :, ::stride, ::stride]
    n, _, height, width, _, _ = windows.shape
    rows = windows.transpose(0, 2, 3, 1, 4, 5).reshape(n * height * width, channels * high * wide)
    sums = rows @ weight.reshape(outputs, -1).T + bias
    rectified = np.maximum(sums, np.float32(0.0), out=sums)
    return rectified.reshape(n, height, width, outputs).transpose(0, 3, 1, 2)
