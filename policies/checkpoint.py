"""Checkpoints: a policy's weights and the card that says what it is, in one safetensors file.

The weights are stored as float16, the card as JSON under the key `nathlon` of the header's metadata. A
checkpoint is data only: opening an unknown one can fail, it cannot run anything. The header is read strictly:
what it says of the tensors is compared with the card and the file's size before any of them is made.
"""

from __future__ import annotations

import io
from collections.abc import Mapping
from itertools import pairwise
from math import prod
from pathlib import Path
from typing import Annotated, Any, BinaryIO, Literal, TypeVar

import numpy as np
from numpy.typing import NDArray
from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Field,
    PlainSerializer,
    PlainValidator,
    ValidationError,
)
from safetensors.numpy import save

from nathlon.policies.mlp import Mlp
from nathlon.policies.policy import Batch
from nathlon.policies.sources.policy_file import content_id, open_policy_file, opening, read_policy_file
from nathlon.policies.sources.strict_json import parse_json
from nathlon.sim.errors import InputError
from nathlon.sim.observation import ObservationSpec
from nathlon.sim.validation import first_fault
from nathlon.sim.whole_file import whole_file

CARD_KEY = "nathlon"
ACTION_SIZE = 2
MOST_COUNT = 2**63 - 1
MOST_CARD = 1 << 16
"""Characters of a card."""

_MOST_HEADER = 1 << 20
_HALF = np.dtype("<f2")


def _printable(text: str) -> str:
    if not text.isprintable():
        raise ValueError("expected printable characters")
    return text


Count = Annotated[int, Field(ge=0, le=MOST_COUNT)]
Width = Annotated[int, Field(ge=1, le=8192)]
Text = Annotated[str, Field(max_length=200), AfterValidator(_printable)]
Names = Annotated[tuple[Text, ...], Field(max_length=1000)]
Versions = Annotated[dict[Text, Text], Field(max_length=1000)]


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
    algorithm: Text
    hidden: Annotated[tuple[Width, ...], Field(min_length=1, max_length=8)]
    observation: Observation
    circuit: Text
    car: Text
    scenarios: Names
    step: Count
    transitions: Count
    seed: Count
    created_by: Versions

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
    return content_id(read_policy_file(path))


def read_card(path: Path) -> Card:
    """The card of a checkpoint; reads no weights.

    Raises:
        InputError: if the file is no checkpoint that this program can drive.
    """
    with opening(path), open_policy_file(path) as (file, size):
        return _read_header(path, file, size)[0]


def read_checkpoint(path: Path) -> tuple[Card, dict[str, NDArray[np.float32]]]:
    """The card of a checkpoint and its tensors, as described by `card.shapes`.

    Raises:
        InputError: if the file is no checkpoint that this program can drive.
    """
    with opening(path):
        return _parse(path, read_policy_file(path))


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
        with opening(path):
            content = read_policy_file(path)
            card, tensors = _parse(path, content)
            return cls(card, content_id(content), tensors)

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


AnyCard = TypeVar("AnyCard", bound=BaseModel)


def parse_card(path: Path, text: str, model: type[AnyCard]) -> AnyCard:
    """The card written as JSON in the file at `path`.

    Raises:
        InputError: if it is none.
    """
    if len(text) > MOST_CARD:
        raise InputError(f"{path}: the card has {len(text)} characters, expected at most {MOST_CARD}")
    try:
        parse_json(text)
        return model.model_validate_json(text)
    except ValidationError as error:
        raise InputError(f"{path}: the card: {first_fault(error, model)}") from None
    except ValueError as error:
        raise InputError(f"{path}: the card is not valid JSON ({error})") from None
    except InputError as error:
        raise InputError(f"{path}: the card: {error}") from None


def _parse(path: Path, content: bytes) -> tuple[Card, dict[str, NDArray[np.float32]]]:
    card, places = _read_header(path, io.BytesIO(content), len(content))
    tensors = {}
    for name, shape in card.shapes.items():
        # Not by safetensors' own reader, which panics where memory runs out.
        half = np.frombuffer(content, _HALF, prod(shape), places[name])
        tensors[name] = half.astype(np.float32).reshape(shape)
        _check_finite(path, name, tensors[name])
    return card, tensors


def _read_header(path: Path, file: BinaryIO, size: int) -> tuple[Card, dict[str, int]]:
    """The card of a file of `size` bytes, and where the card's tensors begin in it."""
    header_size = int.from_bytes(file.read(8), "little")
    if header_size > min(size - 8, _MOST_HEADER):
        raise InputError(
            f"{path}: not a whole safetensors file (the header has {header_size} of {size} bytes, "
            f"expected at most {_MOST_HEADER})"
        )
    try:
        header = parse_json(file.read(header_size).decode())
    except ValueError as error:
        raise InputError(f"{path}: not a whole safetensors file (the header: {error})") from None
    card = parse_card(path, _card_text(path, header), Card)
    parts = {name: _half(path, name, entry) for name, entry in header.items()}
    _check_shapes(path, {name: shape for name, (shape, _, _) in parts.items()}, card)
    start = place = 8 + header_size
    places = {}
    # As the format has it: one after another, without gaps, to the end of the file.
    for name, (shape, begin, end) in sorted(parts.items(), key=lambda part: part[1][1]):
        places[name] = place
        if start + begin != place or end - begin != _HALF.itemsize * prod(shape):
            raise InputError(f"{path}: tensor {name!r} lies at {begin} to {end}, where it does not fit")
        place = start + end
    if place != size:
        raise InputError(f"{path}: not a whole safetensors file ({size} bytes, expected {place})")
    return card, places


def _card_text(path: Path, header: Any) -> str:
    """The card in a header, which is left with the tensors alone."""
    notes = header.pop("__metadata__", None) if isinstance(header, dict) else None
    text = notes.get(CARD_KEY) if isinstance(notes, dict) else None
    if not isinstance(text, str):
        raise InputError(f"{path}: no card under {CARD_KEY!r} in the header, expected a nathlon checkpoint")
    return text


def _half(path: Path, name: str, entry: Any) -> tuple[tuple[int, ...], int, int]:
    """Shape, beginning and end of a tensor of float16, by its entry in a header."""
    match entry:
        case {"dtype": "F16", "shape": list(shape), "data_offsets": [int(begin), int(end)]}:
            return tuple(shape), begin, end
        case {"dtype": str(dtype), "shape": list(), "data_offsets": list()} if dtype != "F16":
            raise InputError(f"{path}: tensor {name!r} is {dtype}, expected F16")
    raise InputError(f"{path}: tensor {name!r} has no type, shape and place in the header")


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
