"""Checkpoints: a policy's weights and the card that says what it is, in one safetensors file.

The file is read as `nathlon.policies.weights` tells, the card stands there under the key `nathlon`.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, PlainSerializer, PlainValidator, model_validator

from nathlon.policies.mlp import EncodedMlp, Mlp
from nathlon.policies.policy import Batch, Observations
from nathlon.policies.policy_file import content_id, open_policy_file, opening, read_policy_file
from nathlon.policies.vision import SeeingNetwork, Vision
from nathlon.policies.weights import (
    Count,
    Names,
    Text,
    Versions,
    WeightsCard,
    Width,
    layer_shapes,
    layers_of,
    mean_network,
    parse_weights,
    read_header,
    save_weights,
)
from nathlon.sim.errors import InputError
from nathlon.sim.observation import ObservationSpec

ACTION_SIZE = 2
ANY = "any"
"""Circuit and car of a policy that drives all of them."""
ENCODER = "encoder."
"""What the names of an encoder's tensors begin with."""


def _observation_spec(value: Any) -> ObservationSpec:
    if isinstance(value, ObservationSpec):
        return value
    if not isinstance(value, dict):
        raise ValueError("expected an object")
    return ObservationSpec.from_dict(value)


Observation = Annotated[
    ObservationSpec, PlainValidator(_observation_spec), PlainSerializer(ObservationSpec.to_dict)
]

Practises = Annotated[bool, Field(exclude_if=lambda practises: not practises)]


class Card(WeightsCard):
    """What a checkpoint is and where it comes from.

    Attributes:
        format: version of the checkpoint format: 2 where there is a vision, which readers of 1 do not know.
        algorithm: what trained it.
        hidden: units of each hidden layer.
        encoder: units of each layer that what does not change in a race goes through first; empty for none.
        practises: whether it practises a circuit with a car before it races there, and sees the plan so found
            in full; else it sees the driver's plan, if any.
        vision: what stands before these layers where the policy sees by a camera; else None.
        observation: layout of the observations that it was trained on.
        circuit, car: names of what it was trained on, or ANY.
        scenarios: names of the training scenarios.
        step: gradient updates so far.
        transitions: environment steps so far.
        seed: of the training run.
        created_by: versions of the programs that made it, by name.
    """

    format: Literal[1, 2] = 1
    algorithm: Text
    hidden: Annotated[tuple[Width, ...], Field(min_length=1, max_length=8)]
    encoder: Annotated[tuple[Width, ...], Field(max_length=4)] = ()
    practises: Practises = False
    vision: Annotated[Vision | None, Field(exclude_if=lambda vision: vision is None)] = None
    observation: Observation
    circuit: Text
    car: Text
    scenarios: Names
    step: Count
    transitions: Count
    seed: Count
    created_by: Versions

    @property
    def widths(self) -> tuple[int, ...]:
        """The last layer gives the means of the actions, then the logarithms of their deviations."""
        seen = self.observation.size
        if self.vision:
            seen = self.vision.outputs(seen)
        if self.encoder:
            seen += self.encoder[-1] - self.observation.facts
        return (seen, *self.hidden, 2 * ACTION_SIZE)

    @property
    def shapes(self) -> dict[str, tuple[int, ...]]:
        camera = self.observation.camera
        if self.vision and camera:
            return self.vision.shapes(camera, self.observation.size) | layer_shapes(self.widths)
        encoder = (self.observation.facts, *self.encoder) if self.encoder else ()
        return layer_shapes(self.widths) | layer_shapes(encoder, ENCODER)

    @model_validator(mode="after")
    def _has_what_to_encode(self) -> Card:
        if self.encoder and not self.observation.facts:
            raise ValueError("encoder is given, but the observation has nothing that is the same all race")
        return self

    @model_validator(mode="after")
    def _has_what_to_practise(self) -> Card:
        if self.practises and not self.observation.planned:
            raise ValueError("practises is given, expected observations with a plan beside it")
        return self

    @model_validator(mode="after")
    def _sees_as_it_observes(self) -> Card:
        if (self.vision is None) != (self.observation.camera is None):
            raise ValueError("vision and the observation's camera belong together, expected both or neither")
        if self.format != (1 if self.vision is None else 2):
            raise ValueError(f"format is {self.format}, expected 2 with vision and 1 without")
        _ = self.shapes  # raises where nothing is left of the pictures
        return self


def save_checkpoint(path: Path, policy_tensors: Mapping[str, NDArray[np.float32]], card: Card) -> None:
    """Writes a checkpoint; the same tensors and card give the same bytes.

    Args:
        path: the file, replaced whole if it exists.
        policy_tensors: as described by `card.shapes`.
        card: what the policy is.

    Raises:
        InputError: if a tensor is missing, unknown, of another shape or not finite as float16.
    """
    save_weights(path, policy_tensors, card)


def checkpoint_id(path: Path) -> str:
    """SHA-256 of the file's contents, in hexadecimal: the name of a checkpoint wherever it lies.

    Raises:
        InputError: if there is no such file.
    """
    return content_id(read_policy_file(path))


def read_card(path: Path) -> Card:
    """The card of a checkpoint; reads no weights.

    Raises:
        InputError: if the file is no checkpoint that this program can drive.
    """
    with opening(path), open_policy_file(path) as (file, size):
        return read_header(path, file, size, Card)[0]


def read_checkpoint(path: Path) -> tuple[Card, dict[str, NDArray[np.float32]]]:
    """The card of a checkpoint and its tensors, as described by `card.shapes`.

    Raises:
        InputError: if the file is no checkpoint that this program can drive.
    """
    with opening(path):
        return parse_weights(path, read_policy_file(path), Card)


def encoded(card: Card, tensors: Mapping[str, NDArray[np.float32]], network: Mlp) -> Mlp | EncodedMlp:
    """A network of these tensors, behind its encoder if there is one."""
    if not card.encoder:
        return network
    encoder = Mlp(tuple(layers_of(tensors, ENCODER)), "relu", "relu")
    return EncodedMlp(encoder, network, card.observation.facts)


class NetworkPolicy:
    """The policy of a checkpoint: drives with the squashed mean of its actions, without noise.

    Attributes:
        card: what the policy is.
        id: the checkpoint's id.
        observation_spec: layout of the observations that it expects.
        network: from observations to actions.
    """

    def __init__(self, card: Card, identity: str, tensors: Mapping[str, NDArray[np.float32]]) -> None:
        """A policy of tensors as described by `card.shapes`; only the means of the last layer are kept."""
        self.card = card
        self.id = identity
        self.observation_spec = card.observation.practising(identity) if card.practises else card.observation
        self.network = encoded(card, tensors, mean_network(tensors, ACTION_SIZE))

    def initial_memory(self, n: int) -> Batch:
        """No memory: (n, 0) float32."""
        return np.zeros((n, 0), np.float32)

    def act(self, observations: Batch, memory: Batch) -> tuple[Batch, Batch]:
        """Actions (n, 2) float32 for observations (n, observation_spec.size) float32; memory as it was."""
        return self.network(observations), memory


class SeeingPolicy:
    """The policy of a checkpoint that sees by a camera, and may remember; without noise.

    Attributes:
        card, id, observation_spec: as of `NetworkPolicy`.
        network: from pictures and numbers to actions.
    """

    def __init__(self, card: Card, identity: str, tensors: Mapping[str, NDArray[np.float32]]) -> None:
        """A policy of tensors as described by `card.shapes`; the card has a vision."""
        assert card.vision is not None, "who sees has a vision"
        self.card = card
        self.id = identity
        self.observation_spec = card.observation
        self.network = SeeingNetwork.of(card.vision, tensors, ACTION_SIZE)

    def initial_memory(self, n: int) -> Batch:
        """Memory at the start of a run, (n, m) float32; m is 0 without a memory."""
        return self.network.initial_memory(n)

    def act(self, observations: Observations, memory: Batch) -> tuple[Batch, Batch]:
        """Actions (n, 2) float32 for (n,) records as `observation_spec` has them, and memory."""
        return self.network.act(observations, memory)


def open_checkpoint(path: Path) -> NetworkPolicy | SeeingPolicy:
    """The policy stored in a file.

    Raises:
        InputError: if the file is no checkpoint that this program can drive.
    """
    with opening(path):
        content = read_policy_file(path)
        card, tensors = parse_weights(path, content, Card)
        kind = SeeingPolicy if card.vision else NetworkPolicy
        return kind(card, content_id(content), tensors)


def load_checkpoint(path: Path) -> NetworkPolicy:
    """The policy stored in a file, which does not see by a camera.

    Raises:
        InputError: if the file is no checkpoint that this program can drive, or has a camera.
    """
    policy = open_checkpoint(path)
    if isinstance(policy, SeeingPolicy):
        raise InputError(f"{path}: sees by a camera, expected a policy that is told numbers")
    return policy
