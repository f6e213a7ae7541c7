"""Policies of Stable-Baselines3: the same actions as there, nothing unpickled, bad files refused."""

from __future__ import annotations

import hashlib
import io
import json
import os
import pickle
import re
import sys
import zipfile
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from sb3_contrib import TQC, RecurrentPPO
from stable_baselines3 import A2C, PPO, SAC, TD3
from stable_baselines3.common.vec_env import DummyVecEnv, VecNormalize

from examples import sb3_camera
from examples.sb3_sac_tqc import CHECKPOINTS, LEARNERS, main
from nathlon.arena.entrance import enter_all, trained_on
from nathlon.arena.entrant import enter
from nathlon.arena.pool import Pool
from nathlon.arena.results import POLICY_FAULTS
from nathlon.arena.runner import run_match
from nathlon.arena.single_race import single_race
from nathlon.commands.racing import race
from nathlon.policies.load import load_policy
from nathlon.policies.sb3_racer import Sb3Policy
from nathlon.policies.sources.finding import find_sources
from nathlon.sim.camera_spec import CameraSpec
from nathlon.sim.episode import action_space, in_space, observation_space
from nathlon.sim.errors import InputError
from nathlon.sim.observation import ObservationSpec
from tests.support.refusals import refusal

SPEC = ObservationSpec(course_points=2)
ODD = ObservationSpec(course_points=2, horizon_s=3.0, cars_ahead=1, cars_behind=0)
CARD = {"observation": ODD.to_dict(), "circuit": "porto-sereno", "car": "coupe"}


class Spaces(gymnasium.Env[Any, Any]):
    """The spaces of the environments, without a world."""

    def __init__(self, spec: ObservationSpec = SPEC, action: gymnasium.Space[Any] | None = None) -> None:
        self.observation_space = observation_space(spec)
        self.action_space = action or action_space()


def save(algorithm: Any, path: Path, env: Spaces | None = None, **facts: Any) -> Any:
    """Make a model of 8 and 6 units, with further attributes, and save it."""
    arguments = {"policy_kwargs": {"net_arch": [8, 6]}} | facts.pop("arguments", {})
    if issubclass(algorithm, SAC | TQC | TD3):
        arguments["buffer_size"] = 10
    model = algorithm("MlpPolicy", env or Spaces(), seed=3, device="cpu", **arguments)
    vars(model).update(facts)
    model.save(path)
    return model


@pytest.fixture(scope="module")
def saved(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("saved") / "sac.zip"
    save(SAC, path)
    return path


def rewrite(source: Path, target: Path, data: Any = None, tensors: Any = None) -> Path:
    """A copy of a saved model with entries of `data` and tensors replaced; None takes a tensor out."""
    with zipfile.ZipFile(source) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    members["data"] = json.dumps(json.loads(members["data"]) | (data or {})).encode()
    weights = torch.load(io.BytesIO(members["policy.pth"]), weights_only=True) | (tensors or {})
    content = io.BytesIO()
    torch.save({name: tensor for name, tensor in weights.items() if tensor is not None}, content)
    members["policy.pth"] = content.getvalue()
    pack(target, members)
    return target


def pack(path: Path, members: dict[str, bytes]) -> None:
    with zipfile.ZipFile(path, "w") as archive:
        for name, content in members.items():
            archive.writestr(name, content)


def zipped(members: dict[str, bytes], method: int = zipfile.ZIP_DEFLATED) -> bytes:
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w", method) as archive:
        for name, member in members.items():
            archive.writestr(name, member)
    return content.getvalue()


TANH = {"policy_kwargs": {"net_arch": [8, 6], "activation_fn": torch.nn.Tanh}}
RELU = {"policy_kwargs": {"net_arch": [8, 6], "activation_fn": torch.nn.ReLU}}


@pytest.mark.parametrize(
    ("algorithm", "arguments", "name"),
    [
        (SAC, {}, "SB3 SAC"),
        (SAC, TANH, "SB3 SAC"),
        (SAC, {"policy_kwargs": {"net_arch": []}}, "SB3 SAC"),
        (TQC, {}, "SB3 TQC"),
        (TD3, {}, "SB3 TD3 or DDPG"),
        (PPO, {}, "SB3 PPO or A2C"),
        (PPO, RELU, "SB3 PPO or A2C"),
        (A2C, {"use_sde": True}, "SB3 PPO or A2C"),
    ],
)
def test_drives_as_it_does_in_stable_baselines(
    tmp_path: Path, algorithm: Any, arguments: dict[str, Any], name: str
) -> None:
    path = tmp_path / "model.zip"
    model = save(algorithm, path, arguments=arguments)
    if algorithm in (PPO, A2C):  # they begin close to 0
        model.policy.action_net.weight.data *= 200.0
        model.save(path)
    policy = load_policy(str(path), "lindenring", "gt3")
    assert isinstance(policy, Sb3Policy)
    observations = np.random.default_rng(0).normal(0.0, 20.0, (50, SPEC.size)).astype(np.float32)
    actions, memory = policy.act(observations, policy.initial_memory(50))
    expected, _ = model.predict(observations, deterministic=True)
    np.testing.assert_allclose(actions, expected, atol=1e-5)
    assert np.ptp(expected, axis=0).min() > 0.1, "the actions differ between observations"
    assert actions.dtype == np.float32
    assert memory.shape == (50, 0)
    assert policy.card.algorithm == name


def test_what_is_known_of_a_file_without_a_card(tmp_path: Path) -> None:
    path = tmp_path / "model.zip"
    save(SAC, path, _n_updates=70, num_timesteps=900)
    policy = Sb3Policy.load(path)
    assert policy.observation_spec == SPEC, "the default with as many course points as fit"
    assert policy.id == hashlib.sha256(path.read_bytes()).hexdigest()
    card = policy.card
    assert (card.step, card.transitions, card.seed, card.circuit, card.car) == (70, 900, 3, None, None)


def test_the_card_tells_what_the_weights_cannot(tmp_path: Path) -> None:
    path = tmp_path / "model.zip"
    save(SAC, path, Spaces(ODD), nathlon=CARD | {"algorithm": "mine", "step": 5}, _n_updates=70)
    policy = Sb3Policy.load(path)
    assert policy.observation_spec == ODD
    card = policy.card
    assert (card.algorithm, card.step, card.circuit, card.car) == ("mine", 5, "porto-sereno", "coupe")


class Bomb:
    """Makes a folder when it is unpickled."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def __reduce__(self) -> tuple[Any, tuple[str]]:
        return os.mkdir, (str(self.folder),)


def test_pickles_are_not_opened(tmp_path: Path, saved: Path) -> None:
    folder = tmp_path / "burst"
    pickled = {":type:": "Bomb", ":serialized:": pickle.dumps(Bomb(folder), 0).decode()}
    path = rewrite(saved, tmp_path / "a.zip", {"_last_obs": pickled, "ep_info_buffer": pickled})
    Sb3Policy.load(path)
    with zipfile.ZipFile(saved) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    content = io.BytesIO()
    torch.save({"actor.mu.weight": Bomb(folder)}, content)
    for bomb in (content.getvalue(), pickle.dumps(Bomb(folder), 2)):
        pack(path, members | {"policy.pth": bomb})
        with pytest.raises(InputError, match=r"a\.zip: member 'policy.pth' is not a file of weights"):
            Sb3Policy.load(path)
    assert not folder.exists()
    pickle.loads(pickle.dumps(Bomb(folder)))
    assert folder.exists(), "it does burst"


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"[" * 100_000, "member 'data' is not valid JSON .nested too deeply"),
        (b'{"a": ' * 100_000, "member 'data' is not valid JSON .nested too deeply"),
        (b'{"nathlon": {"step": 1, "step": 2}}', "key 'step' stands twice in an object"),
        (b'{"seed": ' + b"9" * 5000 + b"}", "member 'data' is not valid JSON"),
        (b"\xff", "member 'data' is not valid JSON"),
        (b" " * (1 << 25) + b"{}", "member 'data' has 33554434 bytes, expected at most 33554432"),
    ],
)
def test_other_data_is_refused(tmp_path: Path, data: bytes, message: str) -> None:
    path = tmp_path / "b.zip"
    path.write_bytes(zipped({"data": data, "policy.pth": b""}))
    with refusal(path, message):
        Sb3Policy.load(path)


@pytest.mark.parametrize("depth", range(900, 1000, 7))
def test_data_nested_almost_too_deeply(tmp_path: Path, saved: Path, depth: int) -> None:
    nest: Any = "[1. 1.]"
    for _ in range(depth):
        nest = [nest]
    limit = sys.getrecursionlimit()
    sys.setrecursionlimit(10 * limit)
    try:
        text = json.dumps(
            {"policy_class": {"__module__": nest}, "action_space": {"low": nest}, "nathlon": nest}
        )
    finally:
        sys.setrecursionlimit(limit)
    with zipfile.ZipFile(saved) as archive:
        weights = archive.read("policy.pth")
    path = tmp_path / "b.zip"
    path.write_bytes(zipped({"data": text.encode(), "policy.pth": weights}))
    with refusal(path, "nested too deeply|policy class of"):
        Sb3Policy.load(path)


def test_one_with_a_memory_drives_behind_its_statistics(tmp_path: Path) -> None:
    environments: Any = VecNormalize(DummyVecEnv([Spaces]))
    rows = np.random.default_rng(0).normal(0.5, 2.0, (40, SPEC.size)).astype(np.float32)
    environments.obs_rms.update(rows)
    kept = {"net_arch": [8], "lstm_hidden_size": 6}
    model: Any = RecurrentPPO("MlpLstmPolicy", environments, seed=3, device="cpu", policy_kwargs=kept)
    model.policy.action_net.weight.data *= 300.0
    model.save(tmp_path / "drive_8_steps.zip")
    environments.save(str(tmp_path / "drive_vecnormalize_8_steps.pkl"))
    policy = load_policy(str(tmp_path / "drive_8_steps.zip"), "lindenring", "gt3")
    assert policy.observation_spec == SPEC
    memory, state = policy.initial_memory(1), None
    for row in rows:
        actions, memory = policy.act(row[None], memory)
        shown = environments.normalize_obs(row[None])
        expected, state = model.predict(shown, state, np.zeros(1), deterministic=True)
        np.testing.assert_allclose(actions, expected, atol=2e-5)


def test_numbers_that_no_store_keeps_are_not_known(tmp_path: Path, saved: Path) -> None:
    most = 2**63 - 1
    path = rewrite(saved, tmp_path / "b.zip", {"_n_updates": most, "num_timesteps": most + 1, "seed": 10**40})
    card = Sb3Policy.load(path).card
    assert (card.step, card.transitions, card.seed) == (most, None, None)


CUSTOM = {"policy_class": {":type:": "<class 'abc.ABCMeta'>", "__module__": "mine.policies"}}
WIDE = {
    "action_space": {":type:": "<class 'gymnasium.spaces.box.Box'>", "low": "[-2. -2.]", "high": "[2. 2.]"}
}


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (CUSTOM, "policy class of 'mine.policies', expected one of SAC"),
        ({"policy_class": None}, "policy class of 'None'"),
        (WIDE, r"action space from \[-2. -2.\] to \[2. 2.\], expected 2 from -1 to 1"),
        ({"policy_kwargs": {"activation_fn": "<class 'torch.nn.ELU'>"}}, "ELU'>, expected ReLU or Tanh"),
        ({"policy_kwargs": {"activation_fn": ["ReLU"]}}, "expected ReLU or Tanh"),
        ({"policy_kwargs": {"features_extractor_class": "x"}}, "policy_kwargs sets features_extractor_class"),
        ({"nathlon": 3}, "the card: "),
        ({"nathlon": {"colour": "red"}}, "the card: field colour"),
        ({"nathlon": {"observation": {"version": 1}}}, "the card: .*version is 1"),
        ({"nathlon": CARD}, f"takes {SPEC.size} numbers, expected {ODD.size} as its card's observation has"),
    ],
)
def test_other_settings_are_refused(tmp_path: Path, saved: Path, data: dict[str, Any], message: str) -> None:
    path = rewrite(saved, tmp_path / "b.zip", data)
    with pytest.raises(InputError, match=rf"b\.zip: .*{message}") as caught:
        Sb3Policy.load(path)
    assert "\n" not in str(caught.value)


@pytest.mark.filterwarnings("ignore:Validating sparse tensor")
@pytest.mark.parametrize(
    ("tensors", "message"),
    [
        ({"actor.mu.bias": None}, "'actor.mu.bias' is missing"),
        ({"actor.latent_pi.0.weight": None}, "'actor.latent_pi.0.weight' is missing"),
        ({"actor.latent_pi.1.weight": torch.ones(8)}, "'actor.latent_pi.1.bias' is missing"),
        (
            {"actor.features_extractor.scale": torch.ones(1)},
            "features_extractor.scale' is not one of the actor",
        ),
        ({"actor.mu.weight": torch.ones(3, 6)}, r"layer 'actor.mu' has shapes \(3, 6\) .* expected \(2, 6\)"),
        ({"actor.latent_pi.2.weight": torch.ones(6, 7)}, r"'actor.latent_pi.2' .* expected \(6, 8\)"),
        (
            {"actor.latent_pi.0.weight": torch.ones(8, 100)},
            f"takes 100 numbers, but its observation space has {SPEC.size}",
        ),
        ({"actor.mu.weight": torch.ones(2, 6).double()}, "not of float32"),
        ({"actor.mu.weight": "ones"}, "not of float32"),
        ({"actor.mu.weight": torch.tensor(1.0)}, "not of float32"),
        ({"actor.mu.weight": torch.ones(2, 6).to_sparse()}, "_rebuild_sparse_tensor, expected plain"),
        (
            {"actor.mu.bias": torch.tensor([1.0, float("nan")])},
            "'actor.mu.bias' holds numbers that are not finite",
        ),
    ],
)
def test_other_architectures_are_refused(
    tmp_path: Path, saved: Path, tensors: dict[str, Any], message: str
) -> None:
    path = rewrite(saved, tmp_path / "b.zip", tensors=tensors)
    with pytest.raises(InputError, match=rf"b\.zip: .*{message}"):
        Sb3Policy.load(path)


def test_other_files_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "c.zip"
    with pytest.raises(InputError, match=r"c\.zip: cannot read the policy: No such file"):
        Sb3Policy.load(path)
    path.write_bytes(b"a text")
    with pytest.raises(InputError, match=r"c\.zip: not a whole \.zip"):
        Sb3Policy.load(path)
    pack(path, {"other": b""})
    with pytest.raises(InputError, match=r"c\.zip: no member 'data'"):
        Sb3Policy.load(path)
    pack(path, {"data": b"[]", "policy.pth": b""})
    with pytest.raises(InputError, match=r"c\.zip: member 'data' is no JSON object"):
        Sb3Policy.load(path)


@settings(max_examples=60, deadline=None)
@given(data=st.data())
def test_changed_bytes_give_a_policy_or_an_error(
    tmp_path_factory: pytest.TempPathFactory, saved: Path, data: st.DataObject
) -> None:
    content = bytearray(saved.read_bytes())
    for position, value in data.draw(
        st.lists(st.tuples(st.integers(0, len(content) - 1), st.integers(0, 255)), min_size=1, max_size=4)
    ):
        content[position] = value
    path = tmp_path_factory.getbasetemp() / "d.zip"
    path.write_bytes(content[: data.draw(st.sampled_from([len(content), len(content) // 2]))])
    try:
        policy = Sb3Policy.load(path)
    except InputError as error:
        assert "d.zip" in str(error)  # noqa: PT017 - either outcome is right
    else:
        actions, _ = policy.act(np.zeros((2, SPEC.size), np.float32), policy.initial_memory(2))
        assert (np.abs(actions) <= 1.0).all()


def test_the_example_of_the_page_leaves_a_policy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    page = Path(__file__).parent.parent.parent / "docs" / "bring-your-own-policy.md"
    examples = re.findall(r"```python\n(.*?)```", page.read_text("utf-8"), re.DOTALL)
    (example,) = (text for text in examples if "SAC(" in text)
    monkeypatch.chdir(tmp_path)
    exec(compile(example, page.name, "exec"), {})
    policy = Sb3Policy.load(tmp_path / "mine.zip")
    assert policy.observation_spec == ObservationSpec(course_points=20)
    assert (policy.card.circuit, policy.card.car, policy.card.step) == ("lindenring", "gt3", 16)


def test_what_the_example_trains_races(
    tmp_path: Path, pool: Pool, capsys: pytest.CaptureFixture[str]
) -> None:
    main(["--steps", "60", "--out", str(tmp_path)])
    paths = find_sources([tmp_path])
    assert len(paths) == 2 * CHECKPOINTS
    assert trained_on(pool, map(str, paths)) == ("lindenring", "gt3")
    entrants = enter_all(pool, [str(path) for path in paths], "lindenring", "gt3")
    assert {entrant.algorithm for entrant in entrants} == {"SB3 SAC", "SB3 TQC"}
    last = {e.name: e for e in entrants}["tqc_60_steps"]
    assert (last.seed, last.step) == (1, 53)
    capsys.readouterr()
    finals = [str(tmp_path / f"{name}_60_steps.zip") for name in LEARNERS]
    race(finals, "slipstream_pass")
    shown = capsys.readouterr().out
    assert "slipstream_pass on lindenring" in shown
    assert "policy raised" not in shown


CAMERA = ObservationSpec(camera=CameraSpec(width=40, height=36, mount="roof"))


def save_seeing(path: Path, spec: ObservationSpec, **facts: Any) -> Any:
    """Make a small model that sees by a camera, with further attributes, and save it."""
    kwargs = {"net_arch": [8], "features_extractor_kwargs": {"cnn_output_dim": 16}}
    model = PPO("MultiInputPolicy", Spaces(spec), seed=3, device="cpu", n_steps=8, policy_kwargs=kwargs)
    vars(model).update(facts)
    model.save(path)
    return model


def test_a_model_that_sees_by_a_camera_acts_as_there(tmp_path: Path) -> None:
    model = save_seeing(tmp_path / "eye.zip", CAMERA, nathlon={"observation": CAMERA.to_dict()})
    policy = Sb3Policy.load(tmp_path / "eye.zip")
    assert policy.observation_spec == CAMERA
    seen, rng = CAMERA.blank(3), np.random.default_rng(1)
    seen["picture"] = rng.integers(0, 256, seen["picture"].shape)
    seen["sensors"] = rng.normal(size=seen["sensors"].shape)
    actions, memory = policy.act(seen, policy.initial_memory(3))
    expected, _ = model.predict(in_space(seen), deterministic=True)
    np.testing.assert_allclose(actions, expected, atol=1e-6)
    assert memory.shape == (3, 0)


def test_a_camera_that_no_card_tells_of_is_the_default_one(tmp_path: Path) -> None:
    spec = ObservationSpec(camera=CameraSpec(width=48, height=40))
    save_seeing(tmp_path / "eye.zip", spec)
    assert Sb3Policy.load(tmp_path / "eye.zip").observation_spec == spec


def test_a_camera_with_other_pictures_than_those_of_training_is_refused(tmp_path: Path) -> None:
    card = {"observation": ObservationSpec(camera=CameraSpec(width=64)).to_dict()}
    save_seeing(tmp_path / "eye.zip", CAMERA, nathlon=card)
    with refusal(tmp_path / "eye.zip", "shape"):
        Sb3Policy.load(tmp_path / "eye.zip")


def test_what_the_example_with_a_camera_trains_races(tmp_path: Path) -> None:
    sb3_camera.main(["--steps", "3", "--out", str(tmp_path)])
    source = str(tmp_path / "sac_camera.zip")
    entrants = [enter(each, "lindenring", "gt3") for each in (source, "driver")]
    assert (entrants[0].algorithm, entrants[0].step) == ("SB3 SAC", 3)
    match = single_race(entrants, "slipstream_pass", seed=1)
    results = run_match(match, [load_policy(each, "lindenring", "gt3") for each in (source, "driver")])
    assert not results["ending"].is_in(POLICY_FAULTS).any()
