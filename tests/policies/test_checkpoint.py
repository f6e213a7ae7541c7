"""Checkpoints: what is written is read, and whatever else is read is refused in one sentence."""

from __future__ import annotations

import hashlib
import json
import os
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from safetensors.numpy import load, save

from nathlon.policies.checkpoint import (
    Card,
    checkpoint_id,
    load_checkpoint,
    read_card,
    read_checkpoint,
    save_checkpoint,
)
from nathlon.sim.errors import InputError
from nathlon.sim.observation import ObservationSpec
from tests.support.refusals import refusal

SPEC = ObservationSpec(course_points=2, cars_ahead=0, cars_behind=1)
CARD = Card(
    algorithm="qr-sac",
    hidden=(6, 5),
    observation=SPEC,
    circuit="oval",
    car="gt",
    scenarios=("time trial", "grid start"),
    step=10,
    transitions=2000,
    seed=3,
    created_by={"nathlon": "0.1.0", "torch": "2.0"},
)


def weights() -> dict[str, NDArray]:
    rng = np.random.default_rng(0)
    return {name: rng.standard_normal(shape).astype(np.float32) for name, shape in CARD.shapes.items()}


def halves() -> dict[str, NDArray]:
    return {name: tensor.astype(np.float16) for name, tensor in weights().items()}


@pytest.fixture
def path(tmp_path: Path) -> Path:
    path = tmp_path / "policy.safetensors"
    save_checkpoint(path, weights(), CARD)
    return path


def write(
    path: Path, card: dict[str, Any] | str | None = None, tensors: Mapping[str, NDArray | None] | None = None
) -> None:
    """Writes a checkpoint with the card's fields or some tensors replaced (None leaves one out)."""
    changed = halves() | dict(tensors or {})
    text = card if isinstance(card, str) else json.dumps(json.loads(CARD.model_dump_json()) | (card or {}))
    kept = {name: tensor for name, tensor in changed.items() if tensor is not None}
    path.write_bytes(save(kept, {"nathlon": text}))


def test_what_is_saved_is_loaded(path: Path) -> None:
    policy = load_checkpoint(path)
    assert policy.card == read_card(path) == CARD
    assert policy.observation_spec == SPEC
    assert policy.id == checkpoint_id(path) == hashlib.sha256(path.read_bytes()).hexdigest()


def test_the_numbers_are_those_that_safetensors_reads(path: Path) -> None:
    _, found = read_checkpoint(path)
    expected = load(path.read_bytes())
    assert found.keys() == expected.keys()
    for name, tensor in expected.items():
        np.testing.assert_array_equal(found[name], tensor.astype(np.float32))


def test_actions_are_the_squashed_means_of_the_half_precision_network(path: Path) -> None:
    policy = load_checkpoint(path)
    observations = np.random.default_rng(1).standard_normal((20, SPEC.size)).astype(np.float32)
    actions, memory = policy.act(observations, policy.initial_memory(20))
    tensors = {name: tensor.astype(np.float64) for name, tensor in halves().items()}
    layer = observations.astype(np.float64)
    for i in range(2):
        layer = np.maximum(layer @ tensors[f"{i}.weight"] + tensors[f"{i}.bias"], 0.0)
    expected = np.tanh((layer @ tensors["2.weight"] + tensors["2.bias"])[:, :2])
    np.testing.assert_allclose(actions, expected, atol=1e-5)
    assert actions.dtype == np.float32
    assert memory.shape == (20, 0)
    alone = np.concatenate([policy.act(row[None], memory[:1])[0] for row in observations])
    np.testing.assert_allclose(alone, actions, atol=1e-5)
    assert policy.act(observations[:0], memory[:0])[0].shape == (0, 2)


def test_observations_are_left_as_they_are(path: Path) -> None:
    observations = np.ones((3, SPEC.size), np.float32)
    load_checkpoint(path).act(observations, np.zeros((3, 0), np.float32))
    assert (observations == 1.0).all()


def test_same_policy_same_bytes(path: Path, tmp_path: Path) -> None:
    other = tmp_path / "other.safetensors"
    save_checkpoint(other, dict(reversed(weights().items())), CARD)
    assert other.read_bytes() == path.read_bytes()
    assert sorted(os.listdir(tmp_path)) == ["other.safetensors", "policy.safetensors"]


def test_a_failed_save_leaves_the_old_file(path: Path, tmp_path: Path) -> None:
    before = path.read_bytes()
    diverged = weights()
    diverged["1.bias"][0] = 1e6
    with pytest.raises(
        InputError, match=r"policy.safetensors: tensor '1.bias' holds numbers that are not finite"
    ):
        save_checkpoint(path, diverged, CARD)
    assert path.read_bytes() == before
    assert os.listdir(tmp_path) == ["policy.safetensors"]


def test_tensors_must_fit_the_card_when_saved(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"x: tensor '1.bias' is missing"):
        save_checkpoint(tmp_path / "x", {k: v for k, v in weights().items() if k != "1.bias"}, CARD)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "empty"),
        (b"\x00\x01", "not a whole safetensors file"),
        (b"PK\x03\x04 some other format, long enough to hold a header", "not a whole safetensors file"),
        (b"\xff" * 7 + b"\x7f" + b"{}", "not a whole safetensors file"),
        (save({"a": np.zeros(3, np.float16)}), "no card"),
        (save({"a": np.zeros(3, np.float16)}, {"other": "{}"}), "no card"),
    ],
)
def test_other_files_are_refused(tmp_path: Path, content: bytes, message: str) -> None:
    path = tmp_path / "policy.bin"
    path.write_bytes(content)
    for reader in (read_card, load_checkpoint):
        with pytest.raises(InputError, match=rf"policy\.bin: .*{message}"):
            reader(path)


def test_missing_files_and_directories_are_refused(tmp_path: Path) -> None:
    for reader in (read_card, load_checkpoint, checkpoint_id):
        with pytest.raises(InputError, match=r"none\.safetensors: cannot read the policy: No such file"):
            reader(tmp_path / "none.safetensors")
        with pytest.raises(InputError, match=r"cannot read the policy: Is a directory"):
            reader(tmp_path)


def test_a_truncated_file_is_refused(path: Path) -> None:
    content = path.read_bytes()
    for length in range(0, len(content), 37):
        path.write_bytes(content[:length])
        with pytest.raises(InputError, match=r"policy\.safetensors"):
            load_checkpoint(path)


@pytest.mark.parametrize(
    ("card", "message"),
    [
        ("{", "the card is not valid JSON"),
        ("[1]", "the card: "),
        ("{}", "field algorithm"),
        ({"format": 3}, "field format"),
        ({"format": 2}, "format is 2, expected 2 with vision and 1 without"),
        ({"colour": "red"}, "field colour"),
        ({"step": -1}, "field step"),
        ({"step": "10"}, "field step"),
        ({"step": 2**63}, "field step"),
        ({"seed": 10**30}, "field seed"),
        ({"algorithm": "a" * 201}, "field algorithm"),
        ({"algorithm": "a" * 70_000}, "the card has [0-9]+ characters, expected at most 65536"),
        ({"car": "\x1b[2Jgt"}, r"field car is '\\x1b\[2Jgt': expected printable characters"),
        ({"scenarios": ["grid\nstart"]}, r"field scenarios\.0"),
        ({"created_by": {"a\rb": "1"}}, r"created_by\..*expected printable characters"),
        ({"scenarios": ["grid"] * 1001}, "field scenarios"),
        ('{"step": 1, "step": 2}', "the card is not valid JSON \\(key 'step' stands twice in an object"),
        ("[" * 60_000, "the card is not valid JSON \\(nested too deeply"),
        ({"practises": True}, "practises is given, expected observations with a plan beside it"),
        ({"hidden": []}, "field hidden"),
        ({"hidden": [6, 0]}, r"field hidden\.1"),
        ({"hidden": [6] * 9}, "field hidden"),
        ({"observation": 3}, "field observation"),
        ({"observation": {"version": 99}}, "version is 99"),
        ({"observation": {"lidar": 4}}, "'lidar'"),
        ({"observation": {"course_points": []}}, "course_points"),
        ({"observation": SPEC.to_dict() | {"course_points": 3}}, r"tensor '0\.weight' has shape"),
        ({"hidden": [6, 5, 5]}, r"tensor '2\.weight' has shape \(5, 4\), expected \(5, 5\)"),
    ],
)
def test_a_wrong_card_is_refused(path: Path, card: dict[str, Any] | str, message: str) -> None:
    write(path, card)
    with pytest.raises(InputError, match=rf"policy\.safetensors: .*{message}") as caught:
        load_checkpoint(path)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("name", "tensor", "message"),
    [
        ("1.weight", None, "is missing"),
        ("1.weight", np.zeros((5, 6), np.float16), r"has shape \(5, 6\), expected \(6, 5\)"),
        ("1.weight", np.zeros(30, np.float16), r"has shape \(30,\), expected \(6, 5\)"),
        ("1.weight", np.zeros((6, 5), np.float32), "is F32, expected F16"),
        ("1.weight", np.full((6, 5), np.inf, np.float16), "not finite"),
        ("2.bias", np.array([0, 0, 0, np.nan], np.float16), "not finite"),
        ("3.bias", np.zeros(4, np.float16), "not one of a policy's"),
    ],
)
def test_wrong_tensors_are_refused(path: Path, name: str, tensor: NDArray | None, message: str) -> None:
    write(path, tensors={name: tensor})
    with pytest.raises(InputError, match=rf"policy\.safetensors: tensor '{name}' .*{message}"):
        load_checkpoint(path)


def header(path: Path) -> tuple[dict[str, Any], bytes]:
    """The header of a checkpoint and all that follows it."""
    content = path.read_bytes()
    end = 8 + int.from_bytes(content[:8], "little")
    return json.loads(content[8:end]), content[end:]


def set_header(path: Path, text: str, rest: bytes) -> None:
    path.write_bytes(len(text.encode()).to_bytes(8, "little") + text.encode() + rest)


def refused(path: Path, said: str) -> None:
    """Both readers refuse the file, in one sentence that can be read."""
    for reader in (read_card, load_checkpoint):
        with refusal(path, said):
            reader(path)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"data_offsets": [0, 2]}, "does not fit"),
        ({"data_offsets": [12, 0]}, "does not fit"),
        ({"data_offsets": [2, 14]}, "does not fit"),
        ({"data_offsets": [0, 2**62]}, "does not fit"),
        ({"data_offsets": [-12, 0]}, "does not fit"),
        ({"data_offsets": [0]}, "has no type, shape and place"),
        ({"data_offsets": None}, "has no type, shape and place"),
        ({"data_offsets": ["0", "12"]}, "has no type, shape and place"),
        ({"shape": 6}, "has no type, shape and place"),
        ({"shape": [2**62]}, r"has shape \(4611686018427387904,\), expected \(6,\)"),
        ({"shape": [10**400, 3]}, "has shape"),
        ({"dtype": "F32"}, "is F32, expected F16"),
        ({"dtype": 3}, "has no type, shape and place"),
    ],
)
def test_a_header_that_does_not_fit_is_refused(path: Path, change: dict[str, Any], message: str) -> None:
    entries, rest = header(path)
    assert entries["0.bias"]["data_offsets"] == [0, 12]
    entries["0.bias"] |= change
    set_header(path, json.dumps(entries), rest)
    refused(path, f"tensor '0.bias' .*{message}")


def test_tensors_that_share_bytes_are_refused(path: Path) -> None:
    entries, rest = header(path)
    entries["2.bias"]["data_offsets"] = entries["0.bias"]["data_offsets"]
    set_header(path, json.dumps(entries), rest)
    refused(path, "where it does not fit")


def test_a_key_that_stands_twice_is_refused(path: Path) -> None:
    entries, rest = header(path)
    text = json.dumps(entries)
    for twice in (
        '"__metadata__": {}, ',
        '"0.bias": {"dtype": "F16", "shape": [6], "data_offsets": [0, 12]}, ',
    ):
        set_header(path, "{" + twice + text[1:], rest)
        refused(path, "stands twice in an object")
    set_header(path, text.replace('"__metadata__": {', '"__metadata__": {"nathlon": "{}", '), rest)
    refused(path, "key 'nathlon' stands twice in an object")


def test_the_header_is_bounded(path: Path) -> None:
    entries, rest = header(path)
    set_header(path, json.dumps(entries) + " " * 1000, rest)
    assert read_card(path) == load_checkpoint(path).card == CARD
    set_header(path, json.dumps(entries) + " " * (1 << 20), rest)
    refused(path, "the header has [0-9]+ of [0-9]+ bytes, expected at most 1048576")
    set_header(path, "[" * 100_000, rest)
    refused(path, "nested too deeply")
    set_header(path, '"' + "a" * 100_000, rest)
    refused(path, "not a whole safetensors file")


def test_a_file_with_more_than_its_tensors_is_refused(path: Path) -> None:
    path.write_bytes(path.read_bytes() + b"more")
    refused(path, "not a whole safetensors file")


def test_what_is_quoted_from_a_file_can_be_read(path: Path) -> None:
    entries, rest = header(path)
    entries["\x1b[31m" + "z" * 100_000] = entries["0.bias"]
    set_header(path, json.dumps(entries), rest)
    with pytest.raises(InputError) as caught:
        load_checkpoint(path)
    reason = str(caught.value).removeprefix(f"{path}: ")
    assert reason.isprintable()
    assert len(reason) < 400


@settings(max_examples=150, deadline=None)
@given(data=st.data())
def test_changed_bytes_give_a_policy_or_an_error(data: st.DataObject) -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "policy.safetensors"
        save_checkpoint(path, weights(), CARD)
        content = bytearray(path.read_bytes())
        # Half of the changes go to the header, where most meaning lies.
        end = data.draw(st.sampled_from([len(content) - 1, 8 + int.from_bytes(content[:8], "little")]))
        for position, value in data.draw(
            st.lists(st.tuples(st.integers(0, end), st.integers(0, 255)), min_size=1, max_size=4)
        ):
            content[position] = value
        path.write_bytes(content)
        try:
            policy = load_checkpoint(path)
        except InputError as error:
            assert "policy.safetensors" in str(error)  # noqa: PT017 - either outcome is right
        else:
            observations = np.zeros((2, policy.observation_spec.size), np.float32)
            actions, _ = policy.act(observations, policy.initial_memory(2))
            assert np.isfinite(actions).all()
