"""The vector Gymnasium face: it goes as the single environments do, many at once."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.wrappers.vector import RecordEpisodeStatistics

import nathlon  # noqa: F401  # makes the environments known
from nathlon.policies.environments.race_vector_env import RaceVectorEnv
from nathlon.policies.policy import Batch
from nathlon.sim.observation import ObservationSpec
from tests.policies.test_gym_env import RACE, SEEING, SPEC, TIME_TRIAL, Steady, scenario_file

SHORT = 12
"""Steps of the short scenario."""


@pytest.fixture
def short(tmp_path: Path) -> str:
    path = tmp_path / "short.toml"
    text = Path(scenario_file(tmp_path)).read_text()
    path.write_text(text.replace("time_s = 20.0", f"time_s = {SHORT / 10}"))
    return str(path)


def make(name: str = RACE, num_envs: int = 3, **arguments: Any) -> VectorEnv:
    return gymnasium.make_vec(name, num_envs, "vector_entry_point", observation=SPEC, **arguments)


def actions(steps: int, races: int) -> np.ndarray:
    return np.random.default_rng(1).uniform(-0.5, 1.0, (steps, races, 2)).astype(np.float32) * [1.0, 0.1]


def test_is_what_make_vec_makes_and_follows_its_spaces() -> None:
    for name in (TIME_TRIAL, RACE):
        env = gymnasium.make_vec(name, num_envs=4)
        assert isinstance(env, RaceVectorEnv)
        assert env.metadata["autoreset_mode"] is AutoresetMode.SAME_STEP
        observations, _ = env.reset(seed=0)
        assert env.observation_space.contains(observations)
        assert observations.shape == (4, ObservationSpec().size)
        _, reward, terminated, truncated, _ = env.step(env.action_space.sample())
        assert [part.shape for part in (reward, terminated, truncated)] == [(4,)] * 3


def test_with_a_camera_it_goes_as_the_single_environment_does(short: str) -> None:
    env = gymnasium.make_vec(RACE, 2, "vector_entry_point", scenario=short, **SEEING)
    single = gymnasium.make(RACE, scenario=short, **SEEING)
    seen, _ = env.reset(seed=7)
    alone, _ = single.reset(seed=7)
    for action in actions(SHORT, 2):
        assert env.observation_space.contains(seen)
        assert all((seen[name][0] == alone[name]).all() for name in ("picture", "sensors"))
        seen, _, _, _, infos = env.step(action)
        alone, *_ = single.step(action[0])
    # It has begun again, and what was seen last is among the infos.
    assert all((infos["final_obs"][0][name] == alone[name]).all() for name in ("picture", "sensors"))
    assert (seen["picture"][0] != alone["picture"]).any()


class Tiring(Steady):
    """Gives less throttle with every step, so that it matters what it remembers."""

    def act(self, observations: Batch, memory: Batch) -> tuple[Batch, Batch]:
        """By the steps driven so far."""
        actions, after = super().act(observations, memory)
        return actions / after, after


def test_goes_as_single_environments_do_through_their_ends(tmp_path: Path) -> None:
    arguments: dict[str, Any] = {
        "scenario": scenario_file(tmp_path, finish_m="80.0"),
        "opponents": [Tiring(1.0)],
        "observation": SPEC,
    }
    batched = gymnasium.make_vec(RACE, 4, "vector_entry_point", **arguments)
    one_by_one = gymnasium.make_vec(
        RACE, 4, "sync", vector_kwargs={"autoreset_mode": "SameStep"}, **arguments
    )
    seen, infos = batched.reset(seed=11)
    seen_too, infos_too = one_by_one.reset(seed=11)
    ends = np.zeros((50, 4), np.bool_)
    for step, action in enumerate(actions(50, 4)):
        np.testing.assert_array_equal(seen, seen_too)
        for name in ("place", "progress_m", "off_course", "ending"):
            np.testing.assert_array_equal(infos[name], infos_too[name])
        seen, *rest, infos = batched.step(action)
        seen_too, *rest_too, infos_too = one_by_one.step(action)
        for part, part_too in zip(rest, rest_too, strict=True):
            np.testing.assert_array_equal(part, part_too)
        assert ("final_obs" in infos) == ("final_obs" in infos_too)
        if "final_obs" in infos:
            ends[step] = infos["_final_obs"]
            np.testing.assert_array_equal(infos["_final_obs"], infos_too["_final_obs"])
            np.testing.assert_array_equal(infos["_final_info"], infos_too["_final_info"])
            for final, final_too in zip(infos["final_obs"], infos_too["final_obs"], strict=True):
                np.testing.assert_array_equal(final, final_too)
            final_info, final_info_too = infos["final_info"], infos_too["final_info"]
            for name in ("progress_m", "place", "ending"):
                np.testing.assert_array_equal(final_info[f"_{name}"], final_info_too[f"_{name}"])
                np.testing.assert_array_equal(final_info[name][ends[step]], final_info_too[name][ends[step]])
    assert (ends.sum(axis=0) >= 3).all()
    assert (ends.any(axis=1) & ~ends.all(axis=1)).any()


@pytest.mark.parametrize("threads", [1, 2])
def test_a_race_does_not_depend_on_its_neighbours_nor_on_threads(short: str, threads: int) -> None:
    alone = make(num_envs=1, scenario=short, opponents=[Steady()])
    many = make(num_envs=5, scenario=short, opponents=[Steady()], threads=threads)
    alone.reset(seed=3)
    many.reset(seed=3)
    for action in actions(2 * SHORT, 5):
        first = alone.step(action[:1])
        both = many.step(action)
        for one, other in zip(first[:4], both[:4], strict=True):
            np.testing.assert_array_equal(one[0], other[0])


def test_each_race_may_have_its_own_seed_and_goes_on_without_one() -> None:
    env = make(TIME_TRIAL)
    assert isinstance(env, RaceVectorEnv)
    seeded, _ = env.reset(seed=[5, 6, 5])
    np.testing.assert_array_equal(seeded[0], seeded[2])
    assert not np.array_equal(seeded[0], seeded[1])
    further, _ = env.reset()
    assert not np.array_equal(seeded[0], further[0])
    np.testing.assert_array_equal(further[0], further[2])
    np.testing.assert_array_equal(env.reset(seed=5)[0][:2], seeded[:2])


def test_a_time_that_was_not_driven_is_masked() -> None:
    env = make(TIME_TRIAL)
    _, infos = env.reset(seed=0)
    assert np.isnan(infos["best_lap_s"]).all()
    assert not infos["_best_lap_s"].any()
    assert infos["_progress_m"].all()
    assert infos["sectors_s"].shape == (3, 3)


def test_opponents_take_turns_from_race_to_race() -> None:
    env = make(num_envs=2, scenario="race", opponents=[Steady(0.3), Steady(1.0)], place=3)
    assert isinstance(env, RaceVectorEnv)
    env.reset(seed=0)
    env.step(np.zeros((2, 2), np.float32))
    throttle = np.round(env._episodes.world.state["throttle"], 6)
    assert throttle.tolist() == [
        [0.3, 1.0, 0.0, 0.3, 1.0, 0.3, 1.0, 0.3],
        [1.0, 0.3, 0.0, 1.0, 0.3, 1.0, 0.3, 1.0],
    ]


def test_episode_statistics_count_each_episode(short: str) -> None:
    env = RecordEpisodeStatistics(make(scenario=short, opponents=[Steady()]))
    env.reset(seed=0)
    lengths = []
    for action in actions(3 * SHORT, 3):
        *_, infos = env.step(action)
        if "episode" in infos:
            lengths.append(infos["episode"]["l"].tolist())
    assert lengths == [[SHORT] * 3] * 3


def test_refuses_an_action_that_is_not_finite() -> None:
    env = make(TIME_TRIAL)
    env.reset(seed=0)
    bad = np.zeros((3, 2), np.float32)
    bad[1, 1] = np.inf
    with pytest.raises(ValueError, match=r"race 1: the action of car 0 is .* expected finite numbers"):
        env.step(bad)
