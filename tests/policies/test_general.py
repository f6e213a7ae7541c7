"""Policies of any environment: graphs, checkpoints of QR-SAC, plugins and the one that draws."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import onnx
import pytest
from gymnasium.spaces import Box, Discrete, MultiDiscrete, Space
from numpy.typing import NDArray
from onnx import TensorProto, helper, numpy_helper

from nathlon.policies.checkpoint import load_checkpoint
from nathlon.policies.general import load_general
from nathlon.policies.general.checkpoint import GeneralCard, save_general
from nathlon.policies.general.outputs import IllegalActionError
from nathlon.policies.qrsac.gymnasium_training import GymnasiumTraining
from nathlon.sim.errors import InputError
from tests.policies.test_gymnasium_training import SMALL, Counter, counters, targets
from tests.policies.test_onnx import external
from tests.policies.test_plugin import install
from tests.support.checkpoints import BUNDLED
from tests.support.refusals import refusal

SEEN = Box(-np.inf, np.inf, (4,), np.float32)
RNG = np.random.default_rng(0)
WEIGHT = RNG.standard_normal((4, 3)).astype(np.float32)
OBSERVATIONS = RNG.standard_normal((20, 4)).astype(np.float32)
PRODUCT = helper.make_node("MatMul", ["x", "w"], ["y"])
SCORES = helper.make_node("MatMul", ["x", "w"], ["scores"])
BEST = helper.make_node("ArgMax", ["scores"], ["y"], axis=1, keepdims=0)
BEST_COLUMN = helper.make_node("ArgMax", ["scores"], ["y"], axis=1, keepdims=1)


def graph(
    path: Path, *nodes: onnx.NodeProto, kind: int = TensorProto.FLOAT, size: Any = 4, **card: Any
) -> str:
    """Write a graph from `x` to `y` with the weights `w`."""
    shape: Any = {"MatMul": ["n", 3], "ArgMax": ["n"]}.get(nodes[-1].op_type)
    model = helper.make_model(
        helper.make_graph(
            nodes,
            "policy",
            [helper.make_tensor_value_info("x", TensorProto.FLOAT, ["n", size])],
            [helper.make_tensor_value_info("y", kind, shape if nodes[-1] is not BEST_COLUMN else ["n", 1])],
            [numpy_helper.from_array(WEIGHT, "w")],
        ),
        opset_imports=[helper.make_opsetid("", 17)],
        ir_version=8,
    )
    if card:
        helper.set_model_props(model, {"nathlon": json.dumps(card)})
    path.write_bytes(model.SerializeToString())
    return str(path)


def actions(source: str, space: Space[Any], observations: NDArray[np.float32] = OBSERVATIONS) -> list[Any]:
    """What a policy does, having seen some observations."""
    policy = load_general(source, Box(-np.inf, np.inf, observations.shape[1:]), space)
    outputs, memory = policy.act(observations, policy.initial_memory(len(observations)))
    assert memory.shape == (len(observations), 0)
    found = [policy.decode(row, space, np.random.default_rng(0)) for row in outputs]
    assert all(space.contains(action) for action in found)
    return found


def test_a_graph_of_numbers_is_clipped_in_a_box(tmp_path: Path) -> None:
    path = graph(tmp_path / "a.onnx", PRODUCT)
    expected = np.clip(OBSERVATIONS @ WEIGHT, -0.5, 1.0)
    np.testing.assert_allclose(actions(path, Box(-0.5, 1.0, (3,))), expected, atol=1e-6)


def test_a_graph_of_numbers_scores_choices(tmp_path: Path) -> None:
    path, scores = graph(tmp_path / "a.onnx", PRODUCT), OBSERVATIONS @ WEIGHT
    assert actions(path, Discrete(3, start=2)) == [2 + int(row.argmax()) for row in scores]
    expected = [[row[:2].argmax(), 0] for row in scores]
    np.testing.assert_array_equal(actions(path, MultiDiscrete([2, 1])), expected)


@pytest.mark.parametrize("last", [BEST, BEST_COLUMN])
def test_a_graph_of_whole_numbers_gives_actions(tmp_path: Path, last: onnx.NodeProto) -> None:
    path = graph(tmp_path / "a.onnx", SCORES, last, kind=TensorProto.INT64)
    assert actions(path, Discrete(3)) == list((OBSERVATIONS @ WEIGHT).argmax(1))
    np.testing.assert_array_equal(
        actions(path, MultiDiscrete([3])), (OBSERVATIONS @ WEIGHT).argmax(1)[:, None]
    )
    policy = load_general(path, SEEN, Discrete(3))
    outputs, _ = policy.act(OBSERVATIONS, policy.initial_memory(20))
    with pytest.raises(IllegalActionError, match=r"expected an action of Discrete\(3, start=3\)"):
        policy.decode(outputs[0], Discrete(3, start=3), RNG)


def test_the_card_of_a_graph(tmp_path: Path) -> None:
    path = graph(tmp_path / "a.onnx", PRODUCT, algorithm="mine", step=4, seed=7)
    policy = load_general(path)
    assert (policy.algorithm, policy.step, policy.seed, policy.observation_size) == ("mine", 4, 7, 4)
    assert policy.id == hashlib.sha256(Path(path).read_bytes()).hexdigest()
    assert load_general(graph(tmp_path / "b.onnx", PRODUCT)).algorithm == "ONNX"


def test_other_graphs_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.onnx"
    identity = helper.make_node("Identity", ["x"], ["y"])
    cases: list[tuple[list[onnx.NodeProto], dict[str, Any], str]] = [
        ([identity], {"size": 1 << 30}, "takes 1073741824 numbers, expected 1 to 1048576"),
        ([identity], {"size": 0}, "expected one, tensor"),
        ([identity], {"size": "size"}, "expected one, tensor"),
        ([helper.make_node("Cast", ["x"], ["y"], to=9)], {"kind": 9}, r"'bool', \(3, 4\).*expected one"),
        ([helper.make_node("Transpose", ["x"], ["y"])], {}, r"float32', \(4, 3\)\)\], expected one of"),
        ([helper.make_node("Shape", ["x"], ["y"])], {"kind": TensorProto.INT64}, "expected one of float32"),
        ([helper.make_node("RandomNormalLike", ["x"], ["y"])], {}, "is random"),
    ]
    for nodes, settings, message in cases:
        graph(path, *nodes, **settings)
        with refusal(path, message):
            load_general(str(path))
    path.write_bytes(external().SerializeToString())
    with refusal(path, "lies in another file"):
        load_general(str(path))


@pytest.fixture(scope="module")
def trained(tmp_path_factory: pytest.TempPathFactory) -> tuple[GymnasiumTraining, Path]:
    """A training of a few updates, and what it saved."""
    training = GymnasiumTraining(targets(2), SMALL, 5, warm_up=80, capacity=200, compiled=False)
    training.advance(120)
    path = tmp_path_factory.mktemp("trained") / "target.safetensors"
    training.save(path)
    return training, path


def test_what_is_trained_acts_as_it_did(trained: tuple[GymnasiumTraining, Path]) -> None:
    training, path = trained
    space = Box(-0.5, 0.5, (1,), np.float32)
    observations = np.linspace(-4.0, 4.0, 30, dtype=np.float32)[:, None]
    expected = 0.5 * training.learner.act(observations, stochastic=False)
    np.testing.assert_allclose(actions(str(path), space, observations), expected, atol=2e-3)  # float16
    policy = load_general(str(path))
    assert policy.id == hashlib.sha256(path.read_bytes()).hexdigest()
    made = int(training.learner.state_dict()["step"])
    assert made > 10
    assert (policy.algorithm, policy.step, policy.seed) == ("qr-sac", made, 5)
    again = path.with_name("again.safetensors")
    training.save(again)
    assert again.read_bytes() == path.read_bytes()


def test_it_acts_in_the_spaces_that_it_was_trained_in(tmp_path: Path) -> None:
    training = GymnasiumTraining(counters(gymnasium.vector.AutoresetMode.NEXT_STEP), SMALL, 0, compiled=False)
    training.save(tmp_path / "a.safetensors")
    policy = load_general(str(tmp_path / "a.safetensors"), Counter.observation_space, Counter.action_space)
    outputs, _ = policy.act(np.ones((1, 2), np.float32), policy.initial_memory(1))
    action = policy.decode(outputs[0], Counter.action_space, RNG)
    squashed = training.learner.act(np.ones((1, 2), np.float32), stochastic=False)[0]
    np.testing.assert_allclose(action, [2.0 + 4.0 * squashed[0], 0.5 + 0.5 * squashed[1]], atol=5e-3)


def test_what_cannot_be_saved(trained: tuple[GymnasiumTraining, Path], tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"missing/a\.safetensors: cannot be written"):
        trained[0].save(tmp_path / "missing" / "a.safetensors")


CARD = GeneralCard(
    algorithm="qr-sac",
    hidden=(5,),
    observation_size=4,
    action_size=3,
    step=1,
    seed=2,
    created_by={"nathlon": "0"},
)


def tensors(card: GeneralCard = CARD) -> dict[str, NDArray[np.float32]]:
    rng = np.random.default_rng(0)
    return {name: rng.standard_normal(shape).astype(np.float32) for name, shape in card.shapes.items()}


def test_other_checkpoints_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.safetensors"
    save_general(path, tensors(), CARD)
    with refusal(path, "no card under 'nathlon' in the header"):
        load_checkpoint(path)
    with refusal(path, "gives 3 numbers, expected 2"):
        load_general(str(path), SEEN, Box(-1.0, 1.0, (2,)))
    with refusal(path, "expected a bounded Box"):
        load_general(str(path), SEEN, Box(0.0, np.inf, (3,)))
    with pytest.raises(InputError, match=r"tensor '0.weight' has shape \(4, 5\), expected \(7, 5\)"):
        save_general(path, tensors(), CARD.model_copy(update={"observation_size": 7}))
    path.write_bytes(path.read_bytes().replace(b"observation_size", b"observation_sort"))
    with refusal(path, "the card: field observation_size"):
        load_general(str(path))
    path.write_bytes(BUNDLED[0].read_bytes())
    with refusal(path, "no card under 'nathlon.general' in the header"):
        load_general(str(path))
    with pytest.raises(InputError, match=r"none\.onnx: "):
        load_general(str(tmp_path / "none.onnx"))


CODE = """
import numpy as np

class Counting:
    '''The choice is the number of steps so far.'''

    def __init__(self, observation_space, action_space):
        self.spaces = observation_space, action_space

    def initial_memory(self, n):
        return np.zeros((n, 1), np.float32)

    def act(self, observations, memory):
        return memory.copy(), memory + 1

class Shapeless(Counting):
    def act(self, observations, memory):
        return memory[:, 0], memory

class Wordy(Counting):
    def act(self, observations, memory):
        return np.array([["left"]]), memory

class Single(Counting):
    def act(self, observations, memory):
        return memory

class Nothing:
    def __init__(self, observation_space, action_space):
        pass

def failing(observation_space, action_space):
    raise RuntimeError("out of fuel")
"""
NAMES = ("Counting", "Shapeless", "Wordy", "Single", "Nothing", "failing")


@pytest.fixture
def site(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A module with entry points."""
    (tmp_path / "others.py").write_text(CODE)
    install(tmp_path, "others", "[nathlon.policies]\n" + "".join(f"{n} = others:{n}\n" for n in NAMES))
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(__import__("sys").modules, "others", raising=False)


def test_a_plugin_acts_and_remembers(site: None) -> None:
    policy = load_general("plugin:Counting", SEEN, Discrete(3))
    assert (policy.algorithm, policy.step, len(policy.id)) == ("plugin", None, 64)
    memory, decided = policy.initial_memory(1), []
    for _ in range(3):
        outputs, memory = policy.act(np.zeros((1, 4), np.float32), memory)
        decided.append(policy.decode(outputs[0], Discrete(3), RNG))
    assert decided == [0, 1, 2]
    outputs, _ = policy.act(np.zeros((1, 4), np.float32), memory)
    with pytest.raises(IllegalActionError, match=r"gives \[3.\], expected an action of Discrete\(3\)"):
        policy.decode(outputs[0], Discrete(3), RNG)
    with pytest.raises(InputError, match="plugin:Counting: gives 1 numbers, expected 2"):
        policy.decode(outputs[0], Box(-1.0, 1.0, (2,)), RNG)


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("Shapeless", r"actions of shape \(2,\), expected \(2, any number\)"),
        ("Wordy", "actions of <U4, expected an array of numbers"),
        ("Single", "act gives ndarray, expected actions and memory"),
    ],
)
def test_what_a_plugin_gives_is_checked(site: None, name: str, message: str) -> None:
    policy = load_general(f"plugin:{name}", SEEN, Discrete(3))
    with pytest.raises(IllegalActionError, match=message):
        policy.act(np.zeros((2, 4), np.float32), policy.initial_memory(2))


def test_what_is_no_plugin_is_refused(site: None) -> None:
    cases = [
        ("nobody", "no package offers this policy"),
        ("failing", r"others:failing raised RuntimeError \(out of fuel\)"),
        ("Nothing", "others:Nothing made no policy: it has no method initial_memory"),
    ]
    for name, message in cases:
        with pytest.raises(InputError, match=f"^plugin:{name}: {message}"):
            load_general(f"plugin:{name}", SEEN, Discrete(3))
    with pytest.raises(InputError, match=r"^plugin:Counting: is made for two spaces"):
        load_general("plugin:Counting")


def test_the_one_that_draws() -> None:
    policy = load_general("random", Discrete(3), MultiDiscrete([4, 5]))
    assert (policy.id, policy.algorithm, policy.observation_size) == ("random", "random", None)
    outputs, memory = policy.act(OBSERVATIONS, policy.initial_memory(20))
    assert (outputs.shape, memory.shape) == ((20, 0), (20, 0))
    drawn = [policy.decode(row, Discrete(3), np.random.default_rng(1)) for row in outputs]
    assert len(set(drawn)) == 1, "the generator alone decides"
