"""Files of other libraries are called by their names, and the cure is said."""

from __future__ import annotations

import os
import pickle
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from gymnasium.spaces import Box, Discrete

from nathlon.arena.naming import short_names
from nathlon.policies.general import load_general
from nathlon.policies.load import load_policy
from nathlon.policies.sources.finding import find_sources
from nathlon.policies.sources.normalisation import companions
from nathlon.policies.sources.recognised import recognised
from tests.support.games import refused


def written(folder: Path, name: str) -> Path:
    path, module = folder / name, torch.nn.Linear(2, 2)
    if name in ("weights.pt", "a.cleanrl_model", "lightning.ckpt"):
        torch.save(module.state_dict(), path)
    elif name == "old.pth":
        torch.save(module.state_dict(), path, _use_new_zipfile_serialization=False)
    elif name == "scripted.pt":
        torch.jit.script(module).save(str(path))  # type: ignore[no-untyped-call]
    elif name == "agent.pkl":
        path.write_bytes(pickle.dumps({"weights": np.zeros(3)}))
    elif name == "arrays.npz":
        np.savez(path, w=np.zeros(3))
    elif name == "torn.pt":
        path.write_bytes(b"PK\x03\x04 and no more")
    else:
        (path / "rl_module").mkdir(parents=True)
    return path


@pytest.mark.parametrize(
    ("name", "what"),
    [
        ("weights.pt", "a torch.save of weights or a module"),
        ("old.pth", "an old torch.save"),
        ("a.cleanrl_model", "a CleanRL model (torch.save)"),
        ("lightning.ckpt", "a checkpoint of Lightning or TensorFlow (torch.save)"),
        ("scripted.pt", "a TorchScript module"),
        ("agent.pkl", "a pickle"),
        ("arrays.npz", "an archive of numpy arrays"),
        ("torn.pt", "a broken zip archive"),
        ("checkpoint_000010", "an RLlib checkpoint"),
    ],
)
def test_what_others_write_is_called_by_its_name(tmp_path: Path, name: str, what: str) -> None:
    path = written(tmp_path, name)
    assert recognised(path) == what
    with refused(f"{path}: is {what}", "expected a loader in the world's mapping"):
        load_general(str(path), Box(-1.0, 1.0, (2,)), Discrete(2))
    with refused(f"{path}: is {what}", "or an ONNX graph"):
        load_policy(str(path), "lindenring", "gt3")


def test_one_of_stable_baselines_is_told_by_its_contents(tmp_path: Path) -> None:
    """Its `save` leaves the ending out where a name has a dot."""
    for name in ("model_0.5", "model_0.75", "agent.sb3", "weights.pt"):
        with zipfile.ZipFile(tmp_path / name, "w") as archive:
            archive.writestr("data" if name != "weights.pt" else "archive/data.pkl", "{}")
            archive.writestr("policy.pth", "")
    (tmp_path / "model_0.25").write_bytes((tmp_path / "model_0.5").read_bytes()[:40])
    (tmp_path / "model_0.1").mkdir()
    os.mkfifo(tmp_path / "model_0.2")
    (tmp_path / "model_0.3").symlink_to(tmp_path / "nowhere")
    found = find_sources([tmp_path])
    assert [Path(source).name for source in found] == ["agent.sb3", "model_0.5", "model_0.75"]
    assert list(short_names(found).values()) == ["agent", "model_0.5", "model_0.75"]
    for source in found:
        with refused(f"{source}: "):
            load_general(source, Box(-1.0, 1.0, (2,)), Discrete(2))
    statistics = tmp_path / "model_0.5_vecnormalize.pkl"
    statistics.touch()
    assert companions(tmp_path / "model_0.5").statistics == statistics
    assert companions(tmp_path / "model_0.75").statistics is None


def test_a_checkpoint_of_any_name_is_none_of_them(tmp_path: Path) -> None:
    from nathlon.policies.bundled import generalist

    path = tmp_path / "renamed.bin"
    path.write_bytes(Path(generalist()).read_bytes())
    assert recognised(path) == ""
    policy: Any = load_policy(str(path), "lindenring", "gt3")
    assert policy.card.car == "any"
