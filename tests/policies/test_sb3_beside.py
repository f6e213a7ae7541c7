"""What lies beside a policy of Stable-Baselines3 is applied: statistics, frames, settings of RL Zoo."""

from __future__ import annotations

import re
import shutil
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
import torch
from gymnasium.spaces import Box, Dict, Discrete, Space, flatten
from numpy.typing import NDArray
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import DummyVecEnv, VecFrameStack, VecNormalize, VecTransposeImage

from nathlon import GymnasiumWorld
from nathlon.arena import payload
from nathlon.policies.general import load_general
from nathlon.policies.sources.identity import policy_id
from nathlon.policies.sources.normalisation import companions
from nathlon.selection.publish.sent import copy_policy
from nathlon.sim.errors import InputError
from tests.policies.old_stable_baselines import ACTIONS, NUMBERS, PAIR, shown
from tests.support.refusals import refusal

OLD = Path(__file__).parent.parent / "data" / "sb3"
BOTH = Dict({"near": Box(-9.0, 9.0, (2,), np.float64), "far": Box(-9.0, 9.0, (1,), np.float32)})
PICTURE = Box(0, 255, (40, 36, 1), np.uint8)


class Seen(gymnasium.Env[Any, Any]):
    """Observations drawn from a space, without a world; every episode has five."""

    def __init__(self, seen: Space[Any]) -> None:
        self.observation_space, self.action_space = seen, Discrete(4)

    def reset(self, *, seed: int | None = None, options: Any = None) -> Any:
        self.steps = 0
        return self._draw(), {}

    def step(self, action: Any) -> Any:
        self.steps += 1
        return self._draw(), 0.0, False, self.steps % 5 == 0, {}

    def _draw(self) -> Any:
        drawn = self.observation_space.sample()
        return 3.0 * drawn if isinstance(drawn, np.ndarray) and drawn.dtype == np.float64 else drawn


def saved(path: Path, environments: Any, policy: str = "MlpPolicy") -> Any:
    """A model of few units, whose actions differ."""
    on: dict[str, Any] = {
        "n_steps": 8,
        "batch_size": 8,
        "device": "cpu",
        "seed": 1,
        "policy_kwargs": {"net_arch": [6]},
    }
    model = PPO(policy, environments, **on)
    for name, parameter in model.policy.named_parameters():
        parameter.data *= 60.0 if "action_net" in name else 4.0 if "cnn" in name else 1.0
    model.save(path)
    return model


def normalised_module() -> Any:
    """What the page says how statistics come into a graph."""
    page = Path(__file__).parent.parent.parent / "docs" / "bring-your-own-policy.md"
    recipes = re.findall(r"```python\n(.*?)```", page.read_text("utf-8"), re.DOTALL)
    (recipe,) = (text for text in recipes if "class Normalised" in text)
    made: dict[str, Any] = {}
    exec(compile(recipe, page.name, "exec"), made)
    return made["Normalised"]


def lived_in(environments: Any) -> None:
    """Have statistics of some observations."""
    environments.reset()
    for _ in range(40):
        environments.step([0])


def agree(path: Path, model: Any, environments: Any, seen: Space[Any], count: int) -> None:
    """Assert that a policy does in episodes what the model does behind the wrappers of its training."""
    policy = load_general(str(path), seen, model.action_space)
    inner: Any = environments
    while not isinstance(inner, DummyVecEnv):
        inner = inner.venv
    rng, memory, wrapped = np.random.default_rng(0), policy.initial_memory(1), environments.reset()
    found, expected = [], []
    for _ in range(count):
        raw: dict[Any, Any] = {key: rows[0] for key, rows in inner.buf_obs.items()}
        flat = flatten(seen, raw if isinstance(seen, Dict) else raw[None])
        row = np.asarray(flat, np.float64 if policy.precise else np.float32)[None]
        numbers, memory = policy.act(row, memory)
        found.append(policy.decode(numbers[0], model.action_space, rng))
        actions, _ = model.predict(wrapped, deterministic=True)
        expected.append(actions[0])
        wrapped, _, done, _ = environments.step(actions)
        if done[0]:
            memory = policy.initial_memory(1)
    np.testing.assert_allclose(found, expected, atol=2e-5)
    assert np.ptp(expected, axis=0).min() > 0, "the actions differ between observations"


@pytest.mark.parametrize("version", ["1.8.0", "2.0.0", "2.3.2"])
def test_policies_of_older_versions_act_as_they_did(version: str) -> None:
    rows: NDArray[Any] = shown()  # type: ignore[no-untyped-call]  # it runs in old environments too
    pairs = [{"b": np.tanh(row[:2]).astype(np.float32), "a": np.int64(abs(row[2])) % 3} for row in rows]
    for name, seen, done, observations in (
        ("ppo_8_steps", NUMBERS, ACTIONS, rows),
        ("tqc", NUMBERS, ACTIONS, rows.astype(np.float32)),
        ("pair", PAIR, Discrete(4), np.array([flatten(PAIR, pair) for pair in pairs], np.float32)),
        ("lstm", NUMBERS, Discrete(4), rows.astype(np.float32)),
    ):
        policy = load_general(str(OLD / version / f"{name}.zip"), seen, done)
        rng, memory = np.random.default_rng(0), policy.initial_memory(1)
        found = []
        for row in observations:
            numbers, memory = policy.act(row[None], memory)
            found.append(policy.decode(numbers[0], done, rng))
        expected = np.load(OLD / version / f"{name.removesuffix('_8_steps')}.npy")
        np.testing.assert_allclose(found, expected, atol=2e-5)
        assert np.ptp(expected, axis=0).min() > 0


def test_statistics_are_applied_as_there(tmp_path: Path) -> None:
    environments: Any = VecNormalize(DummyVecEnv([lambda: Seen(NUMBERS)]), clip_obs=1.5)
    model = saved(tmp_path / "rl_model_8_steps.zip", environments)
    lived_in(environments)
    statistics = tmp_path / "rl_model_vecnormalize_8_steps.pkl"
    environments.save(str(statistics))
    plain = policy_id(str(tmp_path / "rl_model_8_steps.zip"))
    loaded = VecNormalize.load(str(statistics), environments.venv)
    loaded.training = False
    agree(tmp_path / "rl_model_8_steps.zip", model, loaded, NUMBERS, 1000)
    rows = shown()  # type: ignore[no-untyped-call]
    folded = normalised_module()(torch.nn.Identity(), loaded)(torch.tensor(rows, dtype=torch.float32))
    np.testing.assert_allclose(folded, np.asarray(loaded.normalize_obs(rows)), atol=1e-5)

    policy = load_general(str(tmp_path / "rl_model_8_steps.zip"), NUMBERS, Discrete(4))
    assert policy.id == plain
    environments.step([0])
    environments.save(str(statistics))
    assert policy_id(str(tmp_path / "rl_model_8_steps.zip")) not in (plain, "")
    statistics.unlink()
    assert policy_id(str(tmp_path / "rl_model_8_steps.zip")) != plain


def test_statistics_of_some_keys_are_applied(tmp_path: Path) -> None:
    environments = VecNormalize(DummyVecEnv([lambda: Seen(BOTH)]), norm_obs_keys=["near"])
    model = saved(tmp_path / "both.zip", environments, "MultiInputPolicy")
    lived_in(environments)
    environments.save(str(tmp_path / "both_vecnormalize.pkl"))
    environments.training = False
    agree(tmp_path / "both.zip", model, environments, BOTH, 1000)
    other = Dict({"near": BOTH["near"], "beside": BOTH["far"]})
    with refusal(tmp_path / "both.zip", "sees 'far', expected 'beside', 'near'"):
        load_general(str(tmp_path / "both.zip"), other, Discrete(4))


def zoo(folder: Path, config: str) -> Path:
    """A folder as RL Zoo leaves it, for `Walker-v3_1`."""
    run = folder / "Walker-v3_1"
    (run / "Walker-v3").mkdir(parents=True)
    (run / "Walker-v3" / "config.yml").write_text(config)
    (run / "Walker-v3" / "args.yml").write_text(
        "!!python/object/apply:collections.OrderedDict\n- - - n\n    - 1\n"
    )
    return run


def test_a_folder_of_rl_zoo_goes_in_as_it_is(tmp_path: Path) -> None:
    run = zoo(tmp_path, "normalize: \"{'norm_obs': True, 'norm_reward': False}\"\nframe_stack: 3\n")
    environments: Any = VecFrameStack(VecNormalize(DummyVecEnv([lambda: Seen(NUMBERS)])), 3)
    model = saved(run / "best_model.zip", environments)
    for name in ("Walker-v3.zip", "rl_model_8_steps.zip", "rl_model_16_steps.zip"):
        shutil.copy(run / "best_model.zip", run / name)
    lived_in(environments)
    with refusal(
        run / "best_model.zip", "'config.yml' say that observations were normalised, expected the stat"
    ):
        load_general(str(run / "best_model.zip"), NUMBERS, Discrete(4))
    environments.venv.save(str(run / "Walker-v3" / "vecnormalize.pkl"))
    environments.venv.training = False
    agree(run / "rl_model_8_steps.zip", model, environments, NUMBERS, 1000)
    ids = {policy_id(str(path)) for path in run.glob("*.zip")}
    assert len(ids) == 1
    for name in ("best_model", "Walker-v3", "rl_model_16_steps"):
        assert load_general(str(run / f"{name}.zip"), NUMBERS, Discrete(4)).id in ids


def test_stacked_pictures_are_turned_and_scaled(tmp_path: Path) -> None:
    run = zoo(tmp_path, "frame_stack: 2\n")
    environments = VecTransposeImage(VecFrameStack(DummyVecEnv([lambda: Seen(PICTURE)]), 2))
    model = saved(run / "best_model.zip", environments, "CnnPolicy")
    agree(run / "best_model.zip", model, environments, PICTURE, 60)
    policy = load_general(str(run / "best_model.zip"), PICTURE, Discrete(4))
    assert policy.initial_memory(2).shape == (2, 40 * 36)


def test_frames_that_nobody_tells_of_are_refused_with_the_cure(tmp_path: Path) -> None:
    environments = VecFrameStack(DummyVecEnv([lambda: Seen(NUMBERS)]), 4)
    path = tmp_path / "stacked.zip"
    model = saved(path, environments)
    with refusal(
        path, "takes 12 numbers, expected 3 .*; if 4 frames were stacked, write 'frame_stack: 4' into"
    ):
        load_general(str(path), NUMBERS, Discrete(4))
    (tmp_path / "stacked.config.yml").write_text("frame_stack: 4\n")
    agree(path, model, environments, NUMBERS, 100)


def test_a_wrapper_of_training_is_told(tmp_path: Path) -> None:
    run = zoo(tmp_path, "env_wrapper:\n- rl_zoo3.wrappers.FrameSkip:\n    skip: 4\n")
    saved(run / "best_model.zip", DummyVecEnv([lambda: Seen(NUMBERS)]))
    source = str(run / "best_model.zip")
    assert load_general(source, NUMBERS, Discrete(4)).wrappers == ("FrameSkip",)

    class FrameSkip(gymnasium.Wrapper[Any, Any, Any, Any]):
        """Called as the one of training."""

    with pytest.raises(
        InputError, match="was trained in the wrapper FrameSkip, expected the environment in it"
    ):
        GymnasiumWorld({"still": lambda: Seen(NUMBERS)}).policy(source)
    assert GymnasiumWorld({"still": lambda: FrameSkip(Seen(NUMBERS))}).policy(source).id


def test_a_copy_keeps_what_lies_beside_it_and_stays_here(tmp_path: Path) -> None:
    run = zoo(tmp_path, "normalize: true\n")
    environments = VecNormalize(DummyVecEnv([lambda: Seen(NUMBERS)]))
    saved(run / "best_model.zip", environments)
    environments.save(str(run / "Walker-v3" / "vecnormalize.pkl"))
    (tmp_path / "sent").mkdir()
    for name in ("first", "model"):
        copy_policy(run / "best_model.zip", tmp_path / "sent" / f"{name}.zip")
        assert policy_id(str(tmp_path / "sent" / f"{name}.zip")) == policy_id(str(run / "best_model.zip"))
    assert payload._label(str(run / "best_model.zip"), shared=True) is None


@pytest.mark.parametrize(
    ("policy", "beside", "message"),
    [
        (
            "rl_model_8_steps.zip",
            ["rl_model_vecnormalize_16_steps.pkl"],
            "'rl_model_vecnormalize_8_steps.pkl', as",
        ),
        (
            "a.zip",
            ["b.zip", "vecnormalize.pkl"],
            "statistics of several policies here, .*'a_vecnormalize.pkl'",
        ),
        ("a.zip", ["first_vecnormalize.pkl", "second_vecnormalize.pkl"], "expected one file"),
        ("a.zip", ["obs_rms.npz"], "expected what VecNormalize.save writes, as 'a_vecnormalize.pkl'"),
    ],
)
def test_statistics_that_may_be_others_are_refused(
    tmp_path: Path, policy: str, beside: list[str], message: str
) -> None:
    for name in (policy, *beside):
        (tmp_path / name).touch()
    with refusal(tmp_path / policy, message):
        companions(tmp_path / policy)


def test_statistics_of_other_observations_are_refused(tmp_path: Path) -> None:
    saved(tmp_path / "a.zip", DummyVecEnv([lambda: Seen(NUMBERS)]))
    four: NDArray[Any] = np.zeros(4)
    VecNormalize(DummyVecEnv([lambda: Seen(Box(four - 1, four + 1, dtype=np.float64))])).save(
        str(tmp_path / "a_vecnormalize.pkl")
    )
    with refusal(tmp_path / "a.zip", r"its statistics have shape \(4,\), expected \(3,\)"):
        load_general(str(tmp_path / "a.zip"), NUMBERS, Discrete(4))
