"""Graphs that remember: states are told by names or by the card, and kept from step to step."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from gymnasium.spaces import Box, Dict
from onnx import TensorProto, helper, numpy_helper

from nathlon.policies.general import load_general
from nathlon.policies.load import load_policy
from nathlon.policies.sources.onnx_states import find_states
from nathlon.sim.errors import InputError
from nathlon.sim.observation import ObservationSpec
from tests.support.games import refused
from tests.support.spoiling import spoilt_bytes

SEEN, DONE = Box(-9.0, 9.0, (2,)), Box(-9.0, 9.0, (2,))


def graph(
    path: Path,
    names: tuple[str, str] = ("h_in", "h_out"),
    batch: Any = "n",
    layered: bool = False,
    size: int = 2,
    card: dict[str, Any] | None = None,
    observed: str = "obs",
) -> str:
    """Two numbers of all observations so far are added up; the state may have its batch as second axis."""
    before, after = names
    shape = [1, batch, 2] if layered else [batch, 2]
    nodes = [
        helper.make_node("Slice", [observed, "zero", "two", "one"], ["seen"]),
        helper.make_node("Squeeze" if layered else "Identity", [before, "zero"][: 1 + layered], ["rows"]),
        helper.make_node("Add", ["seen", "rows"], ["action"]),
        helper.make_node("Unsqueeze" if layered else "Identity", ["action", "zero"][: 1 + layered], [after]),
    ]
    kept = {"zero": [0], "one": [1], "two": [2]}
    made = helper.make_graph(
        nodes,
        "sums",
        [
            helper.make_tensor_value_info(observed, TensorProto.FLOAT, [batch, size]),
            helper.make_tensor_value_info(before, TensorProto.FLOAT, shape),
        ],
        [
            helper.make_tensor_value_info("action", TensorProto.FLOAT, [batch, 2]),
            helper.make_tensor_value_info(after, TensorProto.FLOAT, shape),
        ],
        [numpy_helper.from_array(np.array(value), name) for name, value in kept.items()],
    )
    model = helper.make_model(made, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)
    if card is not None:
        helper.set_model_props(model, {"nathlon": json.dumps(card)})
    path.write_bytes(model.SerializeToString())
    return str(path)


def sums(policy: Any, rows: int = 3) -> list[Any]:
    """What a policy answers in the third step, for rows that differ."""
    seen = np.arange(2.0 * rows, dtype=np.float32).reshape(rows, 2)
    memory = policy.initial_memory(rows)
    for _ in range(3):
        numbers, memory = policy.act(seen, memory)
    found: list[Any] = (numbers / 3 - seen).tolist()
    return found


@pytest.mark.parametrize(
    ("names", "batch", "layered"),
    [
        (("h_in", "h_out"), "n", False),
        (("state_in_0", "state_out_0"), "n", True),
        (("h0", "hn"), 1, True),
        (("hidden", "next_hidden"), 1, False),
        (("lstm.h0", "lstm.hn"), "n", False),
        (("prev_state", "new_state"), "n", True),
    ],
)
def test_states_are_told_by_their_names(
    tmp_path: Path, names: tuple[str, str], batch: Any, layered: bool
) -> None:
    policy = load_general(graph(tmp_path / "a.onnx", names, batch, layered), SEEN, DONE)
    assert policy.initial_memory(4).shape == (4, 2)
    assert sums(policy) == [[0.0, 0.0]] * 3


def test_a_card_says_which_they_are(tmp_path: Path) -> None:
    names = ("carry", "final")
    with refused("inputs are obs tensor(float)", "a card whose field 'states' has the output"):
        load_general(graph(tmp_path / "a.onnx", names), SEEN, DONE)
    card = {"states": {"carry": "final"}}
    assert sums(load_general(graph(tmp_path / "b.onnx", names, card=card), SEEN, DONE)) == [[0.0, 0.0]] * 3
    with refused("card has the state 'carry': 'end', expected an input, of obs, carry, and an output, of"):
        load_general(graph(tmp_path / "c.onnx", names, card={"states": {"carry": "end"}}), SEEN, DONE)


def test_parts_of_an_observation_are_no_states(tmp_path: Path) -> None:
    parts = Dict({"h_in": SEEN, "obs": SEEN})
    policy = load_general(graph(tmp_path / "a.onnx"), parts, DONE)
    assert policy.observation_size == 4
    assert policy.initial_memory(1).shape == (1, 0)


def test_a_graph_that_remembers_races(tmp_path: Path) -> None:
    size = ObservationSpec(course_points=4).size
    policy = load_policy(graph(tmp_path / "a.onnx", size=size), "lindenring", "gt3")
    seen = np.full((2, size), 0.125, np.float32)
    memory = policy.initial_memory(2)
    _, memory = policy.act(seen, memory)
    actions, _ = policy.act(seen, memory)
    assert actions.tolist() == [[0.25, 0.25]] * 2


@pytest.mark.parametrize(
    ("taken", "given"),
    [("h", "value"), ("obs_in", "obs_out"), ("action_in", "action_out"), ("input", "output")],
)
def test_other_names_are_no_states(taken: str, given: str) -> None:
    told = [("x", "tensor(float)", ["n", 3]), (taken, "tensor(float)", ["n", 2])]
    assert find_states(Path("a"), told, [(given, "tensor(float)", ["n", 2])], {}, ()) == ()


def test_a_state_whose_size_is_open_is_refused() -> None:
    told = [("x", "tensor(float)", ["n", 3]), ("h_in", "tensor(float)", ["layers", "n", 2])]
    with refused("state 'h_in' is tensor(float) ['layers', 'n', 2], expected numbers with a point"):
        find_states(Path("a"), told, [("h_out", "tensor(float)", ["n", 2])], {}, ())


def test_damaged_graphs_are_refused_in_a_sentence(tmp_path: Path) -> None:
    content = Path(graph(tmp_path / "a.onnx", card={"states": {"h_in": "h_out"}})).read_bytes()
    rng, path, told = np.random.default_rng(0), tmp_path / "b.onnx", list[str]()
    for _ in range(150):
        path.write_bytes(spoilt_bytes(content, rng) or b"\0")
        try:
            load_general(str(path), SEEN, DONE)
        except InputError as error:
            told.append(str(error))
    assert len(told) > 75
    assert all(said.startswith(f"{path}: ") and said.isprintable() for said in told)
