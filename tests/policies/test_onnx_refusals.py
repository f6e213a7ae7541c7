"""ONNX graphs that are random or do not hold together: refused in one sentence."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import onnx
import onnxruntime
import pytest
from onnx import TensorProto, helper, numpy_helper

from nathlon.policies.sources.foreign import ForeignCard
from nathlon.policies.sources.onnx import OnnxPolicy
from tests.policies.test_onnx import NOISE, PRODUCT, SIZE, TANH, WEIGHT, graph, plain, props
from tests.support.refusals import refusal

FALSE, TRUE = (numpy_helper.from_array(np.array(value), "on") for value in (False, True))


def dropping(switch: list[onnx.NodeProto], weights: list[onnx.TensorProto]) -> onnx.ModelProto:
    """A model with a dropout that is switched by `on`."""
    nodes = [*switch, helper.make_node("Dropout", ["x", "", "on"], ["kept"])]
    return graph([*nodes, helper.make_node("MatMul", ["kept", "w"], ["y"])], weights=[WEIGHT, *weights])


def constant(value: onnx.TensorProto) -> list[onnx.NodeProto]:
    return [helper.make_node("Constant", [], ["on"], value=value)]


def in_two_fields() -> onnx.TensorProto:
    """True where the runtime reads it, and False in another field."""
    return onnx.TensorProto(name="on", data_type=onnx.TensorProto.BOOL, raw_data=b"\1", int32_data=[0])


def said_by_the_caller() -> onnx.ModelProto:
    """`on` is False in a function, but for an attribute with which that is called."""
    [switch] = constant(FALSE)
    switch.attribute[0].ref_attr_name = "flag"
    drop = helper.make_node("Dropout", ["x", "", "on"], ["kept"])
    call = helper.make_node("Drop", ["x"], ["kept"], domain="own", flag=TRUE)
    model = graph([call, helper.make_node("MatMul", ["kept", "w"], ["y"])], weights=[WEIGHT])
    opsets = [helper.make_opsetid("", 17)]
    model.functions.append(
        helper.make_function("own", "Drop", ["x"], ["kept"], [switch, drop], opsets, ["flag"])
    )
    model.opset_import.append(helper.make_opsetid("own", 1))
    return model


def in_branches() -> onnx.ModelProto:
    """`on` is stored as False in one branch, and computed in the other one, which drops."""
    plain_branch = graph([PRODUCT], weights=[WEIGHT, FALSE]).graph
    seen = helper.make_node("IsNaN", ["x"], ["unknown"])
    off = [seen, helper.make_node("Not", ["unknown"], ["known"])]
    index = numpy_helper.from_array(np.zeros(1, np.int64), "first")
    flat = helper.make_node("Reshape", ["known", "minus"], ["row"])
    pick = helper.make_node("Gather", ["row", "first"], ["one"])
    on = helper.make_node("Squeeze", ["one"], ["on"])
    minus = numpy_helper.from_array(np.array([-1]), "minus")
    drop = helper.make_node("Dropout", ["x", "", "on"], ["kept"])
    product = helper.make_node("MatMul", ["kept", "w"], ["y"])
    dropping_branch = graph([*off, flat, pick, on, drop, product], weights=[WEIGHT, index, minus]).graph
    for branch in (plain_branch, dropping_branch):
        del branch.input[:]
    choose = helper.make_node("If", ["choice"], ["y"], then_branch=plain_branch, else_branch=dropping_branch)
    return graph([choose], weights=[numpy_helper.from_array(np.array(True), "choice")])


@pytest.mark.parametrize(
    "model",
    [
        dropping([], [TRUE]),
        dropping(constant(TRUE), []),
        dropping(
            [
                helper.make_node("Constant", [], ["off"], value=FALSE),
                helper.make_node("Not", ["off"], ["on"]),
            ],
            [],
        ),
        in_branches(),
        dropping([], [in_two_fields()]),
        dropping(constant(in_two_fields()), []),
        said_by_the_caller(),
    ],
)
def test_a_dropout_that_may_drop_is_refused(tmp_path: Path, model: onnx.ModelProto) -> None:
    path = tmp_path / "other.onnx"
    path.write_bytes(model.SerializeToString())
    with refusal(path, "operator 'Dropout' is random, expected a policy without noise"):
        OnnxPolicy.load(path)


@pytest.mark.parametrize("model", [dropping([], [FALSE]), dropping(constant(FALSE), [])])
def test_a_dropout_that_is_switched_off_drives(tmp_path: Path, model: onnx.ModelProto) -> None:
    path = tmp_path / "other.onnx"
    path.write_bytes(model.SerializeToString())
    policy = OnnxPolicy.load(path)
    observations = np.full((2, SIZE), 0.01, np.float32)
    actions, _ = policy.act(observations, policy.initial_memory(2))
    np.testing.assert_allclose(actions, observations @ np.full((SIZE, 2), 0.1, np.float32), rtol=1e-6)


@pytest.mark.parametrize("domain", ["com.microsoft", "ai.onnx"])
def test_a_function_must_have_a_name_of_its_own(tmp_path: Path, domain: str) -> None:
    path = tmp_path / "other.onnx"
    model = graph([helper.make_node("BiasDropout", ["x", "w"], ["y"], domain=domain)], weights=[WEIGHT])
    opset = [helper.make_opsetid("", 17)]
    model.functions.append(helper.make_function(domain, "BiasDropout", ["x", "w"], ["y"], [PRODUCT], opset))
    path.write_bytes(model.SerializeToString())
    with refusal(path, f"function '{domain}.BiasDropout' has the name of an operator of onnxruntime"):
        OnnxPolicy.load(path)


def test_a_graph_must_do_the_same_twice(tmp_path: Path) -> None:
    """Tried on a graph that only running it shows to be random, for it did not go through the check."""
    noisy = graph([NOISE, helper.make_node("MatMul", ["r", "w"], ["y"])], weights=[WEIGHT])
    session = onnxruntime.InferenceSession(noisy.SerializeToString(), providers=["CPUExecutionProvider"])
    path = tmp_path / "noisy.onnx"
    with refusal(path, "gives other actions for the same observations"):
        OnnxPolicy(ForeignCard(), "", session, path)


def sparse() -> onnx.ModelProto:
    """A bias of a billion zeros, stored as one number."""
    many = onnx.SparseTensorProto(dims=[10**9])
    many.values.CopyFrom(numpy_helper.from_array(np.ones(1, np.float32), "many"))
    many.indices.CopyFrom(numpy_helper.from_array(np.zeros(1, np.int64), "places"))
    model = graph(
        [
            PRODUCT,
            helper.make_node("ReduceMax", ["many"], ["most"]),
            helper.make_node("Add", ["y", "most"], ["z"]),
        ],
        weights=[WEIGHT],
    )
    model.graph.sparse_initializer.append(many)
    return model


def sized(*dims: int, content: bytes = b"") -> onnx.ModelProto:
    """The plain model, the weights of which say that they have this shape."""
    weight = onnx.TensorProto(name="w", data_type=TensorProto.FLOAT, dims=dims, raw_data=content)
    return graph([PRODUCT], weights=[weight])


def misnamed() -> bytes:
    return plain().SerializeToString().replace(b"MatMul", b"Mat\xff\xfeul")


CYCLE = [helper.make_node("Add", ["y", "x"], ["sum"]), helper.make_node("MatMul", ["sum", "w"], ["y"])]
TWO_CARDS = plain()
for _ in range(2):
    TWO_CARDS.metadata_props.add(key="nathlon", value="{}")


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (sparse().SerializeToString(), "onnxruntime cannot run the graph"),
        (sized(10**9, 2).SerializeToString(), "onnxruntime cannot run the graph"),
        (sized(2**40, 2**40).SerializeToString(), "onnxruntime cannot run the graph"),
        (sized(SIZE, 2).SerializeToString(), "onnxruntime cannot run the graph"),
        (sized(-1, 2, content=bytes(8)).SerializeToString(), "onnxruntime cannot run the graph"),
        (graph(CYCLE, weights=[WEIGHT]).SerializeToString(), "onnxruntime cannot run the graph"),
        (graph([TANH], shape=["batch", -5]).SerializeToString(), "expected one"),
        (graph([TANH], shape=["batch", 2**62]).SerializeToString(), "takes 4611686018427387904 numbers"),
        (misnamed(), "not a whole ONNX file"),
        (plain().SerializeToString() + b"\xca\x01\x00" * 200_000, "has more than 200000 parts"),
        (TWO_CARDS.SerializeToString(), "has 2 cards, expected one"),
        (props(nathlon='{"car": "a", "car": "b"}').SerializeToString(), "key 'car' stands twice"),
    ],
)
def test_graphs_that_do_not_hold_together_are_refused(tmp_path: Path, content: bytes, message: str) -> None:
    path = tmp_path / "other.onnx"
    path.write_bytes(content)
    with refusal(path, message):
        OnnxPolicy.load(path)
