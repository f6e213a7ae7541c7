"""Weights of a network and the card that says what it is, in one safetensors file.

The weights are stored as float16, the card as JSON under a key of the header's metadata. Such a file is
data only: opening an unknown one can fail, it cannot run anything. The header is read strictly: what it says
of the tensors is compared with the card and the file's size before any of them is made.
"""

from __future__ import annotations

import io
from abc import abstractmethod
from collections.abc import Mapping
from itertools import pairwise
from math import prod
from pathlib import Path
from typing import Annotated, Any, BinaryIO, ClassVar, TypeVar

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError
from safetensors.numpy import save

from nathlon.policies.mlp import Mlp
from nathlon.policies.policy import Batch
from nathlon.policies.strict_json import parse_json
from nathlon.sim.errors import InputError
from nathlon.sim.validation import first_fault
from nathlon.sim.whole_file import whole_file

CARD_KEY = "nathlon"
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


class WeightsCard(BaseModel):
    """A card that tells the widths of the network whose weights stand beside it.

    Attributes:
        key: where it stands in the header's metadata.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)

    key: ClassVar[str] = CARD_KEY

    @property
    @abstractmethod
    def widths(self) -> tuple[int, ...]:
        """Numbers that the network takes, units of each hidden layer, numbers that it gives."""

    @property
    def shapes(self) -> dict[str, tuple[int, ...]]:
        """Shape of each tensor by name: weights (in, out) and biases (out,) of each layer in turn."""
        return layer_shapes(self.widths)


def layer_shapes(widths: tuple[int, ...], prefix: str = "") -> dict[str, tuple[int, ...]]:
    """Shape of each tensor of layers of these widths, from the input on, by name."""
    shapes: dict[str, tuple[int, ...]] = {}
    for i, (fan_in, width) in enumerate(pairwise(widths)):
        shapes[f"{prefix}{i}.weight"] = (fan_in, width)
        shapes[f"{prefix}{i}.bias"] = (width,)
    return shapes


def layers_of(tensors: Mapping[str, NDArray[np.float32]], prefix: str = "") -> list[tuple[Batch, Batch]]:
    """Weight and bias of each of those layers in turn."""
    count = sum(name.startswith(prefix) and name[len(prefix) :].count(".") == 1 for name in tensors) // 2
    return [(tensors[f"{prefix}{i}.weight"], tensors[f"{prefix}{i}.bias"]) for i in range(count)]


def save_weights(path: Path, tensors: Mapping[str, NDArray[np.float32]], card: WeightsCard) -> None:
    """Writes a network and its card; the same tensors and card give the same bytes.

    Args:
        path: the file, replaced whole if it exists.
        tensors: as described by `card.shapes`.
        card: what the network is.

    Raises:
        InputError: if a tensor is missing, unknown, of another shape or not finite as float16.
    """
    _check_shapes(path, {name: tensor.shape for name, tensor in tensors.items()}, card)
    halves: dict[str, NDArray] = {}
    for name, tensor in tensors.items():
        with np.errstate(over="ignore"):
            halves[name] = np.ascontiguousarray(tensor, np.float16)
        _check_finite(path, name, halves[name])
    content = save(halves, {card.key: card.model_dump_json()})
    with whole_file(path) as partial:
        partial.write_bytes(content)


def mean_network(tensors: Mapping[str, NDArray[np.float32]], actions: int) -> Mlp:
    """The squashed means of a policy's actions.

    Args:
        tensors: as described by a card's `shapes`; the last layer gives the means of the actions, then the
            logarithms of their deviations, which are left out.
        actions: numbers of an action.
    """
    *hidden, (weight, bias) = layers_of(tensors)
    means: tuple[Batch, Batch] = (np.ascontiguousarray(weight[:, :actions]), bias[:actions])
    return Mlp((*hidden, means), "relu", "tanh")


AnyCard = TypeVar("AnyCard", bound=BaseModel)
AnyWeightsCard = TypeVar("AnyWeightsCard", bound=WeightsCard)


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


def parse_weights(
    path: Path, content: bytes, model: type[AnyWeightsCard]
) -> tuple[AnyWeightsCard, dict[str, NDArray[np.float32]]]:
    """The card of a file with these bytes and its tensors, as described by `card.shapes`.

    Raises:
        InputError: if it holds no card of this kind, or the tensors are others.
    """
    card, places = read_header(path, io.BytesIO(content), len(content), model)
    tensors = {}
    for name, shape in card.shapes.items():
        # Not by safetensors' own reader, which panics where memory runs out.
        half = np.frombuffer(content, _HALF, prod(shape), places[name])
        tensors[name] = half.astype(np.float32).reshape(shape)
        _check_finite(path, name, tensors[name])
    return card, tensors


def read_header(
    path: Path, file: BinaryIO, size: int, model: type[AnyWeightsCard]
) -> tuple[AnyWeightsCard, dict[str, int]]:
    """The card of a file of `size` bytes, and where the card's tensors begin in it.

    Raises:
        InputError: if there is no card of this kind, or the header tells of other tensors.
    """
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
    card = parse_card(path, _card_text(path, header, model.key), model)
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


def _card_text(path: Path, header: Any, key: str) -> str:
    """The card in a header, which is left with the tensors alone."""
    notes = header.pop("__metadata__", None) if isinstance(header, dict) else None
    text = notes.get(key) if isinstance(notes, dict) else None
    if not isinstance(text, str):
        raise InputError(f"{path}: no card under {key!r} in the header, expected a nathlon checkpoint")
    return text


def _half(path: Path, name: str, entry: Any) -> tuple[tuple[int, ...], int, int]:
    """Shape, beginning and end of a tensor of float16, by its entry in a header."""
    match entry:
        case {"dtype": "F16", "shape": list(shape), "data_offsets": [int(begin), int(end)]}:
            return tuple(shape), begin, end
        case {"dtype": str(dtype), "shape": list(), "data_offsets": list()} if dtype != "F16":
            raise InputError(f"{path}: tensor {name!r} is {dtype}, expected F16")
    raise InputError(f"{path}: tensor {name!r} has no type, shape and place in the header")


def _check_shapes(path: Path, shapes: Mapping[str, tuple[int, ...]], card: WeightsCard) -> None:
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
