"""The weights in a .zip of Stable-Baselines3: plain tensors, all of whose numbers are there."""

from __future__ import annotations

import io
import zipfile
from collections import OrderedDict
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from stable_baselines3 import SAC

from nathlon.policies.sb3_racer import Sb3Policy
from tests.policies.test_sb3 import SPEC, pack, rewrite, save, zipped
from tests.support.refusals import refusal


@pytest.fixture(scope="module")
def saved(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("saved") / "sac.zip"
    save(SAC, path)
    return path


class Named:
    """Is pickled as a call of one of torch's or Python's own functions."""

    def __init__(self, function: Any, *arguments: Any) -> None:
        self.call = (function, arguments)

    def __reduce__(self) -> Any:
        return self.call


@pytest.mark.parametrize(
    ("weight", "message"),
    [
        (
            torch.ones(2, 6, device="meta"),
            "it names torch._utils _rebuild_meta_tensor_no_storage, expected plain",
        ),
        (
            torch.ones(1).expand(10**6, 10**6),
            "its tensors have 40000000[0-9]+ bytes, of which it stores [0-9]+",
        ),
        (torch.ones(1, 6).expand(10**9, 6), "its tensors have 240000[0-9]+ bytes"),
        (Named(bytearray, 10**12), "it names __builtin__ bytearray, expected plain"),
        (Named(torch.FloatTensor, 10**6, 10**6), "it names torch FloatTensor, expected plain"),
        (torch.nn.Parameter(torch.ones(2, 6)), "it names torch._utils _rebuild_parameter, expected plain"),
    ],
)
def test_tensors_that_claim_more_than_is_stored_are_refused(
    tmp_path: Path, saved: Path, weight: Any, message: str
) -> None:
    path = rewrite(saved, tmp_path / "b.zip", tensors={"actor.mu.weight": weight})
    with refusal(path, f"member 'policy.pth' is not a file of weights .{message}"):
        Sb3Policy.load(path)


def test_many_names_of_the_same_numbers_are_refused(tmp_path: Path, saved: Path) -> None:
    shared = torch.zeros(8, 8)
    layers = {f"actor.latent_pi.{2 * index}.weight": shared for index in range(1, 1000)}
    path = rewrite(saved, tmp_path / "b.zip", tensors=layers)
    with refusal(path, "of which it stores"):
        Sb3Policy.load(path)


def test_a_view_with_changed_signs_is_refused(tmp_path: Path, saved: Path) -> None:
    negated = torch.conj(torch.ones(2, 6, dtype=torch.complex64)).imag
    assert negated.is_neg()
    path = rewrite(saved, tmp_path / "b.zip", tensors={"actor.mu.weight": negated})
    with refusal(path, "'actor.mu.weight' is no plain array"):
        Sb3Policy.load(path)


def weights_of(path: Path) -> dict[str, bytes]:
    """The members of a saved model's weights."""
    with zipfile.ZipFile(path) as archive, zipfile.ZipFile(io.BytesIO(archive.read("policy.pth"))) as inner:
        return {name: inner.read(name) for name in inner.namelist()}


def with_weights(source: Path, target: Path, content: bytes) -> Path:
    """A copy of a saved model with another file of weights."""
    with zipfile.ZipFile(source) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    pack(target, members | {"policy.pth": content})
    return target


def test_weights_are_read_as_they_are_packed(tmp_path: Path, saved: Path) -> None:
    members = weights_of(saved)
    path = with_weights(saved, tmp_path / "b.zip", zipped(members))
    observations = np.ones((2, SPEC.size), np.float32)
    policies = [Sb3Policy.load(each) for each in (saved, path)]
    first, second = (policy.act(observations, policy.initial_memory(2))[0] for policy in policies)
    np.testing.assert_array_equal(first, second)
    (pickled,) = (name for name in members if name.endswith("data.pkl"))
    for changed, said in [
        (members | {pickled.upper(): members[pickled]}, "expected one data.pkl"),
        ({name: member for name, member in members.items() if name != pickled}, "expected one data.pkl"),
        (members | {pickled: bytes(2 << 20)}, "expected one data.pkl of at most 1048576 bytes"),
        (members | {pickled: b""}, "is not a file of weights"),
        (members | {name: b"" for name in members if "/data/" in name}, "does not match expected size"),
    ]:
        with refusal(with_weights(saved, path, zipped(changed)), said):
            Sb3Policy.load(path)
    with refusal(with_weights(saved, path, zipped(members, zipfile.ZIP_LZMA)), "packed in an unusual way"):
        Sb3Policy.load(path)


def test_the_format_before_zips_is_refused(tmp_path: Path, saved: Path) -> None:
    content = io.BytesIO()
    torch.save({"actor.mu.bias": torch.ones(2)}, content, _use_new_zipfile_serialization=False)
    path = with_weights(saved, tmp_path / "b.zip", content.getvalue())
    with refusal(path, "member 'policy.pth' is not a file of weights .File is not a zip file"):
        Sb3Policy.load(path)


class Shadowed:
    """Is pickled as an ordered dictionary with attributes in the place of its methods."""

    def __init__(self, entries: dict[str, Any]) -> None:
        self.entries = entries

    def __reduce__(self) -> Any:
        attributes = dict.fromkeys(("get", "keys", "items", "values", "__iter__"), "mine")
        return OrderedDict, (), attributes, None, iter(self.entries.items())


def test_attributes_of_the_table_are_not_taken_for_its_own(tmp_path: Path, saved: Path) -> None:
    with zipfile.ZipFile(saved) as archive:
        weights = torch.load(io.BytesIO(archive.read("policy.pth")), weights_only=True)
    content = io.BytesIO()
    torch.save(Shadowed(weights), content)
    assert Sb3Policy.load(with_weights(saved, tmp_path / "b.zip", content.getvalue())).card.seed == 3


def test_names_that_are_no_text_are_refused(tmp_path: Path, saved: Path) -> None:
    content = io.BytesIO()
    torch.save({3: torch.ones(2)}, content)
    with refusal(with_weights(saved, tmp_path / "b.zip", content.getvalue()), "a tensor's name is no text"):
        Sb3Policy.load(tmp_path / "b.zip")
