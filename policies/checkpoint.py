"""Checkpoints: a policy's weights and the card that says what it is, in one safetensors file.

The weights are stored as float16, the card as JSON under the key `nathlon` of the header's metadata. A
checkpoint is data only: opening an unknown one can fail, it cannot run anything.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, PlainSerializer, PlainValidator, ValidationError
from safetensors import SafetensorError, safe_open
from safetensors.numpy import save

from policies.mlp import Mlp
from policies.policy import Batch
from sim.errors import InputError, first_fault
from sim.observation import ObservationSpec
from sim.whole_file import whole_file

CARD_KEY = "nathlon"
ACTION_SIZE = 2

Count = Annotated[int, Field(ge=0)]
Width = Annotated[int, Field(ge=1, le=8192)]


def _observation_spec(value: Any) -> ObservationSpec:
    if isinstance(value, ObservationSpec):
        return value
    if not isinstance(value, dict):
        raise ValueError("expected an object")
    return ObservationSpec.from_dict(value)


Observation = Annotated[
    ObservationSpec, PlainValidator(_observation_spec), PlainSerializer(ObservationSpec.to_dict)
]


class Card(BaseModel):
    """What a checkpoint is and where it comes from.

    Attributes:
        format: version of the checkpoint format.
        algorithm: what trained it.
        hidden: units of each hidden layer.
        observation: layout of the observations that it was trained on.
        circuit, car: names of what it was trained on.
        scenarios: names of the training scenarios.
        step: gradient updates so far.
        transitions: environment steps so far.
        seed: of the training run.
        created_by: versions of the programs that made it, by name.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)

    format: Literal[1] = 1
    algorithm: str
    hidden: Annotated[tuple[Width, ...], Field(min_length=1, max_length=8)]
    observation: Observation
    circuit: str
    car: str
    scenarios: tuple[str, ...]
    step: Count
    transitions: Count
    seed: Count
    created_by: dict[str, str]

    @property
    def shapes(self) -> dict[str, tuple[int, ...]]:
        """Shape of each tensor by name: weights (in, out) and biases (out,) of each layer in turn.

        The last layer gives the means of the actions, then the logarithms of their deviations.
        """
        widths = (self.observation.size, *self.hidden, 2 * ACTION_SIZE)
        shapes: dict[str, tuple[int, ...]] = {}
        for i, (fan_in, width) in enumerate(pairwise(widths)):
            shapes[f"{i}.weight"] = (fan_in, width)
            shapes[f"{i}.bias"] = (width,)
        return shapes


def save_checkpoint(path: Path, policy_tensors: Mapping[str, NDArray[np.float32]], card: Card) -> None:
    """Writes a checkpoint; the same tensors and card give the same bytes.

    Args:
        path: the file, replaced whole if it exists.
        policy_tensors: as described by `card.shapes`.
        card: what the policy is.

    Raises:
        InputError: if a tensor is missing, unknown, of another shape or not finite as float16.
    """
    _check_shapes(path, {name: tensor.shape for name, tensor in policy_tensors.items()}, card)
    halves: dict[str, NDArray] = {}
    for name, tensor in policy_tensors.items():
        with np.errstate(over="ignore"):
            halves[name] = np.ascontiguousarray(tensor, np.float16)
        _check_finite(path, name, halves[name])
    content = save(halves, {CARD_KEY: card.model_dump_json()})
    with whole_file(path) as partial:
        partial.write_bytes(content)


def checkpoint_id(path: Path) -> str:
    """SHA-256 of the file's contents, in hexadecimal: the name of a checkpoint wherever it lies.

    Raises:
        InputError: if there is no such file.
    """
    _check_file(path)
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def read_card(path: Path) -> Card:
    """The card of a checkpoint; reads no weights.

    Raises:
        InputError: if the file is no checkpoint that this program can drive.
    """
    with _opened(path) as file:
        return _card(path, file)


def read_checkpoint(path: Path) -> tuple[Card, dict[str, NDArray[np.float32]]]:
    """The card of a checkpoint and its tensors, as described by `card.shapes`.

    Raises:
        InputError: if the file is no checkpoint that this program can drive.
    """
    with _opened(path) as file:
        card = _card(path, file)
        slices = {name: file.get_slice(name) for name in file.keys()}  # noqa: SIM118 - not a mapping
        _check_shapes(path, {name: tuple(part.get_shape()) for name, part in slices.items()}, card)
        tensors = {}
        for name, part in slices.items():
            if part.get_dtype() != "F16":
                raise InputError(f"{path}: tensor {name!r} is {part.get_dtype()}, expected F16")
            tensors[name] = file.get_tensor(name).astype(np.float32)
            _check_finite(path, name, tensors[name])
    return card, tensors


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
        self.observation_spec = card.observation
        *hidden, (weight, bias) = (
            (tensors[f"{i}.weight"], tensors[f"{i}.bias"]) for i in range(len(card.hidden) + 1)
        )
        means = (np.ascontiguousarray(weight[:, :ACTION_SIZE]), bias[:ACTION_SIZE])
        self.network = Mlp((*hidden, means), "relu", "tanh")

    @classmethod
    def load(cls, path: Path) -> NetworkPolicy:
        """The policy stored in a file.

        Raises:
            InputError: if the file is no checkpoint that this program can drive.
        """
        card, tensors = read_checkpoint(path)
        return cls(card, checkpoint_id(path), tensors)

    def initial_memory(self, n: int) -> Batch:
        """No memory: (n, 0) float32."""
        return np.zeros((n, 0), np.float32)

    def act(self, observations: Batch, memory: Batch) -> tuple[Batch, Batch]:
        """Actions (n, 2) float32 for observations (n, observation_spec.size) float32; memory as it was."""
        return self.network(observations), memory


def load_checkpoint(path: Path) -> NetworkPolicy:
    """The policy stored in a file.

    Raises:
        InputError: if the file is no checkpoint that this program can drive.
    """
    return NetworkPolicy.load(path)


def _check_file(path: Path) -> None:
    if not path.exists():
        raise InputError(f"{path}: no such file, expected a checkpoint")
    if not path.is_file():
        raise InputError(f"{path}: not a file, expected a checkpoint")


def _opened(path: Path) -> Any:
    _check_file(path)
    if path.stat().st_size == 0:
        raise InputError(f"{path}: the file is empty, expected a checkpoint")
    try:
        return safe_open(path, framework="numpy")
    except (SafetensorError, OSError, ValueError) as error:
        raise InputError(f"{path}: not a whole safetensors file ({error})") from None


def _card(path: Path, file: Any) -> Card:
    text = (file.metadata() or {}).get(CARD_KEY)
    if text is None:
        raise InputError(f"{path}: no card under {CARD_KEY!r} in the header, expected a nathlon checkpoint")
    try:
        return Card.model_validate_json(text)
    except ValidationError as error:
        if error.errors()[0]["type"] == "json_invalid":
            raise InputError(f"{path}: the card in the header is not valid JSON") from None
        raise InputError(f"{path}: the card: {first_fault(error, Card)}") from None
    except InputError as error:
        raise InputError(f"{path}: {error}") from None


def _check_shapes(path: Path, shapes: Mapping[str, tuple[int, ...]], card: Card) -> None:
    for name, expected in card.shapes.items():
        if name not in shapes:
            raise InputError(f"{path}: tensor {name!r} is missing")
        if shapes[name] != expected:
            raise InputError(f"{path}: tensor {name!r} has shape {shapes[name]}, expected {expected}")
    for name in shapes:
        if name not in card.shapes:
            raise InputError(f"{path}: tensor {name!r} is not one of a policy's")


def _check_finite(path: Path, name: str, tensor: NDArray) -> None:
    if not np.isfinite(tensor).all():
        raise InputError(f"{path}: tensor {name!r} holds numbers that are not finite")
