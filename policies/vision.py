"""Networks that see: convolutions of a picture, what the sensors tell beside, a memory, then a perceptron."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from math import prod
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field

from nathlon.policies.convolutions import convolved, size_after
from nathlon.policies.mlp import Mlp
from nathlon.policies.policy import Batch, Observations
from nathlon.policies.weights import Width, mean_network
from nathlon.sim.camera_spec import CameraSpec
from nathlon.sim.observation import NUMBERS, PICTURE

PREFIX = "vision."
"""What the names of tensors before the perceptron begin with."""
GATES = 3
"""Of a unit of memory: reset, update, new."""


class Convolution(BaseModel):
    """A layer of convolutions with ReLU.

    Attributes:
        filters: how many.
        side: of each, pixels.
        stride: pixels from one place to the next.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)

    filters: Width
    side: Annotated[int, Field(ge=1, le=32)]
    stride: Annotated[int, Field(ge=1, le=16)]


NATURE = (
    Convolution(filters=32, side=8, stride=4),
    Convolution(filters=64, side=4, stride=2),
    Convolution(filters=64, side=3, stride=1),
)
"""Those of Mnih et al. (2015)."""


class Vision(BaseModel):
    """What stands before the perceptron of a policy that sees.

    Attributes:
        convolutions: of the picture, one after the other.
        features: units of the layer, with ReLU, that follows them; the numbers of the sensors stand beside.
        memory: units of the gated recurrent unit (Cho et al., 2014) that follows; 0 for none.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)

    convolutions: Annotated[tuple[Convolution, ...], Field(min_length=1, max_length=8, strict=False)] = NATURE
    features: Width = 256
    memory: Annotated[int, Field(ge=0, le=4096)] = 0

    @property
    def strides(self) -> tuple[int, ...]:
        """Of the convolutions."""
        return tuple(layer.stride for layer in self.convolutions)

    def outputs(self, sensors: int) -> int:
        """How many numbers the perceptron gets."""
        return self.memory or self.features + sensors

    def shapes(self, camera: CameraSpec, sensors: int) -> dict[str, tuple[int, ...]]:
        """Shape of each tensor by name.

        Raises:
            ValueError: if the pictures are too small for the convolutions.
        """
        shapes: dict[str, tuple[int, ...]] = {}
        channels = camera.channels
        layers = [(layer.filters, layer.side, layer.stride) for layer in self.convolutions]
        for index, (filters, side, _) in enumerate(layers):
            shapes[f"{PREFIX}{index}.weight"] = (filters, channels, side, side)
            shapes[f"{PREFIX}{index}.bias"] = (filters,)
            channels = filters
        rest = size_after(camera.height, camera.width, [(side, stride) for _, side, stride in layers])
        if not prod(rest):
            raise ValueError(
                f"vision: its convolutions leave nothing of {camera.height} x {camera.width} pixels"
            )
        shapes[f"{PREFIX}features.weight"] = (channels * prod(rest), self.features)
        shapes[f"{PREFIX}features.bias"] = (self.features,)
        return shapes | memory_shapes(self.features + sensors, self.memory)


def memory_shapes(inputs: int, units: int) -> dict[str, tuple[int, ...]]:
    """Shape of each tensor of a gated recurrent unit by name; of none without units."""
    gates = GATES * units
    return (
        {
            f"{PREFIX}memory.inputs": (inputs, gates),
            f"{PREFIX}memory.inputs_bias": (gates,),
            f"{PREFIX}memory.own": (units, gates),
            f"{PREFIX}memory.own_bias": (gates,),
        }
        if units
        else {}
    )


@dataclass(frozen=True)
class Memory:
    """A gated recurrent unit as PyTorch has it.

    Attributes:
        inputs: weights (i, 3 m) of what is new, and bias (3 m,), float32; reset, update and new in turn.
        own: the same of what is kept, (m, 3 m) and (3 m,).
    """

    inputs: tuple[Batch, Batch]
    own: tuple[Batch, Batch]

    @classmethod
    def of(cls, tensors: Mapping[str, NDArray[np.float32]]) -> Memory:
        """That of tensors by the names of `memory_shapes`."""
        inputs, inputs_bias, own, own_bias = (tensors[name] for name in memory_shapes(1, 1))
        return cls((inputs, inputs_bias), (own, own_bias))

    @property
    def units(self) -> int:
        """How many numbers are kept."""
        return len(self.own[0])

    @cached_property
    def _of_inputs(self) -> Mlp:
        return Mlp((self.inputs,), "linear", "linear")

    @cached_property
    def _of_own(self) -> Mlp:
        return Mlp((self.own,), "linear", "linear")

    def __call__(self, seen: Batch, kept: Batch) -> Batch:
        """What is kept from now on, (n, m), given what is new, (n, i), and what was kept."""
        fresh, past = self._of_inputs.alike(seen), self._of_own.alike(kept)
        m = self.units
        reset, update = np.split(_sigmoid(fresh[:, : 2 * m] + past[:, : 2 * m]), 2, axis=1)
        new = np.tanh(fresh[:, 2 * m :] + reset * past[:, 2 * m :])
        return new + update * (kept - new)


def _sigmoid(values: Batch) -> Batch:
    return np.float32(0.5) * (np.tanh(np.float32(0.5) * values) + np.float32(1.0))  # never overflows


@dataclass(frozen=True)
class SeeingNetwork:
    """From pictures and numbers to actions.

    Attributes:
        convolutions: weights (filters, channels, side, side), bias (filters,) and stride of each layer.
        features: of all that the last one gives.
        memory: None for none.
        head: gives the actions.
    """

    convolutions: tuple[tuple[Batch, Batch, int], ...]
    features: Mlp
    memory: Memory | None
    head: Mlp

    @classmethod
    def of(cls, vision: Vision, tensors: Mapping[str, NDArray[np.float32]], actions: int) -> SeeingNetwork:
        """The network of tensors as described by a card, giving the squashed means of actions."""

        def pair(first: str, second: str) -> tuple[Batch, Batch]:
            return tensors[f"{PREFIX}{first}"], tensors[f"{PREFIX}{second}"]

        return cls(
            tuple(
                (*pair(f"{index}.weight", f"{index}.bias"), layer.stride)
                for index, layer in enumerate(vision.convolutions)
            ),
            Mlp((pair("features.weight", "features.bias"),), "relu", "relu"),
            Memory.of(tensors) if vision.memory else None,
            mean_network(tensors, actions),
        )

    def initial_memory(self, n: int) -> Batch:
        """Zeros (n, m); m is 0 without a memory."""
        return np.zeros((n, self.memory.units if self.memory else 0), np.float32)

    def act(self, seen: Observations, memory: Batch) -> tuple[Batch, Batch]:
        """Actions (n, a) float32 for (n,) records, and memory (n, m).

        Those of a record are the same, to the last bit, in any batch.
        """
        picture = seen[PICTURE].astype(np.float32).transpose(0, 3, 1, 2) / np.float32(255.0)
        for weight, bias, stride in self.convolutions:
            picture = convolved(picture, weight, bias, stride)
        features = self.features.alike(picture.reshape(len(seen), -1))
        known = np.concatenate([features, seen[NUMBERS]], axis=1)
        if self.memory:
            known = memory = self.memory(known, memory)
        return self.head.alike(known), memory
