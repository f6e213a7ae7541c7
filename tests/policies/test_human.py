"""Inputs of people: kept to the bit, and refused in a sentence where they are none."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from nathlon.policies.load import load_policy
from nathlon.policies.sources.human import write_inputs
from nathlon.policies.sources.identity import policy_id
from tests.support.refusals import refusal

CONTROLS = np.random.default_rng(3).uniform(-1.0, 1.0, (500, 2)).astype(np.float32)


@pytest.fixture
def inputs(tmp_path: Path) -> Path:
    path = tmp_path / "ada.json"
    write_inputs(path, "Ada", "lindenring", "gt3", CONTROLS)
    return path


def test_what_was_done_is_done_again_to_the_bit_and_then_nothing(inputs: Path) -> None:
    person = load_policy(f"human:{inputs}", "lindenring", "gt3")
    memory = person.initial_memory(1)
    seen = np.zeros((1, person.observation_spec.size), np.float32)
    done = []
    for _ in range(len(CONTROLS) + 2):
        actions, memory = person.act(seen, memory)
        assert actions.dtype == memory.dtype == np.float32
        done.append(actions[0])
    assert np.array_equal(done[:-2], CONTROLS)
    assert np.array_equal(done[-2:], np.zeros((2, 2)))


def test_two_cars_of_one_person_are_each_at_their_own_step(inputs: Path) -> None:
    person = load_policy(f"human:{inputs}", "lindenring", "gt3")
    memory = np.array([[0.0], [70.0]], np.float32)
    actions, memory = person.act(np.zeros((2, person.observation_spec.size), np.float32), memory)
    assert np.array_equal(actions, CONTROLS[[0, 70]])
    assert memory[:, 0].tolist() == [1.0, 71.0]


def test_the_id_is_that_of_the_bytes(inputs: Path, tmp_path: Path) -> None:
    other = tmp_path / "again.json"
    write_inputs(other, "Ada", "lindenring", "gt3", CONTROLS)
    assert policy_id(f"human:{inputs}") == policy_id(f"human:{other}")
    write_inputs(other, "Bob", "lindenring", "gt3", CONTROLS)
    assert policy_id(f"human:{inputs}") != policy_id(f"human:{other}")


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"controls": "AAAA"}, "field controls: expected pairs of float32"),
        ({"controls": "AAAAAAAAwH8="}, "field controls: expected pairs of float32 from -1 to 1"),
        ({"controls": "AAAAAAAAAEA="}, "field controls: expected pairs of float32 from -1 to 1"),
        ({"controls": "not base64!"}, "field controls: expected"),
        ({"controls": 1}, "field controls is 1"),
        ({"name": "\u001b[2J"}, "field name"),
        ({"circuit": "porto-sereno"}, "circuit is 'porto-sereno', expected 'lindenring'"),
        ({"car": "coupe"}, "car is 'coupe', expected 'gt3'"),
        ({"format": 2}, "field format is 2"),
        ({"more": 1}, "field more is unknown"),
    ],
)
def test_inputs_that_are_none_are_refused(inputs: Path, change: dict[str, Any], said: str) -> None:
    inputs.write_text(json.dumps(json.loads(inputs.read_text()) | change))
    with refusal(inputs, said):
        load_policy(f"human:{inputs}", "lindenring", "gt3")


def test_what_is_no_json_is_refused(inputs: Path) -> None:
    inputs.write_bytes(b"\x80\x04N.")
    with refusal(inputs, "Invalid JSON"):
        load_policy(f"human:{inputs}", "lindenring", "gt3")
