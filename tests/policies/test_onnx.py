"""Policies as ONNX: our own come out as they went in, others of the right shape drive, no more."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any

import numpy as np
import onnx
import pytest
from onnx import TensorProto, helper, numpy_helper
from onnx.reference import ReferenceEvaluator
from typer.testing import CliRunner

from nathlon.arena.entrant import enter
from nathlon.arena.match import Match, Race, Seat
from nathlon.arena.match_policies import match_policies
from nathlon.arena.runner import run_match
from nathlon.cli import app
from nathlon.policies.bundled import generalist
from nathlon.policies.checkpoint import load_checkpoint
from nathlon.policies.load import load_policy
from nathlon.policies.mlp import Mlp
from nathlon.policies.sources.onnx import OnnxPolicy, export_onnx
from nathlon.sim.errors import InputError
from nathlon.sim.observation import ObservationSpec
from tests.support.checkpoints import BUNDLED

SIZE = ObservationSpec(course_points=2).size


@pytest.fixture(scope="module")
def exported(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("exported") / "policy.onnx"
    export_onnx(load_checkpoint(BUNDLED[0]), path)
    return path


def graph(
    nodes: list[onnx.NodeProto],
    shape: list[Any] | None = None,
    kind: int = TensorProto.FLOAT,
    actions: list[Any] | None = None,
    weights: list[onnx.TensorProto] | None = None,
    **more: Any,
) -> onnx.ModelProto:
    """A model from `x` to `y`."""
    return helper.make_model(
        helper.make_graph(
            nodes,
            "policy",
            [helper.make_tensor_value_info("x", kind, ["batch", SIZE] if shape is None else shape)],
            [helper.make_tensor_value_info("y", TensorProto.FLOAT, actions or ["batch", 2])],
            weights or [],
        ),
        opset_imports=[helper.make_opsetid("", 17), helper.make_opsetid("mine", 1)],
        ir_version=8,
        **more,
    )


WEIGHT = numpy_helper.from_array(np.full((SIZE, 2), 0.1, np.float32), "w")
PRODUCT = helper.make_node("MatMul", ["x", "w"], ["y"])


def plain(**more: Any) -> onnx.ModelProto:
    """A model that drives with a tenth of the sum of what it sees."""
    return graph([PRODUCT], weights=[WEIGHT], **more)


def test_an_export_gives_the_same_actions(exported: Path) -> None:
    ours, theirs = load_checkpoint(BUNDLED[0]), OnnxPolicy.load(exported)
    assert theirs.observation_spec == ours.observation_spec
    observations = (
        np.random.default_rng(0).standard_normal((64, ours.observation_spec.size)).astype(np.float32)
    )
    expected, _ = ours.act(observations, ours.initial_memory(64))
    actions, memory = theirs.act(observations, theirs.initial_memory(64))
    # Both round sums of hundreds of products, each in its own order: neither is nearer to the exact ones.
    layer = observations.astype(np.float64)
    assert isinstance(ours.network, Mlp)
    for weight, bias in ours.network.layers[:-1]:
        layer = np.maximum(layer @ weight.astype(np.float64) + bias, 0.0)
    weight, bias = ours.network.layers[-1]
    exact = np.tanh(layer @ weight.astype(np.float64) + bias)
    rounding = np.abs(expected - exact).max()
    assert rounding < 1e-5
    np.testing.assert_allclose(actions, exact, atol=3.0 * rounding)
    assert actions.dtype == np.float32
    assert memory.shape == (64, 0)
    np.testing.assert_array_equal(theirs.act(observations, memory)[0], actions)


def test_an_export_is_a_valid_graph_that_others_run(exported: Path) -> None:
    model = onnx.load(exported)
    onnx.checker.check_model(model, full_check=True)
    assert [each.name for each in (*model.graph.input, *model.graph.output)] == ["observation", "action"]
    ours = load_checkpoint(BUNDLED[0])
    observations = (
        np.random.default_rng(1).standard_normal((8, ours.observation_spec.size)).astype(np.float32)
    )
    found: Any = ReferenceEvaluator(model).run(None, {"observation": observations})
    np.testing.assert_allclose(found[0], ours.act(observations, ours.initial_memory(8))[0], atol=1e-5)


def test_an_export_carries_the_card_and_its_bytes_depend_on_the_policy_alone(
    exported: Path, tmp_path: Path
) -> None:
    policy = load_checkpoint(BUNDLED[0])
    again = tmp_path / "again.onnx"
    export_onnx(policy, again)
    assert again.read_bytes() == exported.read_bytes()
    assert [path.name for path in tmp_path.iterdir()] == ["again.onnx"]
    theirs = OnnxPolicy.load(again)
    assert theirs.id == hashlib.sha256(again.read_bytes()).hexdigest()
    assert theirs.card.model_dump(exclude={"output", "states"}) == policy.card.model_dump(
        exclude={"hidden", "encoder"}
    )
    assert enter(str(again), "lindenring", "gt3").step == policy.card.step
    with pytest.raises(InputError, match=r"again\.onnx: circuit is 'lindenring', expected 'porto-sereno'"):
        enter(str(again), "porto-sereno", "gt3")


def test_who_practises_does_so_when_exported(tmp_path: Path) -> None:
    policy = load_checkpoint(generalist())
    export_onnx(policy, tmp_path / "any.onnx")
    theirs = OnnxPolicy.load(tmp_path / "any.onnx")
    assert policy.observation_spec.practised_by == policy.id
    assert theirs.observation_spec == policy.card.observation.practising(theirs.id)
    assert theirs.observation_spec.plan_pace == 1.0


def test_an_export_races_as_its_checkpoint_does(tmp_path: Path) -> None:
    times = []
    export_onnx(load_checkpoint(BUNDLED[-1]), tmp_path / "last.onnx")
    for source in (str(BUNDLED[-1]), str(tmp_path / "last.onnx")):
        entrant = enter(source, "lindenring", "gt3")
        lap = Match(
            "race",
            "time_trial",
            "time_trial",
            "lindenring",
            "gt3",
            (entrant.id,),
            (source,),
            (Race(1, (Seat(0),)),),
        )
        results = run_match(lap, match_policies(lap))
        assert results["ending"].to_list() == ["finished"]
        times.append(results["race_time_s"].item())
    # Sums in another order, a thousand decisions each of which the car's place at the next depends on.
    assert times[1] == pytest.approx(times[0], rel=0.02)


def test_a_graph_of_another_program_drives(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    first, second = (rng.standard_normal(shape).astype(np.float32) for shape in ((SIZE, 8), (8, 2)))
    nodes = [
        helper.make_node("MatMul", ["x", "first"], ["sum"]),
        helper.make_node("Elu", ["sum"], ["features"]),
        helper.make_node("MatMul", ["features", "second"], ["y"]),
    ]
    weights = [numpy_helper.from_array(first, "first"), numpy_helper.from_array(second, "second")]
    path = tmp_path / "other.onnx"
    path.write_bytes(graph(nodes, weights=weights).SerializeToString())
    policy = load_policy(str(path), "lindenring", "gt3")
    observations = rng.normal(0.0, 0.05, (20, SIZE)).astype(np.float32)
    features = observations @ first
    expected = np.where(features > 0.0, features, np.expm1(features)) @ second
    actions, _ = policy.act(observations, policy.initial_memory(20))
    np.testing.assert_allclose(actions, expected.clip(-1.0, 1.0), atol=1e-5)
    assert (np.abs(expected) > 1.0).any(), "some are clipped"
    assert (np.abs(expected) < 1.0).any(), "and some are not"


def test_what_is_known_of_a_graph_without_a_card(tmp_path: Path) -> None:
    path = tmp_path / "plain.onnx"
    path.write_bytes(plain().SerializeToString())
    entrant = enter(str(path), "porto-sereno", "coupe")
    assert (entrant.algorithm, entrant.step, entrant.circuit) == ("ONNX", None, "porto-sereno")
    assert OnnxPolicy.load(path).observation_spec == ObservationSpec(course_points=2)


def test_a_card_tells_what_the_graph_cannot(tmp_path: Path) -> None:
    path = tmp_path / "carded.onnx"
    spec = ObservationSpec(course_points=2, horizon_s=2.0)
    model = plain()
    helper.set_model_props(model, {"nathlon": json.dumps({"observation": spec.to_dict(), "car": "coupe"})})
    path.write_bytes(model.SerializeToString())
    assert OnnxPolicy.load(path).observation_spec == spec
    with pytest.raises(InputError, match=r"carded\.onnx: car is 'coupe', expected 'gt3'"):
        enter(str(path), "lindenring", "gt3")


def external() -> onnx.ModelProto:
    """A model whose weights lie elsewhere."""
    model = plain()
    weight = model.graph.initializer[0]
    weight.ClearField("raw_data")
    weight.data_location = TensorProto.EXTERNAL
    weight.external_data.add(key="location", value="weights.bin")
    return model


def hidden_external() -> onnx.ModelProto:
    """A model with a constant that lies elsewhere."""
    constant = helper.make_node("Constant", [], ["w"], value=external().graph.initializer[0])
    return graph([constant, PRODUCT])


def memory_eater() -> onnx.ModelProto:
    """A file of a few hundred bytes that asks for 4 GB."""
    nodes = [
        helper.make_node("ConstantOfShape", ["many"], ["zeros"]),
        helper.make_node("ReduceMax", ["zeros"], ["zero"], keepdims=0),
        helper.make_node("MatMul", ["x", "w"], ["product"]),
        helper.make_node("Add", ["product", "zero"], ["y"]),
    ]
    return graph(nodes, weights=[numpy_helper.from_array(np.array([10**9]), "many"), WEIGHT])


def props(**entries: str) -> onnx.ModelProto:
    """The plain model with metadata."""
    model = plain()
    helper.set_model_props(model, entries)
    return model


NOISE = helper.make_node("RandomNormalLike", ["x"], ["r"])
BRANCH = graph([NOISE, helper.make_node("MatMul", ["r", "w"], ["y"])], weights=[WEIGHT]).graph
del BRANCH.input[:]
CHOICE = [numpy_helper.from_array(np.array(True), "choice"), WEIGHT]
FLOATS = helper.make_node("Cast", ["x"], ["y"], to=TensorProto.FLOAT)
TANH = helper.make_node("Tanh", ["x"], ["y"])
SUM = helper.make_node("ReduceSum", ["x"], ["y"], keepdims=1)


@pytest.mark.parametrize(
    ("model", "message"),
    [
        (external(), "tensor 'w' lies in another file"),
        (hidden_external(), "tensor 'w' lies in another file"),
        (graph([helper.make_node("Drive", ["x"], ["y"], domain="mine")]), "'mine.Drive' is not one of"),
        (graph([NOISE, helper.make_node("MatMul", ["r", "w"], ["y"])], weights=[WEIGHT]), "Like' is random"),
        (
            graph(
                [helper.make_node("If", ["choice"], ["y"], then_branch=BRANCH, else_branch=BRANCH)],
                weights=CHOICE,
            ),
            "'RandomNormalLike' is random",
        ),
        (graph([helper.make_node("Unheard", ["x"], ["y"])]), "onnxruntime cannot run the graph"),
        (plain(shape=[2, SIZE]), "takes 2 observations at once, expected any number or 1"),
        (graph([SUM], shape=["batch", SIZE, 1], actions=[1, 1, 1]), "outputs for 3 observations are"),
        (graph([FLOATS], kind=TensorProto.DOUBLE, actions=["b", SIZE]), "outputs for 3 observations are"),
        (graph([SUM], shape=["batch", "size"]), "expected one"),
        (graph([TANH], actions=["batch", SIZE]), r"\(3, \d+\)\)\], expected"),
        (graph([SUM], actions=[1, 1]), r"outputs for 3 observations are \[\('float32', \(1, 1\)\)\], exp"),
        (graph([TANH], shape=["batch", SIZE + 1], actions=["b", SIZE + 1]), f"takes {SIZE + 1} "),
        (graph([helper.make_node("Reshape", ["x", "w"], ["y"])], weights=[
            numpy_helper.from_array(np.array([5, 2]), "w")]), "fails on 3 observations"),
        (props(nathlon="{"), "the card"),
        (props(nathlon='{"hidden": [3]}'), "the card: field hidden"),
    ],
)  # fmt: skip
def test_other_graphs_are_refused(tmp_path: Path, model: onnx.ModelProto, message: str) -> None:
    path = tmp_path / "other.onnx"
    path.write_bytes(model.SerializeToString())
    (tmp_path / "weights.bin").write_bytes(bytes(8 * SIZE))
    with pytest.raises(InputError, match=rf"other\.onnx: .*{message}") as caught:
        OnnxPolicy.load(path)
    assert "\n" not in str(caught.value)


def test_other_files_are_refused(tmp_path: Path, exported: Path) -> None:
    path = tmp_path / "none.onnx"
    with pytest.raises(InputError, match=r"none\.onnx: cannot read the policy: No such file"):
        OnnxPolicy.load(path)
    content = exported.read_bytes()
    for part in (b"", b"a text that is no graph", content[: len(content) // 2], content[:-7]):
        path.write_bytes(part)
        with pytest.raises(InputError, match=r"none\.onnx: "):
            OnnxPolicy.load(path)


def test_a_file_that_cannot_be_written(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"missing/x\.onnx: cannot be written"):
        export_onnx(load_checkpoint(BUNDLED[0]), tmp_path / "missing" / "x.onnx")


def test_the_command_exports(tmp_path: Path, exported: Path) -> None:
    path = tmp_path / "policy.onnx"
    done = CliRunner().invoke(app, ["export", str(BUNDLED[0]), "--onnx", str(path)])
    assert done.exit_code == 0
    assert str(path) in done.stdout
    assert path.read_bytes() == exported.read_bytes()
