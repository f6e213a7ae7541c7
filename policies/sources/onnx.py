"""Policies as ONNX graphs: any of the right shape can drive, and checkpoints can be written as such."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from nathlon.policies.checkpoint import ACTION_SIZE, ENCODER, NetworkPolicy
from nathlon.policies.mlp import EncodedMlp, Mlp
from nathlon.policies.policy import Batch
from nathlon.policies.policy_file import opening, read_policy_file
from nathlon.policies.sources.foreign import ForeignCard, observation_spec
from nathlon.policies.sources.normalisation import companions, identity_with
from nathlon.policies.sources.onnx_graph import OnnxGraph, open_session, shapes
from nathlon.policies.sources.onnx_model import checked_graph
from nathlon.policies.weights import CARD_KEY
from nathlon.sim.errors import InputError
from nathlon.sim.whole_file import whole_file

OPSET, IR_VERSION = 17, 8
"""Old enough for every runtime of the last years."""


class OnnxPolicy:
    """The policy of an ONNX file, its actions clipped to [-1, 1].

    Attributes:
        card: what is known of the policy.
        id: SHA-256 of the file, with that of the weights beside it.
        observation_spec: layout of the observations that it expects.
    """

    def __init__(self, card: ForeignCard, identity: str, session: Any, path: Path) -> None:
        """A policy of an `onnxruntime.InferenceSession`.

        Raises:
            InputError: if the graph does not map observations (n, size) to actions (n, 2).
        """
        self.card = card
        self.id = identity
        self._graph = OnnxGraph(session, path, card)
        self.observation_spec = observation_spec(path, identity, card, self._graph.size)
        self._graph.probe(self._actions)

    @classmethod
    def load(cls, path: Path) -> OnnxPolicy:
        """The policy stored in a file.

        Raises:
            InputError: if the file is no graph of the right shape, or needs more than itself.
        """
        with opening(path):
            content, beside = read_policy_file(path), companions(path).read()
            card, whole = checked_graph(path, content, beside[-1])
            return cls(card, identity_with(content, beside), open_session(path, whole), path)

    def initial_memory(self, n: int) -> Batch:
        """States of the graph, zeros (n, m) float32; mostly m is 0."""
        return self._graph.initial_memory(n)

    def act(self, observations: Batch, memory: Batch) -> tuple[Batch, Batch]:
        """Actions (n, 2) float32 for observations (n, observation_spec.size) float32, and memory."""
        numbers, memory = self._graph.act(observations, memory)
        return np.clip(numbers, -1.0, 1.0), memory

    def _actions(self, found: Any, n: int) -> Batch:
        expected = [("float32", (n, ACTION_SIZE))]
        if shapes([found]) != expected:
            raise InputError(
                f"{self._graph.path}: outputs for {n} observations are {shapes([found])}, expected {expected}"
            )
        return found


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

    network, size = policy.network, policy.observation_spec.size
    nodes, weights, layer = [], [], "observation"
    if isinstance(network, EncodedMlp):
        sizes = np.array([size - network.facts, network.facts])
        weights.append(numpy_helper.from_array(sizes, "sizes"))
        nodes.append(helper.make_node("Split", [layer, "sizes"], ["seen", "facts"], axis=1))
        layers = _layers(network.encoder, "facts", "encoded", ENCODER)
        nodes, weights = nodes + layers[0], weights + layers[1]
        nodes.append(helper.make_node("Concat", ["seen", "encoded"], ["inputs"], axis=1))
        layer, network = "inputs", network.network
    layers = _layers(network, layer, "action")
    nodes, weights = nodes + layers[0], weights + layers[1]
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
    helper.set_model_props(model, {CARD_KEY: policy.card.model_dump_json(exclude={"hidden", "encoder"})})
    return model.SerializeToString(deterministic=True)


def _layers(network: Mlp, layer: str, output: str, prefix: str = "") -> tuple[list[Any], list[Any]]:
    """The nodes of a perceptron and their weights.

    Args:
        network: the perceptron.
        layer, output: names of what it takes and gives.
        prefix: of the names of all between.
    """
    from onnx import helper, numpy_helper

    operators = {"relu": "Relu", "tanh": "Tanh"}
    nodes, weights = [], []
    for index, tensors in enumerate(network.layers):
        name, last = f"{prefix}{index}", index == len(network.layers) - 1
        names = [f"{name}.weight", f"{name}.bias"]
        weights += [numpy_helper.from_array(array, each) for array, each in zip(tensors, names, strict=True)]
        nodes.append(helper.make_node("Gemm", [layer, *names], [f"{name}.sum"]))
        layer = output if last else f"{name}.out"
        function = operators[network.output if last else network.hidden]
        nodes.append(helper.make_node(function, [f"{name}.sum"], [layer]))
    return nodes, weights
