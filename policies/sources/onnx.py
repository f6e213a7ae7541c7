"""Policies as ONNX graphs: any of the right shape can drive, and checkpoints can be written as such.

A graph is data, run by onnxruntime on one thread. It stands alone: no weights in other files, no operators
beyond those of the ONNX standard.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from nathlon.policies.checkpoint import ACTION_SIZE, CARD_KEY, NetworkPolicy, parse_card
from nathlon.policies.policy import Batch
from nathlon.policies.sources.foreign import ForeignCard, observation_spec
from nathlon.policies.sources.policy_file import content_id, opening, read_policy_file
from nathlon.sim.errors import InputError
from nathlon.sim.whole_file import whole_file

OPSET, IR_VERSION = 17, 8
"""Old enough for every runtime of the last years."""

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


class OnnxPolicy:
    """The policy of an ONNX file, its actions clipped to [-1, 1].

    Attributes:
        card: what is known of the policy.
        id: SHA-256 of the file.
        observation_spec: layout of the observations that it expects.
    """

    def __init__(self, card: ForeignCard, identity: str, session: Any, path: Path) -> None:
        """A policy of an `onnxruntime.InferenceSession`.

        Raises:
            InputError: if the graph does not map observations (n, size) to actions (n, 2).
        """
        self.card = card
        self.id = identity
        self._session = session
        self._input, size = _input(path, session)
        self.observation_spec = observation_spec(path, card, size)
        observations = np.random.default_rng(0).standard_normal((3, size)).astype(np.float32)
        first, again = (_actions(path, session, observations) for _ in range(2))
        if first.tobytes() != again.tobytes():
            raise InputError(f"{path}: gives other actions for the same observations, expected the same ones")

    @classmethod
    def load(cls, path: Path) -> OnnxPolicy:
        """The policy stored in a file.

        Raises:
            InputError: if the file is no graph of the right shape, or needs more than itself.
        """
        with opening(path):
            content = read_policy_file(path)
            card = _checked_card(path, content)
            return cls(card, content_id(content), _session(path, content), path)

    def initial_memory(self, n: int) -> Batch:
        """No memory: (n, 0) float32."""
        return np.zeros((n, 0), np.float32)

    def act(self, observations: Batch, memory: Batch) -> tuple[Batch, Batch]:
        """Actions (n, 2) float32 for observations (n, observation_spec.size) float32; memory as it was."""
        with _memory_errors():
            (actions,) = self._session.run(None, {self._input: observations})
        return np.clip(actions, -1.0, 1.0), memory


def _checked_card(path: Path, content: bytes) -> ForeignCard:
    """The card of a graph that stands alone and has no randomness."""
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
    return tensor.raw_data == b"\0" or list(tensor.int32_data) == [0]


def _messages(message: Any) -> Iterator[Any]:
    """A protobuf message and all inside it."""
    yield message
    for field, value in message.ListFields():
        if field.message_type is not None:
            for inner in value if field.is_repeated else (value,):
                yield from _messages(inner)


def _session(path: Path, content: bytes) -> Any:
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


def _actions(path: Path, session: Any, observations: Batch) -> Batch:
    try:
        with _memory_errors():
            found = session.run(None, {session.get_inputs()[0].name: observations})
    except MemoryError:
        raise
    except Exception as error:
        raise InputError(
            f"{path}: fails on {len(observations)} observations ({_first_line(error)})"
        ) from None
    shapes = [(str(each.dtype), each.shape) for each in found if isinstance(each, np.ndarray)]
    expected = ("float32", (len(observations), ACTION_SIZE))
    if len(found) != 1 or shapes != [expected]:
        raise InputError(
            f"{path}: outputs for {len(observations)} observations are {shapes}, expected {[expected]}"
        )
    return found[0]


def export_onnx(policy: NetworkPolicy, path: Path) -> None:
    """Write a checkpoint's policy as an ONNX graph with its card; the same policy gives the same bytes.

    The graph maps `observation` (n, size) to `action` (n, 2), both float32.

    Args:
        policy: what to write.
        path: the file, replaced whole if it exists.

    Raises:
        InputError: if the file cannot be written.
    """
    try:
        with whole_file(path) as partial:
            partial.write_bytes(_graph(policy))
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror})") from None


def _graph(policy: NetworkPolicy) -> bytes:
    from onnx import TensorProto, helper, numpy_helper

    operators = {"relu": "Relu", "tanh": "Tanh"}
    network, size = policy.network, policy.observation_spec.size
    nodes, weights, layer = [], [], "observation"
    for index, tensors in enumerate(network.layers):
        names = [f"{index}.weight", f"{index}.bias"]
        weights += [numpy_helper.from_array(array, name) for array, name in zip(tensors, names, strict=True)]
        nodes.append(helper.make_node("Gemm", [layer, *names], [f"{index}.sum"]))
        last = index == len(network.layers) - 1
        layer = "action" if last else f"{index}.out"
        function = operators[network.output if last else network.hidden]
        nodes.append(helper.make_node(function, [f"{index}.sum"], [layer]))
    graph = helper.make_graph(
        nodes,
        "policy",
        [helper.make_tensor_value_info("observation", TensorProto.FLOAT, ["n", size])],
        [helper.make_tensor_value_info("action", TensorProto.FLOAT, ["n", ACTION_SIZE])],
        weights,
    )
    model = helper.make_model(
        graph, producer_name="nathlon", opset_imports=[helper.make_opsetid("", OPSET)], ir_version=IR_VERSION
    )
    helper.set_model_props(model, {CARD_KEY: policy.card.model_dump_json(exclude={"hidden"})})
    return model.SerializeToString(deterministic=True)
