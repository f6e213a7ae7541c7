"""Statistics beside a policy: whose they are, what they say, and that none is passed over in silence."""

from __future__ import annotations

import json
import pickle
import zipfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.spaces import Box, Discrete
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import DummyVecEnv, VecNormalize

from nathlon.arena.entrance import enter_each, intact
from nathlon.arena.entrant import Entrant
from nathlon.arena.pool import Pool
from nathlon.policies.general.policy import GeneralPolicy
from nathlon.policies.sources.foreign import ForeignCard, observation_spec
from nathlon.policies.sources.normalisation import check_as_it_is, companions, statistics_of
from nathlon.policies.sources.sb3_file import was_normalised
from nathlon.policies.sources.vec_normalize import Statistics
from nathlon.selection.nightly.newcomers import newcomers
from nathlon.selection.nightly.watching import watch
from nathlon.sim.errors import InputError
from nathlon.sim.observation import ObservationSpec
from tests.support.games import player, refused, world_of


class Lights(gymnasium.Env[Any, Any]):
    """Three numbers in, one of three out."""

    observation_space = Box(0.0, 1.0, (3,), np.float32)
    action_space = Discrete(3)

    def reset(self, *, seed: int | None = None, options: Any = None) -> Any:
        return np.zeros(3, np.float32), {}

    def step(self, action: Any) -> Any:
        return np.full(3, 0.5, np.float32), 1.0, False, False, {}


class Trained:
    """Files that Stable-Baselines3 has written."""

    def __init__(self, folder: Path) -> None:
        (folder / "statistics").mkdir()
        self.observations = folder / "statistics" / "observations.pkl"
        self.rewards = folder / "statistics" / "rewards.pkl"
        self.normalised, self.plain = folder / "normalised.zip", folder / "plain.zip"
        environments = DummyVecEnv([Lights])
        arguments: dict[str, Any] = {"n_steps": 8, "batch_size": 8, "n_epochs": 1, "device": "cpu"}
        arguments["policy_kwargs"] = {"net_arch": [4]}
        wrapped = VecNormalize(environments)
        PPO("MlpPolicy", wrapped, **arguments).learn(8).save(self.normalised)
        wrapped.save(str(self.observations))
        VecNormalize(environments, norm_obs=False).save(str(self.rewards))
        PPO("MlpPolicy", environments, **arguments).learn(8).save(self.plain)


@pytest.fixture(scope="module")
def trained(tmp_path_factory: pytest.TempPathFactory) -> Trained:
    return Trained(tmp_path_factory.mktemp("trained"))


def lay(folder: Path, names: Sequence[str], statistics: bytes) -> None:
    """Files of these names: policies by an algorithm on policy that saw no normalisation, and statistics."""
    data = json.dumps({"policy_class": {"__module__": "stable_baselines3.common.policies"}})
    for name in names:
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        if path.suffix.lower() == ".zip":
            with zipfile.ZipFile(path, "w") as archive:
                archive.writestr("data", data)
        else:
            path.write_bytes(statistics)


OWN = [
    ("ppo_04096_steps.zip", "ppo_vecnormalize_4096_steps.pkl"),  # as CheckpointCallback names them
    ("rl_model_1000_steps.zip", "rl_model_1000_steps.pkl"),  # as RL Zoo does
    ("best_model.zip", "vecnormalize.pkl"),
    ("best_model.zip", "best_vec_normalize.pkl"),
    ("walker.zip", "walker_vecnormalize.pkl"),
    ("WALKER.ZIP", "vecnormalize.pkl"),
    ("walker.zip", "anything.pickle"),  # which says inside what it is
    ("CartPole-v1.zip", "CartPole-v1/vecnormalize.pkl"),
    ("checkpoints/walker_8_steps.zip", "vec_normalize.pkl"),
    ("final_model.zip", "run3_vecnormalize.pkl"),  # of nobody else who is there
]
STRANGE = [
    ("walker.onnx", "walker-VecNormalize.pkl", "with the statistics inside"),
    ("WALKER.ONNX", "VECNORMALIZE.PKL", "with the statistics inside"),
    ("walker.zip", "obs_rms.npz", "expected what VecNormalize.save writes"),
    ("walker.zip", "normalizer.json", "expected what VecNormalize.save writes"),
    ("ppo_8_steps.zip", "ppo_vecnormalize_4096_steps.pkl", "the statistics of another step"),
]
OTHERS = [
    ("first.zip", ["second.zip", "second_vecnormalize.pkl"]),
    ("first.ZIP", ["second.ZIP", "second_vecnormalize.pkl"]),
    ("ppo_8_steps.zip", ["sac_8_steps.zip", "sac_vecnormalize_8_steps.pkl"]),
    ("walker.zip", ["walker_replay_buffer.bin", "evaluations.npz", "args.json"]),
    ("b/walker.zip", ["walker.zip", "vecnormalize.pkl"]),
    ("walker.zip", ["another-run/vecnormalize.pkl", "another-run/model.zip"]),
    ("walker.safetensors", ["vecnormalize.pkl"]),
]


@pytest.mark.parametrize(("policy", "statistics"), OWN)
def test_statistics_belong_to_a_policy(
    tmp_path: Path, trained: Trained, policy: str, statistics: str
) -> None:
    lay(tmp_path, [policy, statistics], trained.observations.read_bytes())
    (tmp_path / "CartPole-v1").mkdir(exist_ok=True)
    (tmp_path / "CartPole-v1" / "args.yml").touch()
    assert companions(tmp_path / policy).statistics == tmp_path / statistics
    check_as_it_is(tmp_path / policy)


@pytest.mark.parametrize(("policy", "statistics", "message"), STRANGE)
def test_a_policy_is_refused_whose_statistics_cannot_be_applied(
    tmp_path: Path, trained: Trained, policy: str, statistics: str, message: str
) -> None:
    lay(tmp_path, [policy, statistics], trained.observations.read_bytes())
    with refused(f"{policy}: ", Path(statistics).name, message):
        check_as_it_is(tmp_path / policy)


@pytest.mark.parametrize(("policy", "others"), OTHERS)
def test_a_policy_is_not_refused_for_statistics_of_another(
    tmp_path: Path, trained: Trained, policy: str, others: list[str]
) -> None:
    lay(tmp_path, [policy, *others], trained.observations.read_bytes())
    check_as_it_is(tmp_path / policy)


def test_statistics_of_rewards_alone_do_no_harm(tmp_path: Path, trained: Trained) -> None:
    lay(tmp_path, ["walker.onnx", "walker-VecNormalize.pkl"], trained.rewards.read_bytes())
    check_as_it_is(tmp_path / "walker.onnx")
    assert Statistics.read(trained.rewards, trained.rewards.read_bytes()).by_key == {}


def test_own_statistics_come_before_those_of_the_folder(tmp_path: Path, trained: Trained) -> None:
    lay(tmp_path, ["a.zip", "b.zip", "vecnormalize.pkl"], trained.observations.read_bytes())
    lay(tmp_path, ["a_vecnormalize.pkl"], trained.rewards.read_bytes())
    assert statistics_of(tmp_path / "a.zip") == [tmp_path / "a_vecnormalize.pkl"]
    assert companions(tmp_path / "a.zip").statistics == tmp_path / "a_vecnormalize.pkl"
    assert companions(tmp_path / "b.zip").statistics == tmp_path / "vecnormalize.pkl", "who else's?"
    lay(tmp_path, ["c.zip"], b"")
    with refused("b.zip", "'vecnormalize.pkl' may be the statistics of several policies"):
        companions(tmp_path / "b.zip")


def test_a_file_shows_that_it_was_trained_with_statistics_that_are_gone(
    tmp_path: Path, trained: Trained
) -> None:
    assert was_normalised(trained.normalised)
    assert not was_normalised(trained.plain)
    alone = tmp_path / "alone.zip"
    alone.write_bytes(trained.normalised.read_bytes())
    with refused("alone.zip: was trained with VecNormalize", "'alone_vecnormalize.pkl' beside it"):
        check_as_it_is(alone)
    (tmp_path / "alone_vecnormalize.pkl").write_bytes(trained.rewards.read_bytes())
    check_as_it_is(alone)


class Bomb:
    """A pickle that does harm when it is opened."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __reduce__(self) -> Any:
        return Path.touch, (self.path,)


@pytest.mark.parametrize("cut", [None, 3, 40])
def test_nothing_is_unpickled(tmp_path: Path, trained: Trained, cut: int | None) -> None:
    harm = tmp_path / "harm"
    content = pickle.dumps([Bomb(harm), "VecNormalize"])
    lay(tmp_path, ["walker.zip", "walker_vecnormalize.pkl"], content[:cut])
    statistics = tmp_path / "walker_vecnormalize.pkl"
    assert companions(tmp_path / "walker.zip").statistics == statistics
    with refused("walker_vecnormalize.pkl", "expected what VecNormalize.save writes"):
        Statistics.read(statistics, statistics.read_bytes())
    assert not harm.exists()


def test_a_folder_of_files_that_are_added_is_looked_at_again(tmp_path: Path, trained: Trained) -> None:
    lay(tmp_path, ["walker.zip"], b"")
    assert companions(tmp_path / "walker.zip").statistics is None
    lay(tmp_path, ["vecnormalize.pkl"], trained.observations.read_bytes())
    assert companions(tmp_path / "walker.zip").statistics == tmp_path / "vecnormalize.pkl"


def test_a_selection_sets_it_aside_and_says_why(tmp_path: Path, trained: Trained, pool: Pool) -> None:
    name = world_of(tmp_path, "PettingZooWorld({'duel': envs['duel']})")
    folder = tmp_path / "watched"
    folder.mkdir()
    good = player(folder / "good.onnx", 3)
    player(folder / "other.onnx", 2)
    (folder / "other_vecnormalize.pkl").write_bytes(trained.observations.read_bytes())
    entrants, [aside] = newcomers(pool, watch([str(folder)]), "", "", {}, world=name)
    assert [entrant.source for entrant in entrants] == [good]
    assert "other.onnx: 'other_vecnormalize.pkl' says that observations were normalised" in aside.reason
    roles = tmp_path / "both.roles.toml"
    roles.write_text('[roles]\na = "watched/good.onnx"\nb = "watched/other.onnx"\n')
    chase = "PettingZooWorld({'d': envs['duel']}, roles={'a': ['left'], 'b': ['right']})"
    [answer] = enter_each(pool, [str(roles)], "", "", world_of(tmp_path, chase, "roles.py"))
    assert isinstance(answer, InputError)
    assert "other_vecnormalize.pkl" in str(answer)


def test_who_has_been_judged_stays_whatever_is_laid_beside_it(
    tmp_path: Path, trained: Trained, pool: Pool
) -> None:
    name = world_of(tmp_path, "PettingZooWorld({'duel': envs['duel']})")
    [entrant] = enter_each(pool, [player(tmp_path / "good.onnx", 3)], "", "", name)
    assert isinstance(entrant, Entrant)
    (tmp_path / "vecnormalize.pkl").write_bytes(trained.observations.read_bytes())
    assert intact(pool, [entrant]) == [True]


@pytest.mark.parametrize(("frames", "points"), [(4, 20), (4, 1), (7, 2)])
def test_stacked_frames_are_not_taken_for_course_points(tmp_path: Path, frames: int, points: int) -> None:
    size = frames * ObservationSpec(course_points=points).size
    with refused(
        f"takes {size} numbers", f"{frames} stacked frames of {points}", "expected a card that says"
    ):
        observation_spec(tmp_path / "mine.zip", "id", ForeignCard(), size)
    more = (size - ObservationSpec(course_points=1).size) // 9 + 1
    card = ForeignCard(observation=ObservationSpec(course_points=more))
    assert observation_spec(tmp_path / "mine.zip", "id", card, size).course_points == more


@pytest.mark.parametrize("points", [1, 2, 10, 20, 30, 40, 50, 60])
def test_sizes_that_are_no_stack_need_no_card(tmp_path: Path, points: int) -> None:
    size = ObservationSpec(course_points=points).size
    assert observation_spec(tmp_path / "mine.zip", "id", ForeignCard(), size).course_points == points


def test_a_policy_of_stacked_frames_is_refused_where_its_numbers_fit_by_chance(trained: Trained) -> None:
    from nathlon.policies.general import load_general

    policy = load_general(str(trained.plain))
    assert policy.observation_shape == (3,)
    stacked = GeneralPolicy(**(vars(policy) | {"observation_shape": (3, 1)}))
    with refused("was trained on observations of shape (3, 1), as of stacked frames"):
        stacked.check(Lights.observation_space, Lights.action_space)
    stacked.check(Box(0.0, 1.0, (3, 1), np.float32), Lights.action_space)
