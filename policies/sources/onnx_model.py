"""ONNX models from others, checked as data before anything runs them.

A model has its weights inside or in one file beside it, and no operators beyond those of the ONNX standard.
It has no randomness.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator
from itertools import islice
from pathlib import Path
from typing import Any

from nathlon.policies.policy_file import MOST_BYTES
from nathlon.policies.sources.foreign import ForeignCard
from nathlon.policies.weights import CARD_KEY, parse_card
from nathlon.sim.errors import InputError

MOST_PARTS = 200_000
"""Nodes, tensors, attributes and what else a graph is made of; a policy has some hundreds."""

_STANDARD = ("", "ai.onnx", "ai.onnx.ml")
_RANDOM = (
    "Bernoulli",
    "Multinomial",
    "RandomNormal",
    "RandomNormalLike",
    "RandomUniform",
    "RandomUniformLike",
)


def checked_graph(path: Path, content: bytes, weights: bytes = b"") -> tuple[ForeignCard, bytes]:
    """The card of a graph that has no randomness, and the graph as bytes that stand alone.

    Args:
        path: its file.
        content: the bytes of this.
        weights: those of the file beside it.

    Raises:
        InputError: if the graph is another one.
    """
    import onnx
    from google.protobuf.message import DecodeError

    try:
        model = onnx.load_model_from_string(content)
        parts = _check_parts(path, model)
        notes = [(entry.key, entry.value) for entry in model.metadata_props]
        outside = [part for part in parts if _is_outside(part)]
        _check_location(path, outside)
        for tensor in outside:
            _bring_in(path, tensor, weights)
    # The second: a name is no text.
    except (DecodeError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: not a whole ONNX file ({error})") from None
    cards = [value for key, value in notes if key == CARD_KEY]
    if len(cards) > 1:
        raise InputError(f"{path}: has {len(cards)} cards, expected one")
    card = parse_card(path, cards[0] if cards else "{}", ForeignCard)
    named = card if card.algorithm else card.model_copy(update={"algorithm": "ONNX"})
    return named, model.SerializeToString() if outside else content


def _is_outside(part: Any) -> bool:
    import onnx

    return isinstance(part, onnx.TensorProto) and part.data_location == onnx.TensorProto.EXTERNAL


def _check_location(path: Path, outside: Iterable[Any]) -> None:
    named = {entry.value for tensor in outside for entry in tensor.external_data if entry.key == "location"}
    if len(named) > 1 or any(name != Path(name).name or name == ".." for name in named):
        raise InputError(
            f"{path}: its weights lie in {', '.join(sorted(named))}, expected one file beside it; "
            "onnx.save(onnx.load(...), ...) puts them inside"
        )


def _bring_in(path: Path, tensor: Any, weights: bytes) -> None:
    """Put the numbers of a tensor that lie in another file into the graph."""
    said = {entry.key: entry.value for entry in tensor.external_data}
    if not weights:
        raise InputError(
            f"{path}: tensor {tensor.name!r} lies in another file, expected that beside it as "
            f"{path.name + '.data'!r}, or all weights inside, as onnx.save(onnx.load(...), ...) writes them"
        )
    begin, size = (
        _count(path, tensor, said.get(key, default)) for key, default in (("offset", "0"), ("length", ""))
    )
    if begin + size > len(weights):
        raise InputError(
            f"{path}: tensor {tensor.name!r} lies at {begin} to {begin + size} of the file beside it, which "
            f"has {len(weights)} bytes"
        )
    tensor.raw_data = weights[begin : begin + size]
    tensor.ClearField("external_data")
    tensor.ClearField("data_location")


def _count(path: Path, tensor: Any, text: str) -> int:
    if not (text.isascii() and text.isdecimal() and len(text) < 13):
        raise InputError(f"{path}: tensor {tensor.name!r} has offset or length {text!r} in another file")
    return int(text)


def _check_parts(path: Path, model: Any) -> tuple[Any, ...]:
    """All that a graph is made of."""
    import onnx

    parts = tuple(islice(_messages(model), MOST_PARTS + 1))
    if len(parts) > MOST_PARTS:
        raise InputError(f"{path}: has more than {MOST_PARTS} parts, expected the graph of a policy")
    functions = {(function.domain, function.name) for function in model.functions}
    for domain, name in functions:
        # The runtime might take its name for its own operator's.
        if domain in _STANDARD or domain.startswith("com.microsoft"):
            operator = f"{domain}.{name}".removeprefix(".")
            raise InputError(f"{path}: function {operator!r} has the name of an operator of onnxruntime")
    if sum(_length(part) for part in parts if _is_outside(part)) > MOST_BYTES:
        raise InputError(f"{path}: has more than {MOST_BYTES} bytes of weights in another file")
    nodes = [part for part in parts if isinstance(part, onnx.NodeProto)]
    for node in nodes:
        operator = f"{node.domain}.{node.op_type}".removeprefix(".")
        if node.domain not in _STANDARD and (node.domain, node.op_type) not in functions:
            raise InputError(f"{path}: operator {operator!r} is not one of the ONNX standard")
        if node.op_type in _RANDOM:
            raise InputError(f"{path}: operator {operator!r} is random, expected a policy without noise")
    # The third input of a Dropout tells whether it trains.
    switches = {node.input[2] for node in nodes if node.op_type == "Dropout" and len(node.input) > 2} - {""}
    if switches and switches - _always_false(parts):
        raise InputError(f"{path}: operator 'Dropout' is random, expected a policy without noise")
    return parts


def _length(tensor: Any) -> int:
    """Bytes that a tensor says to have in another file."""
    said = [entry.value for entry in tensor.external_data if entry.key == "length"]
    return sum(int(text) for text in said if text.isdecimal() and len(text) < 13)


def _always_false(parts: Iterable[Any]) -> set[str]:
    """Names that stand for one stored False and, in all graphs of the model, for nothing else."""
    import onnx

    named: Counter[str] = Counter()
    found: set[str] = set()
    for part in parts:
        stored: list[tuple[str, Any]] = []
        if isinstance(part, onnx.NodeProto):
            named.update(part.output)
            if (
                part.op_type == "Constant"
                and part.domain in _STANDARD
                and len(part.output) == len(part.attribute) == 1
                # Else it is whatever the caller of its function says.
                and not part.attribute[0].ref_attr_name
            ):
                stored = [(part.output[0], part.attribute[0].t)]
        elif isinstance(part, onnx.GraphProto):
            named.update(each.name for each in part.input)
            named.update(each.name for each in part.initializer)
            named.update(each.values.name for each in part.sparse_initializer)
            stored = [(tensor.name, tensor) for tensor in part.initializer]
        elif isinstance(part, onnx.FunctionProto):
            named.update(part.input)
        found.update(name for name, tensor in stored if _is_false(tensor))
    return {name for name in found if named[name] == 1}


def _is_false(tensor: Any) -> bool:
    import onnx

    if tensor.data_type != onnx.TensorProto.BOOL:
        return False
    try:
        # By onnx's own reader: of several fields with contents it takes the one that the runtime takes.
        stored = onnx.numpy_helper.to_array(tensor)
    except (ValueError, TypeError):
        return False
    return stored.size == 1 and not stored.any()


def _messages(message: Any) -> Iterator[Any]:
    """A protobuf message and all inside it."""
    yield message
    for field, value in message.ListFields():
        if field.message_type is not None:
            for inner in value if field.is_repeated else (value,):
                yield from _messages(inner)
