"""ONNX graphs from others: checked as data, then run by onnxruntime on one thread.

A graph stands alone: no weights in other files, no operators beyond those of the ONNX standard. It has no
randomness: the same observations give the same answers.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from nathlon.policies.policy import Batch
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


class OnnxGraph:
    """A graph that takes observations, float32 (n, size).

    Attributes:
        path: its file, for errors.
        size: numbers of an observation.
    """

    def __init__(self, session: Any, path: Path) -> None:
        """The graph of an `onnxruntime.InferenceSession`.

        Raises:
            InputError: if it takes anything else.
        """
        self.path = path
        self._session = session
        self._input, self.size = _input(path, session)

    def __call__(self, observations: Batch) -> list[Any]:
        """All that it gives for observations (n, size) float32."""
        with _memory_errors():
            return self._session.run(None, {self._input: observations})

    def probe(self, answer: Callable[[list[Any], int], NDArray]) -> NDArray:
        """What it answers to some observations.

        Args:
            answer: finds the answer in what the graph gave for a number of observations, or raises.

        Raises:
            InputError: if it fails on them, or answers otherwise when asked again.
        """
        observations = np.random.default_rng(0).standard_normal((3, self.size)).astype(np.float32)
        first, again = (answer(self._attempt(observations), 3) for _ in range(2))
        if first.tobytes() != again.tobytes():
            raise InputError(
                f"{self.path}: gives other actions for the same observations, expected the same ones"
            )
        return first

    def _attempt(self, observations: Batch) -> list[Any]:
        try:
            return self(observations)
        except MemoryError:
            raise
        except Exception as error:
            raise InputError(
                f"{self.path}: fails on {len(observations)} observations ({_first_line(error)})"
            ) from None


def shapes(found: list[Any]) -> list[tuple[str, tuple[int, ...]]]:
    """Type and shape of each array of what a graph gave."""
    return [(str(each.dtype), each.shape) for each in found if isinstance(each, np.ndarray)]


def checked_card(path: Path, content: bytes) -> ForeignCard:
    """The card of a graph that stands alone and has no randomness.

    Raises:
        InputError: if the graph is another one.
    """
    import onnx
    from google.protobuf.message import DecodeError

    try:
        model = onnx.load_model_from_string(content)
        _check_parts(path, model)
        notes = [(entry.key, entry.value) for entry in model.metadata_props]
    # The second: a name is no text.
    except (DecodeError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: not a whole ONNX file ({error})") from None
    cards = [value for key, value in notes if key == CARD_KEY]
    if len(cards) > 1:
        raise InputError(f"{path}: has {len(cards)} cards, expected one")
    card = parse_card(path, cards[0] if cards else "{}", ForeignCard)
    return card if card.algorithm else card.model_copy(update={"algorithm": "ONNX"})


def _check_parts(path: Path, model: Any) -> None:
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
    nodes = [part for part in parts if isinstance(part, onnx.NodeProto)]
    for part in parts:
        if isinstance(part, onnx.TensorProto) and part.data_location == onnx.TensorProto.EXTERNAL:
            raise InputError(f"{path}: tensor {part.name!r} lies in another file, expected it inside")
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


def _input(path: Path, session: Any) -> tuple[str, int]:
    """Name and size of the observations."""
    inputs = [(each.name, each.type, each.shape) for each in session.get_inputs()]
    match inputs:
        case [(str(name), "tensor(float)", [str() | None, int(size)])]:
            return name, size
    found = ", ".join(f"{name} {kind} {shape}" for name, kind, shape in inputs)
    raise InputError(f"{path}: inputs are {found or 'none'}; expected one, tensor(float) ['n', observations]")
