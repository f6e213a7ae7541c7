"""Policies as ONNX graphs: any of the right shape can drive, and checkpoints can be written as such.

A graph is data, run by onnxruntime on one thread. It stands alone: no weights in other files, no operators
beyond those of the ONNX standard.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from policies.checkpoint import ACTION_SIZE, CARD_KEY, NetworkPolicy, checkpoint_id
from policies.foreign import ForeignCard, observation_spec, parse_card
from policies.policy import Batch
from sim.errors import InputError
from sim.whole_file import whole_file

OPSET, IR_VERSION = 17, 8
"""Old enough for every runtime of the last years."""

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
        _check_output(path, session, np.zeros((3, size), np.float32))

    @classmethod
    def load(cls, path: Path) -> OnnxPolicy:
        """The policy stored in a file.

        Raises:
            InputError: if the file is no graph of the right shape, or needs more than itself.
        """
        identity = checkpoint_id(path)
        content = path.read_bytes()
        return cls(_checked_card(path, content), identity, _session(path, content), path)

    def initial_memory(self, n: int) -> Batch:
        """No memory: (n, 0) float32."""
        return np.zeros((n, 0), np.float32)

    def act(self, observations: Batch, memory: Batch) -> tuple[Batch, Batch]:
        """Actions (n, 2) float32 for observations (n, observation_spec.size) float32; memory as it was."""
        (actions,) = self._session.run(None, {self._input: observations})
        return np.clip(actions, -1.0, 1.0), memory


def _checked_card(path: Path, content: bytes) -> ForeignCard:
    """The card of a graph that stands alone."""
    import onnx
    from google.protobuf.message import DecodeError

    try:
        model = onnx.load_model_from_string(content)
    except DecodeError as error:
        raise InputError(f"{path}: not a whole ONNX file ({error})") from None
    functions = {(function.domain, function.name) for function in model.functions}
    for message in _messages(model):
        if isinstance(message, onnx.TensorProto) and message.data_location == onnx.TensorProto.EXTERNAL:
            raise InputError(f"{path}: tensor {message.name!r} lies in another file, expected it inside")
        if isinstance(message, onnx.NodeProto):
            operator = f"{message.domain}.{message.op_type}".removeprefix(".")
            if message.domain not in _STANDARD and (message.domain, message.op_type) not in functions:
                raise InputError(f"{path}: operator {operator!r} is not one of the ONNX standard")
            if message.op_type in _RANDOM:
                raise InputError(f"{path}: operator {operator!r} is random, expected a policy without noise")
    notes = {entry.key: entry.value for entry in model.metadata_props}
    card = parse_card(path, notes.get(CARD_KEY, "{}"))
    return card if card.algorithm else card.model_copy(update={"algorithm": "ONNX"})


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
    try:
        return onnxruntime.InferenceSession(content, options, ["CPUExecutionProvider"])
    # Its errors have no class in common.
    except Exception as error:
        raise InputError(f"{path}: onnxruntime cannot run the graph ({_first_line(error)})") from None


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


def _check_output(path: Path, session: Any, observations: Batch) -> None:
    try:
        found = session.run(None, {session.get_inputs()[0].name: observations})
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
