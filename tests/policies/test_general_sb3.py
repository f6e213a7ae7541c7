"""Policies of Stable-Baselines3 in any space: the same actions as there, and what is refused."""

from __future__ import annotations

import hashlib
import json
import zipfile
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
import torch
from gymnasium.spaces import Box, Dict, Discrete, MultiBinary, MultiDiscrete, Space, flatten
from sb3_contrib import ARS, QRDQN, TQC, TRPO, CrossQ, MaskablePPO, RecurrentPPO
from stable_baselines3 import A2C, DDPG, DQN, PPO, SAC, TD3

from nathlon.policies.general import load_general
from nathlon.sim.errors import InputError
from tests.policies.test_sb3 import rewrite
from tests.support.refusals import refusal

SEEN = Box(-np.inf, np.inf, (5,), np.float32)
UNEVEN = Box(np.array([-2.0, 0.1, -1.0], np.float32), np.array([2.0, 0.4, 3.0], np.float32))
TANH = {"activation_fn": torch.nn.Tanh}
RELU = {"activation_fn": torch.nn.ReLU}


class Spaces(gymnasium.Env[Any, Any]):
    """Two spaces, without a world."""

    def __init__(self, action: Space[Any], observation: Space[Any] = SEEN) -> None:
        self.observation_space, self.action_space = observation, action


def save(
    algorithm: Any, path: Path, action: Space[Any], observation: Space[Any] = SEEN, **settings: Any
) -> Any:
    """Make a model of 8 and 6 units, strong enough that its actions differ, and save it."""
    off_policy = issubclass(algorithm, SAC | TQC | TD3 | DQN)
    recurrent = issubclass(algorithm, RecurrentPPO)
    model = algorithm(
        "MlpLstmPolicy" if recurrent else "MlpPolicy",
        Spaces(action, observation),
        seed=3,
        device="cpu",
        policy_kwargs={"net_arch": [8, 6]} | ({"lstm_hidden_size": 7} if recurrent else {}) | settings,
        **({"buffer_size": 10} if off_policy else {}),
    )
    if hasattr(model.policy, "action_net"):  # they begin close to 0
        model.policy.action_net.weight.data *= 300.0
    model.save(path)
    return model


@pytest.mark.filterwarnings("ignore::UserWarning")
@pytest.mark.parametrize(
    ("algorithm", "action", "settings", "name"),
    [
        (PPO, UNEVEN, {}, "SB3 PPO or A2C"),
        (PPO, Box(-1.0, 1.0, (2, 2)), RELU, "SB3 PPO or A2C"),
        (PPO, Discrete(4), {}, "SB3 PPO or A2C"),
        (PPO, Discrete(4), {"net_arch": []}, "SB3 PPO or A2C"),
        (PPO, MultiDiscrete([2, 3, 4]), {}, "SB3 PPO or A2C"),
        (A2C, UNEVEN, {}, "SB3 PPO or A2C"),
        (A2C, Discrete(3), {}, "SB3 PPO or A2C"),
        (A2C, MultiDiscrete([5, 2]), {}, "SB3 PPO or A2C"),
        (TRPO, Discrete(3), {}, "SB3 PPO or A2C"),
        (SAC, UNEVEN, {}, "SB3 SAC"),
        (SAC, Box(0.0, 10.0, (2, 1), np.float64), TANH, "SB3 SAC"),
        (TQC, UNEVEN, {}, "SB3 TQC"),
        (TD3, UNEVEN, {}, "SB3 TD3 or DDPG"),
        (DDPG, UNEVEN, {}, "SB3 TD3 or DDPG"),
        (DQN, Discrete(4), {}, "SB3 DQN"),
        (DQN, Discrete(3), {"net_arch": [], **TANH}, "SB3 DQN"),
        (DQN, Discrete(3), TANH, "SB3 DQN"),
    ],
)
def test_acts_as_it_does_in_stable_baselines(
    tmp_path: Path, algorithm: Any, action: Space[Any], settings: dict[str, Any], name: str
) -> None:
    path = tmp_path / "model.zip"
    model = save(algorithm, path, action, **settings)
    policy = load_general(str(path), SEEN, action)
    observations = np.random.default_rng(0).normal(0.0, 10.0, (50, 5)).astype(np.float32)
    outputs, memory = policy.act(observations, policy.initial_memory(50))
    assert outputs.dtype == np.float32
    assert memory.shape == (50, 0)
    rng = np.random.default_rng(0)
    found = [policy.decode(row, action, rng) for row in outputs]
    expected, _ = model.predict(observations, deterministic=True)
    np.testing.assert_allclose(found, expected, atol=2e-5)
    assert np.ptp(expected, axis=0).min() > 0, "the actions differ between observations"
    assert all(action.contains(each) for each in found)
    assert (policy.algorithm, policy.observation_size) == (name, 5)


@pytest.mark.filterwarnings("ignore::UserWarning")
@pytest.mark.parametrize("action", [UNEVEN, Discrete(4), MultiDiscrete([2, 3])])
@pytest.mark.parametrize("settings", [{}, {"n_lstm_layers": 2, "enable_critic_lstm": False}])
def test_a_recurrent_policy_remembers_as_it_does_there(
    tmp_path: Path, action: Space[Any], settings: dict[str, Any]
) -> None:
    path = tmp_path / "model.zip"
    model = save(RecurrentPPO, path, action, **settings)
    for name, parameter in model.policy.named_parameters():
        if name.startswith("lstm_actor"):
            parameter.data *= 3.0
    model.save(path)
    policy = load_general(str(path), SEEN, action)
    assert (policy.algorithm, policy.observation_size) == ("SB3 RecurrentPPO", 5)
    rng = np.random.default_rng(0)
    memory, state, decided = policy.initial_memory(6), None, []
    assert memory.shape == (6, 14 * settings.get("n_lstm_layers", 1))
    for _ in range(30):
        observations = rng.normal(0.0, 2.0, (6, 5)).astype(np.float32)
        outputs, memory = policy.act(observations, memory)
        expected, state = model.predict(observations, state, np.zeros(6), deterministic=True)
        decided.append([policy.decode(row, action, rng) for row in outputs])
        np.testing.assert_allclose(decided[-1], expected, atol=1e-4)
    assert memory.dtype == np.float32
    assert np.ptp(np.concatenate(decided), axis=0).max() > 0


CNN = Box(0, 255, (3, 40, 36), np.uint8)
PARTS = Dict({"picture": CNN, "near": Box(-1.0, 1.0, (3,)), "light": Discrete(3)})


@pytest.mark.filterwarnings("ignore::UserWarning")
@pytest.mark.parametrize(
    ("algorithm", "policy", "seen", "action", "settings"),
    [
        (SAC, "MlpPolicy", SEEN, UNEVEN, {"use_sde": True, "buffer_size": 10}),
        (CrossQ, "MlpPolicy", SEEN, UNEVEN, {"buffer_size": 10}),
        (ARS, "MlpPolicy", SEEN, UNEVEN, {}),
        (ARS, "LinearPolicy", SEEN, UNEVEN, {}),
        (ARS, "MlpPolicy", SEEN, Discrete(4), {}),
        (QRDQN, "MlpPolicy", SEEN, Discrete(4), {"buffer_size": 10}),
        (PPO, "MlpPolicy", SEEN, UNEVEN, {"use_sde": True, "policy_kwargs": {"squash_output": True}}),
        (PPO, "CnnPolicy", CNN, Discrete(4), {}),
        (DQN, "CnnPolicy", CNN, Discrete(4), {"buffer_size": 10}),
        (SAC, "MultiInputPolicy", PARTS, UNEVEN, {"buffer_size": 10}),
        (PPO, "MultiInputPolicy", PARTS, Discrete(4), {"policy_kwargs": {"share_features_extractor": False}}),
    ],
)
def test_other_policies_act_as_they_do_there(
    tmp_path: Path,
    algorithm: Any,
    policy: str,
    seen: Space[Any],
    action: Space[Any],
    settings: dict[str, Any],
) -> None:
    arguments = {"device": "cpu", "seed": 1, **settings}
    model = algorithm(policy, Spaces(action, seen), **arguments)
    state: dict[str, Any] = model.policy.state_dict()
    for name, tensor in state.items():
        if "ra_" in name:  # of running statistics
            tensor.uniform_(0.5, 2.0)
        elif algorithm is ARS or "action_net" in name or "cnn" in name or "linear" in name:
            tensor.mul_(0.5 if algorithm is ARS else 5.0)
            tensor.add_(torch.randn_like(tensor) * (0.3 if algorithm is ARS else 0.0))
    model.policy.load_state_dict(state)
    model.save(tmp_path / "model.zip")
    seen.seed(0)
    shown = [seen.sample() for _ in range(1000 if seen is SEEN else 30)]
    read = load_general(str(tmp_path / "model.zip"), seen, action)
    rng = np.random.default_rng(0)
    flat = np.array([flatten(seen, each) for each in shown], np.float32)
    outputs, _ = read.act(flat, read.initial_memory(len(flat)))
    found = [read.decode(row, action, rng) for row in outputs]
    expected = [model.predict(each, deterministic=True)[0] for each in shown]
    np.testing.assert_allclose(found, expected, atol=2e-5)
    assert np.ptp(expected, axis=0).min() > 0, "the actions differ between observations"


def test_masks_are_heeded_by_those_trained_with_them(tmp_path: Path) -> None:
    class Masked(Spaces):
        def action_masks(self) -> Any:
            return np.ones(4, bool)

    model: Any = MaskablePPO("MlpPolicy", Masked(Discrete(4)), seed=1, device="cpu")
    model.policy.action_net.weight.data *= 300.0
    model.save(tmp_path / "model.zip")
    policy = load_general(str(tmp_path / "model.zip"), SEEN, Discrete(4))
    rng = np.random.default_rng(0)
    shown = rng.normal(0.0, 3.0, (1000, 5)).astype(np.float32)
    masks = rng.random((1000, 4)) < 0.5
    masks[:, 1] |= ~masks.any(axis=1)
    outputs, _ = policy.act(shown, policy.initial_memory(1000))
    found = [policy.decode(row, Discrete(4), rng, mask) for row, mask in zip(outputs, masks, strict=True)]
    np.testing.assert_array_equal(found, model.predict(shown, action_masks=masks, deterministic=True)[0])
    assert len(set(found)) == 4
    masked = Dict({"observation": SEEN, "action_mask": Box(0, 1, (4,), np.int8)})
    inside = load_general(str(tmp_path / "model.zip"), masked, Discrete(4))
    flat = np.array([flatten(masked, {"observation": row, "action_mask": masks[0]}) for row in shown[:9]])
    numbers, _ = inside.act(flat.astype(np.float32), inside.initial_memory(9))
    np.testing.assert_allclose(numbers, outputs[:9], atol=1e-5)


def test_bounds_are_the_same_however_they_were_printed(tmp_path: Path) -> None:
    with np.printoptions(precision=1, floatmode="fixed", suppress=True):
        save(PPO, tmp_path / "model.zip", UNEVEN)
    assert load_general(str(tmp_path / "model.zip"), SEEN, UNEVEN).id


@pytest.mark.filterwarnings("ignore::UserWarning")
@pytest.mark.parametrize("seen", [Discrete(4), MultiDiscrete([3, 2]), MultiBinary(3), Box(-1.0, 1.0, (2, 3))])
def test_observations_are_flat_as_gymnasium_flattens_them(tmp_path: Path, seen: Space[Any]) -> None:
    path = tmp_path / "model.zip"
    model = save(DQN, path, Discrete(5), seen)
    policy = load_general(str(path), seen, Discrete(5))
    seen.seed(0)
    shown = [seen.sample() for _ in range(20)]
    flat = np.array([flatten(seen, each) for each in shown], np.float32)
    outputs, _ = policy.act(flat, policy.initial_memory(20))
    expected = [model.predict(each, deterministic=True)[0] for each in shown]
    assert [policy.decode(row, Discrete(5), np.random.default_rng(0)) for row in outputs] == expected


@pytest.fixture(scope="module")
def saved(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """A model of each kind of action."""
    folder = tmp_path_factory.mktemp("saved")
    made = {
        "box": (PPO, UNEVEN),
        "discrete": (PPO, Discrete(4)),
        "groups": (PPO, MultiDiscrete([2, 3])),
        "sac": (SAC, UNEVEN),
        "dqn": (DQN, Discrete(4)),
        "lstm": (RecurrentPPO, Discrete(4)),
    }
    for name, (algorithm, action) in made.items():
        save(algorithm, folder / f"{name}.zip", action)
    return {name: folder / f"{name}.zip" for name in made}


def test_what_is_known_of_a_file(tmp_path: Path, saved: dict[str, Path]) -> None:
    path = rewrite(saved["dqn"], tmp_path / "b.zip", {"_n_updates": 70})
    policy = load_general(str(path))
    assert policy.id == hashlib.sha256(path.read_bytes()).hexdigest()
    assert (policy.algorithm, policy.step, policy.seed) == ("SB3 DQN", 70, 3)
    path = rewrite(saved["dqn"], tmp_path / "b.zip", {"nathlon": {"algorithm": "mine", "step": 5}})
    policy = load_general(str(path))
    assert (policy.algorithm, policy.step, policy.seed) == ("mine", 5, 3)


@pytest.mark.parametrize(
    ("name", "seen", "action", "message"),
    [
        ("box", Box(-1.0, 1.0, (4,)), UNEVEN, "takes 5 numbers, expected 4 for the observation space Box"),
        (
            "box",
            SEEN,
            Box(-2.0, 2.0, (3,)),
            r"action space has low \[-2. -2. -2.\], expected \[-2. 0.1 -1. \]",
        ),
        ("sac", SEEN, Box(-1.0, 1.0, (2,)), "gives 3 numbers, expected 2 for the action space Box"),
        ("sac", SEEN, Discrete(3), r"action space is Discrete\(3\), expected Box"),
        ("box", SEEN, Discrete(3), r"action space is Discrete\(3\), expected Box"),
        ("discrete", SEEN, Box(-1.0, 1.0, (4,)), "expected Discrete or MultiDiscrete"),
        ("discrete", SEEN, Discrete(5), "gives 4 numbers, expected 5"),
        ("discrete", SEEN, MultiDiscrete([2, 2]), "action space has n None, expected 4 as in training"),
        ("groups", SEEN, MultiDiscrete([3, 2]), r"action space has nvec \[3 2\], expected \[2 3\]"),
    ],
)
def test_a_policy_of_other_spaces_is_refused(
    saved: dict[str, Path], name: str, seen: Space[Any], action: Space[Any], message: str
) -> None:
    with refusal(saved[name], message):
        load_general(str(saved[name]), seen, action)


def space(**fields: Any) -> dict[str, Any]:
    """An entry of `data` for an action space."""
    return {"action_space": {":type:": "<class 'gymnasium.spaces.box.Box'>"} | fields}


IMAGES = {"observation_space": {"dtype": "uint8", "_shape": [3, 40, 40]}}
BINARY = space(**{":type:": "<class 'gymnasium.spaces.multi_binary.MultiBinary'>"})
CUSTOM = {"policy_class": {"__module__": "mine.policies"}}


@pytest.mark.parametrize(
    ("name", "data", "message"),
    [
        (
            "sac",
            CUSTOM,
            "policy class of 'mine.policies', expected one of SAC, TQC, .* name a loader in the world's map",
        ),
        ("box", BINARY, "action space is MultiBinary, expected Box or Discrete or MultiDiscrete"),
        ("dqn", space(), "action space is Box, expected Discrete"),
        ("sac", {"action_space": None}, "action space is None, expected Box"),
        ("discrete", IMAGES, "observation space of pictures cannot be read"),
        ("lstm", {"policy_kwargs": {"lstm_kwargs": {"proj_size": 2}}}, "policy_kwargs sets lstm_kwargs"),
        ("dqn", {"policy_kwargs": {"features_extractor_class": "x"}}, "sets features_extractor_class"),
        ("dqn", {"policy_kwargs": {"activation_fn": "ELU"}}, "activation_fn is ELU, expected ReLU or Tanh"),
        ("dqn", {"nathlon": {"colour": "red"}}, "the card: field colour"),
    ],
)
def test_other_settings_are_refused(
    tmp_path: Path, saved: dict[str, Path], name: str, data: dict[str, Any], message: str
) -> None:
    path = rewrite(saved[name], tmp_path / "b.zip", data)
    with refusal(path, message):
        load_general(str(path))


@pytest.mark.parametrize(
    ("name", "tensors", "message"),
    [
        ("dqn", {"q_net.q_net.0.weight": None}, "'q_net.q_net.0.weight' is missing"),
        ("dqn", {"q_net.q_net.4.bias": torch.ones(3)}, "'q_net.q_net.4' has shapes"),
        ("dqn", {"q_net.q_net.4.bias": torch.full((4,), np.nan)}, "numbers that are not finite"),
        ("box", {"lstm_actor.bias_hh_l0": torch.ones(1)}, "'lstm_actor.bias_hh_l0' is not one of the actor"),
        ("lstm", {"lstm_actor.weight_ih_l0": None}, "'lstm_actor.weight_ih_l0' is missing"),
        ("lstm", {"lstm_actor.bias_hh_l0": None}, "'lstm_actor.bias_hh_l0' is missing"),
        ("lstm", {"lstm_actor.bias_hh_l0": torch.ones(5)}, r"has shape \(5,\), expected \(28,\)"),
        ("lstm", {"lstm_actor.weight_hr_l0": torch.ones(5)}, "weight_hr_l0' is not one of the actor"),
        ("lstm", {"lstm_actor.bias_hh_l0": torch.full((28,), np.inf)}, "numbers that are not finite"),
    ],
)
def test_other_architectures_are_refused(
    tmp_path: Path, saved: dict[str, Path], name: str, tensors: dict[str, Any], message: str
) -> None:
    path = rewrite(saved[name], tmp_path / "b.zip", tensors=tensors)
    with refusal(path, message):
        load_general(str(path))


def test_what_a_file_says_of_its_space_is_told_on_a_short_line(
    tmp_path: Path, saved: dict[str, Path]
) -> None:
    with zipfile.ZipFile(saved["box"]) as archive:
        entry = json.loads(archive.read("data"))["action_space"]
    path = rewrite(
        saved["box"], tmp_path / "b.zip", space(**entry | {":serialized:": "", "low": "\x1b[2J" + "9" * 5000})
    )
    with pytest.raises(InputError, match="action space has low") as caught:
        load_general(str(path), SEEN, UNEVEN)
    reason = str(caught.value).removeprefix(str(path))
    assert reason.isprintable()
    assert len(reason) < 300
