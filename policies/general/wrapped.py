"""Observations as the wrappers of Stable-Baselines3 hand them on: normalised, stacked, turned, scaled."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import prod
from typing import Any

import numpy as np
from gymnasium.spaces import Box, Space
from numpy.typing import NDArray

from nathlon.policies.general.policy import Network
from nathlon.policies.policy import Batch
from nathlon.policies.sources.vec_normalize import Normal


def is_picture(space: Space[Any]) -> bool:
    """Whether Stable-Baselines3 takes a space for one of pictures."""
    return (
        isinstance(space, Box)
        and len(space.shape) == 3
        and space.dtype == np.uint8
        and bool((space.low == 0).all() and (space.high == 255).all())
    )


def turned(shape: tuple[int, ...]) -> tuple[int, ...]:
    """Shape of a picture as `VecTransposeImage` turns it: channels first."""
    return (shape[2], *shape[:2])


@dataclass(frozen=True)
class Part:
    """An array of an observation, and what becomes of it.

    Attributes:
        at: where it lies in a flat observation.
        shape: its own.
        normal: how it is normalised; None where it is not.
        frames: how many of them are stacked.
        axis: along which, 0 or -1.
        turns: whether its channels are then put first.
        scales: whether its numbers are then divided by 255.
        features: what is made of it at last; None where it is flattened.
    """

    at: slice
    shape: tuple[int, ...]
    normal: Normal | None = None
    frames: int = 1
    axis: int = -1
    turns: bool = False
    scales: bool = False
    features: Callable[[NDArray[np.float32]], Batch] | None = None

    @property
    def kept(self) -> int:
        """Numbers of the frames before that are kept."""
        return (self.frames - 1) * prod(self.shape)

    @property
    def stacked(self) -> tuple[int, ...]:
        """Shape of so many frames."""
        shape = list(self.shape)
        if self.frames > 1:
            shape[self.axis] *= self.frames
        return tuple(shape)

    def __call__(self, seen: NDArray[Any], before: Batch) -> tuple[Batch, Batch]:
        """Features (n, f) float32 of flat observations (n, size), and the frames to be kept, (n, kept)."""
        n = len(seen)
        array: NDArray[Any] = seen[:, self.at].reshape(n, *self.shape)
        early = self.normal is not None and self.normal.mean.shape == self.shape
        if early and self.normal:
            array = self.normal(array)
        if self.frames > 1:
            frames = [*before.reshape(n, self.frames - 1, *self.shape).swapaxes(0, 1), array]
            array = np.concatenate(frames, axis=self.axis if self.axis < 0 else self.axis + 1)
            before = np.stack(frames[1:], axis=1).reshape(n, -1).astype(np.float32)
        if self.normal and not early:
            array = self.normal(array)
        made: NDArray[np.float32] = array.astype(np.float32, copy=False)
        if self.turns:
            made = made.transpose(0, 3, 1, 2)
        if self.scales:
            made = made / np.float32(255.0)
        return (self.features(made) if self.features else made.reshape(n, -1)), before


class Wrapped:
    """A network behind such wrappers; the frames before stand in its memory."""

    def __init__(self, parts: Sequence[Part], network: Network) -> None:
        """A network of the features of all parts, one after the other."""
        self._parts, self._network = tuple(parts), network
        self._kept = sum(part.kept for part in parts)

    def initial_memory(self, n: int) -> Batch:
        """Frames of zeros, and the network's own memory."""
        return np.concatenate(
            [np.zeros((n, self._kept), np.float32), self._network.initial_memory(n)], axis=1
        )

    def act(self, observations: NDArray[Any], memory: Batch) -> tuple[NDArray[Any], Batch]:
        """As of `nathlon.policies.general.policy.Network`; observations may be float64."""
        features, kept, place = [], [], 0
        for part in self._parts:
            made, before = part(observations, memory[:, place : place + part.kept])
            place += part.kept
            features.append(made)
            kept.append(before)
        joined = np.ascontiguousarray(np.concatenate(features, axis=1))
        numbers, own = self._network.act(joined, memory[:, place:])
        return numbers, np.concatenate([*kept, own], axis=1)
