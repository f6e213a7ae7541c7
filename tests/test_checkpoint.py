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
from safetensors.numpy import save

from policies.checkpoint import (
    Card,
    NetworkPolicy,
    checkpoint_id,
    load_checkpoint,
    read_card,
    save_checkpoint,
)
from sim.errors import InputError
from sim.observation import ObservationSpec

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


def test_actions_are_the_squashed_means_of_the_half_precision_network(path: Path) -> None:
    policy = NetworkPolicy.load(path)
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
        with pytest.raises(InputError, match=r"none\.safetensors: no such file"):
            reader(tmp_path / "none.safetensors")
        with pytest.raises(InputError, match=r": not a file"):
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
        ("{", "the card in the header is not valid JSON"),
        ("[1]", "the card: "),
        ("{}", "field algorithm"),
        ({"format": 2}, "field format"),
        ({"colour": "red"}, "field colour"),
        ({"step": -1}, "field step"),
        ({"step": "10"}, "field step"),
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
