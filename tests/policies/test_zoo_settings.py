"""Settings that RL Zoo keeps of a run: what they say of observations, and nothing that runs."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from nathlon.policies.sources.zoo_settings import ZooSettings, alike, made_with
from nathlon.sim.errors import InputError
from tests.support.refusals import refusal
from tests.support.spoiling import spoilt_bytes

CONFIG = """!!python/object/apply:collections.OrderedDict
- - - batch_size
    - 256
  - - env_wrapper
    - - stable_baselines3.common.atari_wrappers.AtariWrapper
      - gymnasium.wrappers.TimeLimit:
          max_episode_steps: 100
  - - frame_stack
    - 4
  - - normalize
    - '{''norm_obs'': True, ''norm_reward'': False}'
  - - policy_kwargs
    - dict(net_arch=[64, 64])
  - - shape
    - !!python/tuple
      - 1
      - 2
  - - activation
    - !!python/name:torch.nn.modules.activation.ReLU ''
"""


ARGUMENTS = """!!python/object/apply:collections.OrderedDict
- - - algo
    - ppo
  - - env_kwargs
    - goal: [1, 2]
      render_mode: human
  - - seed
    - 7
"""


def settings(text: str) -> ZooSettings:
    return ZooSettings.read(Path("config.yml"), text.encode())


def test_what_settings_say() -> None:
    found = settings(CONFIG)
    assert (found.frames, found.normalised, found.wrappers) == (4, True, ("AtariWrapper",))
    found = settings("n_envs: 8\npolicy: MlpPolicy\nframe_stack: null\n")
    assert (found.frames, found.normalised, found.wrappers) == (1, False, ())


def test_what_an_environment_was_made_with() -> None:
    assert made_with(Path("args.yml"), ARGUMENTS.encode()) == {"goal": [1, 2]}
    assert made_with(Path("args.yml"), b"env_kwargs: null\n") == {}
    assert alike((1, [2.0]), [1, (2,)])
    assert not alike([1, 2], [1])
    assert not alike(np.zeros(2), [0, 0])
    with refusal(Path("args.yml"), "env_kwargs is 3, expected the arguments of a run of RL Zoo"):
        made_with(Path("args.yml"), b"env_kwargs: 3\n")


@pytest.mark.parametrize(
    ("normalise", "normalised"),
    [
        ("true", True),
        ("false", False),
        ("dict(norm_obs=False, norm_reward=True)", False),
        ("\"{'norm_obs': False}\"", False),
        ("{norm_obs: false}", False),
        ("dict(norm_reward=False)", True),
    ],
)
def test_whether_observations_were_normalised(normalise: str, normalised: bool) -> None:
    assert settings(f"normalize: {normalise}\n").normalised is normalised


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("frame_stack: many\n", "frame_stack is 'many', expected 1 to 16"),
        ("frame_stack: 99\n", "frame_stack is 99"),
        ("- 1\n", "no names with values"),
        ("a: !!python/object/apply:os.system [touch harm]\n", "could not determine a constructor"),
        ("a: !!python/object/new:os.system [touch harm]\n", "could not determine a constructor"),
        ("a: &a {b: 1}\nc: {<<: *a}\n", "merges some"),
        ("a: " + "[" * 5000 + "]" * 5000, "too deep ones"),
        ("[" + "1," * 6000 + "]", "too many parts"),
        ("x" * (1 << 17), "at most 65536 are read"),
        ("a: [1", "expected"),
        ("!!python/object/apply:collections.OrderedDict [[1]]\n", "is no YAML that makes sense"),
        ("env_wrapper: 3\n", "env_wrapper is 3"),
    ],
)
def test_other_settings_are_refused(tmp_path: Path, text: str, message: str) -> None:
    with refusal(Path("config.yml"), message):
        settings(text)
    assert not Path("harm").exists()


@pytest.mark.parametrize(
    ("read", "text"), [(ZooSettings.read, CONFIG), (made_with, ARGUMENTS)], ids=["settings", "arguments"]
)
def test_damaged_settings_are_refused_in_a_sentence(read: Callable[[Path, bytes], Any], text: str) -> None:
    rng, refused = np.random.default_rng(0), list[str]()
    for _ in range(150):
        try:
            read(Path("run.yml"), spoilt_bytes(text.encode(), rng))
        except InputError as error:
            refused.append(str(error))
    assert len(refused) > 75
    assert all(said.startswith("run.yml: ") and said.isprintable() for said in refused)
