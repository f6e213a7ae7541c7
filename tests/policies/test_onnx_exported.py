"""ONNX graphs as exporters write them: batches of one, several inputs and outputs, weights beside them."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import onnx
import pytest
from gymnasium.spaces import Box, Dict, Discrete, Space, flatten
from numpy.typing import NDArray
from onnx import TensorProto, helper, numpy_helper

from nathlon.policies.general import load_general
from nathlon.policies.sources.identity import policy_id
from tests.support.refusals import refusal

SEEN = Box(-np.inf, np.inf, (4,), np.float32)
RNG = np.random.default_rng(0)
WEIGHT = RNG.standard_normal((4, 3)).astype(np.float32)
SHOWN = RNG.standard_normal((1000, 4)).astype(np.float32)
FLOAT, HALF = TensorProto.FLOAT, TensorProto.FLOAT16
PRODUCT = helper.make_node("MatMul", ["x", "w"], ["y"])
Value = tuple[str, int, list[Any]]


def graph(
    nodes: Sequence[onnx.NodeProto] = (PRODUCT,),
    inputs: Sequence[Value] = (("x", FLOAT, ["n", 4]),),
    outputs: Sequence[Value] = (("y", FLOAT, ["n", 3]),),
    weight: NDArray[Any] = WEIGHT,
    opset: int = 17,
    output: str | None = None,
) -> onnx.ModelProto:
    """A model with the weights `w`, and a card that names an output."""
    taken, given = (
        [helper.make_tensor_value_info(*value) for value in values] for values in (inputs, outputs)
    )
    made = helper.make_graph(nodes, "policy", taken, given, [numpy_helper.from_array(weight, "w")])
    model = helper.make_model(made, opset_imports=[helper.make_opsetid("", opset)], ir_version=4)
    if output:
        helper.set_model_props(model, {"nathlon": json.dumps({"output": output})})
    return model


def numbers(path: Path, model: onnx.ModelProto, shown: Any = SHOWN, seen: Space[Any] = SEEN) -> NDArray[Any]:
    """What a policy of a model answers."""
    path.write_bytes(model.SerializeToString())
    policy = load_general(str(path), seen, Box(-np.inf, np.inf, (3,), np.float32))
    return policy.act(shown, policy.initial_memory(len(shown)))[0]


@pytest.mark.parametrize("opset", [9, 13, 17, 21])
def test_a_batch_of_one_is_asked_row_by_row(tmp_path: Path, opset: int) -> None:
    one = graph(inputs=[("x", FLOAT, [1, 4])], outputs=[("y", FLOAT, [1, 3])], opset=opset)
    np.testing.assert_allclose(numbers(tmp_path / "a.onnx", one), SHOWN @ WEIGHT, atol=1e-5)
    several = graph(inputs=[("x", FLOAT, [3, 4])], outputs=[("y", FLOAT, [3, 3])])
    with refusal(
        tmp_path / "a.onnx", "takes 3 observations at once, expected any number or 1: export it with"
    ):
        numbers(tmp_path / "a.onnx", several)


def test_halves_and_doubles_are_numbers_too(tmp_path: Path) -> None:
    for kind, dtype in ((HALF, np.float16), (TensorProto.DOUBLE, np.float64)):
        model = graph(
            inputs=[("x", kind, ["n", 4])], outputs=[("y", kind, ["n", 3])], weight=WEIGHT.astype(dtype)
        )
        found = numbers(tmp_path / "a.onnx", model)
        np.testing.assert_allclose(found, SHOWN @ WEIGHT, atol=2e-2)
        assert found.dtype == np.float32


SUM = helper.make_node("ReduceSum", ["y"], ["value"], axes=[1], keepdims=1)
FLAT = helper.make_node("ReduceMean", ["y"], ["log"], axes=[1], keepdims=0)
VALUE: list[Value] = [("value", FLOAT, ["n", 1])]
ALL: list[Value] = [("y", FLOAT, ["n", 3]), *VALUE, ("log", FLOAT, ["n"])]


def test_one_of_several_outputs_is_the_actions(tmp_path: Path) -> None:
    path, nodes = tmp_path / "a.onnx", [PRODUCT, SUM, FLAT]
    for outputs, named in (
        (ALL, None),  # as Stable-Baselines3's documentation exports them
        ([*reversed(ALL)], "y"),
    ):
        model = graph(nodes, outputs=outputs, opset=11, output=named)
        np.testing.assert_allclose(numbers(path, model), SHOWN @ WEIGHT, atol=1e-5)
    renamed = [
        helper.make_node("MatMul", ["x", "w"], ["Actions"]),
        helper.make_node("Neg", ["Actions"], ["b"]),
    ]
    two: list[Value] = [("b", FLOAT, ["n", 3]), ("Actions", FLOAT, ["n", 3])]
    np.testing.assert_allclose(numbers(path, graph(renamed, outputs=two)), SHOWN @ WEIGHT, atol=1e-5)
    with refusal(path, "outputs are 'value', 'y', expected one, or a card whose field 'output' names"):
        numbers(path, graph(nodes, outputs=[*VALUE, ALL[0]], opset=11))
    with refusal(path, "has no output 'z', expected y"):
        numbers(path, graph(output="z"))


def test_several_inputs_are_those_of_a_dictionary(tmp_path: Path) -> None:
    seen = Dict(
        {"near": Box(-9.0, 9.0, (1, 2), np.float32), "far": Box(-9.0, 9.0, (2,)), "light": Discrete(3)}
    )
    nodes = [
        helper.make_node("Flatten", ["near"], ["flat"]),
        helper.make_node("Cast", ["light"], ["number"], to=FLOAT),
        helper.make_node("Concat", ["flat", "far"], ["x"], axis=1),
        helper.make_node("MatMul", ["x", "w"], ["product"]),
        helper.make_node("Add", ["product", "number"], ["y"]),
    ]
    inputs: list[Value] = [
        ("near", FLOAT, ["n", 1, 2]),
        ("far", FLOAT, ["n", 2]),
        ("light", TensorProto.INT64, ["n", 1]),
    ]
    seen.seed(0)
    drawn = [seen.sample() for _ in range(50)]
    shown = np.array([flatten(seen, each) for each in drawn], np.float32)
    rows = [np.concatenate([each["near"][0], each["far"]]) @ WEIGHT + each["light"] for each in drawn]
    found = numbers(tmp_path / "a.onnx", graph(nodes, inputs), shown, seen)
    np.testing.assert_allclose(found, rows, atol=1e-4)
    with refusal(tmp_path / "a.onnx", r"inputs are near .*; expected one, tensor\(float\)"):
        numbers(tmp_path / "a.onnx", graph(nodes, inputs))


def outside(location: str, **entries: int) -> onnx.ModelProto:
    """A model whose weights lie in another file."""
    model = graph()
    tensor = model.graph.initializer[0]
    tensor.ClearField("raw_data")
    tensor.data_location = TensorProto.EXTERNAL
    for key, value in {"location": location, "offset": 8, "length": WEIGHT.nbytes, **entries}.items():
        tensor.external_data.add(key=key, value=str(value))
    return model


def test_weights_may_lie_in_a_file_beside_it(tmp_path: Path) -> None:
    path = tmp_path / "a.onnx"
    (tmp_path / "a.onnx.data").write_bytes(bytes(8) + WEIGHT.tobytes())
    np.testing.assert_allclose(numbers(path, outside("a.onnx.data")), SHOWN @ WEIGHT, atol=1e-5)
    known = load_general(str(path)).id
    assert known == policy_id(str(path))
    (tmp_path / "a.onnx.data").write_bytes(bytes(8) + (2 * WEIGHT).tobytes())
    assert policy_id(str(path)) != known


@pytest.mark.parametrize(
    ("location", "entries", "message"),
    [
        ("../a.onnx.data", {}, r"its weights lie in \.\./a\.onnx\.data, expected one file beside it"),
        ("/etc/passwd", {}, "its weights lie in /etc/passwd"),
        ("a.onnx.data", {"length": 1 << 30}, "more than 536870912 bytes of weights"),
        ("a.onnx.data", {"offset": 9}, "'w' lies at 9 to 57 of the file beside it, which has 56 bytes"),
        ("a.onnx.data", {"length": -1}, "offset or length '-1'"),
        ("a.onnx.data", {"length": 8}, "onnxruntime cannot run the graph"),
    ],
)
def test_weights_that_lie_elsewhere_are_refused(
    tmp_path: Path, location: str, entries: dict[str, int], message: str
) -> None:
    (tmp_path / "a.onnx.data").write_bytes(bytes(8) + WEIGHT.tobytes())
    with refusal(tmp_path / "a.onnx", message):
        numbers(tmp_path / "a.onnx", outside(location, **entries))


def test_weights_that_are_gone_are_asked_for(tmp_path: Path) -> None:
    with refusal(tmp_path / "a.onnx", "lies in another file, expected that beside it as 'a.onnx.data', or"):
        numbers(tmp_path / "a.onnx", outside("a.onnx.data"))
