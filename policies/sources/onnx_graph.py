"""ONNX graphs from others: checked as data, then run by onnxruntime on one thread.

A graph has its weights inside or in one file beside it, and no operators beyond those of the ONNX standard.
It has no randomness: the same observations give the same answers.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import islice
from math import prod
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from nathlon.policies.policy import Batch
from nathlon.policies.sources.foreign import ForeignCard
from nathlon.policies.sources.policy_file import MOST_BYTES
from nathlon.policies.sources.weights import CARD_KEY, parse_card
from nathlon.sim.errors import InputError

if TYPE_CHECKING:
    from gymnasium.spaces import Space

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


_NUMBERS: dict[str, type[np.generic]] = {
    "tensor(float)": np.float32,
    "tensor(float16)": np.float16,
    "tensor(double)": np.float64,
    "tensor(uint8)": np.uint8,
    "tensor(int32)": np.int32,
    "tensor(int64)": np.int64,
}
"""Types of inputs."""


@dataclass(frozen=True)
class Input:
    """One of the arrays that a graph takes.

    Attributes:
        name: in the graph.
        at: where it lies in a flat observation.
        shape: without the batch.
        kind: its type of numbers.
        counts: whether it is the number of a choice that the flat observation has as one of many.
    """

    name: str
    at: slice
    shape: tuple[int, ...]
    kind: type[np.generic]
    counts: bool = False

    def __call__(self, observations: Batch) -> NDArray[Any]:
        """It, (n, *shape), of flat observations."""
        part = observations[:, self.at]
        array = part.argmax(axis=1) if self.counts else part
        return np.ascontiguousarray(array.reshape(len(part), *self.shape), self.kind)


class OnnxGraph:
    """A graph that takes flat observations.

    Attributes:
        path: its file, for errors.
        size: numbers of an observation.
        shape: of the one array that it takes; None if there are several.
    """

    def __init__(self, session: Any, path: Path, card: ForeignCard, seen: Space[Any] | None = None) -> None:
        """The graph of an `onnxruntime.InferenceSession`.

        Args:
            session: which runs it.
            path: its file.
            card: which may name the output that is the actions.
            seen: space of the observations; None for one row of numbers.

        Raises:
            InputError: if it takes anything else.
        """
        self.path = path
        self._session = session
        self._inputs, self._alone = _inputs(path, session, seen)
        first, *others = self._inputs
        self.size = _size(seen) if seen is not None and others else prod(first.shape)
        self.shape = None if others else first.shape
        self._outputs = [each.name for each in session.get_outputs()]
        self._wanted = card.output

    def __call__(self, observations: Batch) -> NDArray[Any]:
        """What it gives for observations (n, size) float32; see `probe`."""
        with _memory_errors():
            [found] = self._run(observations, self._outputs)
        return found

    def _run(self, observations: Batch, names: list[str]) -> list[Any]:
        """Some outputs; row by row where the graph takes one at a time."""
        if not self._alone:
            return self._once(observations, names)
        rows = [self._once(row[None], names) for row in observations]
        return [np.concatenate([_first(one) for one in column]) for column in zip(*rows, strict=True)]

    def _once(self, observations: Batch, names: list[str]) -> list[Any]:
        found = self._session.run(names, {each.name: each(observations) for each in self._inputs})
        return [_plain(each) for each in found]

    def probe(self, answer: Callable[[NDArray[Any], int], NDArray]) -> NDArray:
        """What it answers to some observations; from now on it gives the output that is the actions.

        Args:
            answer: checks what the graph gave for a number of observations.

        Raises:
            InputError: if it fails on them, or answers otherwise when asked again.
        """
        observations = np.random.default_rng(0).standard_normal((3, self.size)).astype(np.float32)
        found = self._attempt(observations)
        self._outputs = [self._outputs[self._actions(found, len(observations))]]
        first, again = (answer(self._attempt(observations)[0], 3) for _ in range(2))
        if first.tobytes() != again.tobytes():
            raise InputError(
                f"{self.path}: gives other actions for the same observations, expected the same ones"
            )
        return first

    def _actions(self, found: list[Any], n: int) -> int:
        """Which of the outputs is the actions: the one that the card names, or the only one that may be."""
        names = self._outputs
        if self._wanted is not None:
            if self._wanted in names:
                return names.index(self._wanted)
            raise InputError(f"{self.path}: has no output {self._wanted!r}, expected {', '.join(names)}")
        if len(found) == 1:
            return 0
        if len(called := [index for index, name in enumerate(names) if "action" in name.lower()]) == 1:
            return called[0]
        # As Stable-Baselines3's documentation exports it: actions, value and logarithm of the probability.
        if len(found) == 3 and [getattr(one, "shape", ()) for one in found[1:]] == [(n, 1), (n,)]:
            return 0
        raise InputError(
            f"{self.path}: outputs are {', '.join(map(repr, names))}, expected one, or a card whose field "
            "'output' names the one of the actions"
        )

    def _attempt(self, observations: Batch) -> list[Any]:
        try:
            with _memory_errors():
                return self._run(observations, self._outputs)
        except MemoryError:
            raise
        except Exception as error:
            raise InputError(
                f"{self.path}: fails on {len(observations)} observations ({_first_line(error)})"
            ) from None


def _plain(found: Any) -> Any:
    """Numbers of any precision as float32, or int64."""
    if isinstance(found, np.ndarray) and found.dtype in (np.float16, np.float64):
        return found.astype(np.float32)
    return found.astype(np.int64) if isinstance(found, np.ndarray) and found.dtype == np.int32 else found


def _first(found: NDArray[Any]) -> NDArray[Any]:
    """What a graph gave for one observation, with a batch of it."""
    return found if found.ndim and len(found) == 1 else found.reshape(1, -1)


def shapes(found: list[Any]) -> list[tuple[str, tuple[int, ...]]]:
    """Type and shape of each array of what a graph gave."""
    return [(str(each.dtype), each.shape) for each in found if isinstance(each, np.ndarray)]


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


def open_session(path: Path, content: bytes) -> Any:
    """An `onnxruntime.InferenceSession` of the graph in a file with these bytes.

    Raises:
        InputError: if onnxruntime cannot run it.
    """
    import onnxruntime

    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    options.use_deterministic_compute = True
    options.log_severity_level = 4
    # Else it might take the bytes for its own format, in which nothing was checked.
    options.add_session_config_entry("session.load_model_format", "ONNX")
    try:
        with _memory_errors():
            return onnxruntime.InferenceSession(content, options, ["CPUExecutionProvider"])
    except MemoryError:
        raise
    # Its other errors have no class in common.
    except Exception as error:
        raise InputError(f"{path}: onnxruntime cannot run the graph ({_first_line(error)})") from None


@contextmanager
def _memory_errors() -> Iterator[None]:
    """Raise as a MemoryError what onnxruntime calls otherwise."""
    try:
        yield
    except Exception as error:
        if "Failed to allocate memory" in str(error):
            raise MemoryError(_first_line(error)) from None
        raise


def _first_line(error: Exception) -> str:
    return str(error).partition("\n")[0]


def _size(space: Space[Any]) -> int:
    """Numbers of a flat observation."""
    from gymnasium.spaces import flatdim  # takes long to load

    return flatdim(space)


def _inputs(path: Path, session: Any, seen: Space[Any] | None) -> tuple[tuple[Input, ...], bool]:
    """The arrays that a graph takes, and whether it takes one observation at a time."""
    from gymnasium.spaces import Dict, Discrete, flatdim

    told = [(each.name, each.type, list(each.shape)) for each in session.get_inputs()]
    found = ", ".join(f"{name} {kind} {shape}" for name, kind, shape in told) or "none"
    inner = seen.spaces if isinstance(seen, Dict) else {}
    if not told or (len(told) > 1 and not {name for name, _, _ in told} <= inner.keys()):
        keys = f", or one for each of {', '.join(inner)}" if inner else ""
        raise InputError(f"{path}: inputs are {found}; expected one, tensor(float) ['n', observations]{keys}")
    starts = dict(zip(inner, np.cumsum([0, *map(flatdim, inner.values())]), strict=False))
    inputs: list[Input] = []
    for name, kind, batch in told:
        shape = batch[1:]
        if kind not in _NUMBERS or not batch or not all(type(size) is int and size > 0 for size in shape):
            raise InputError(f"{path}: inputs are {found}; expected one, tensor(float) ['n', observations]")
        if isinstance(batch[0], int) and batch[0] != 1:
            raise InputError(
                f"{path}: takes {batch[0]} observations at once, expected any number or 1: export it with a "
                "dynamic batch, or for one observation"
            )
        size, counts = prod(shape), False
        if len(told) > 1:
            space = inner[name]
            counts = isinstance(space, Discrete) and size == 1
            if size != flatdim(space) and not counts:
                raise InputError(f"{path}: input {name!r} takes {size} numbers, expected {flatdim(space)}")
            size = flatdim(space)
        at = int(starts[name]) if len(told) > 1 else 0
        inputs.append(Input(name, slice(at, at + size), tuple(shape), _NUMBERS[kind], counts))
    return tuple(inputs), any(isinstance(shape[0], int) for _, _, shape in told)
