"""The PettingZoo face: the library's own tests, and the race behind them."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import pytest
from pettingzoo.test import parallel_api_test, parallel_seed_test

from nathlon import sim
from nathlon.sim.camera_spec import CameraSpec
from nathlon.sim.episode import STUCK_S
from nathlon.sim.errors import InputError
from nathlon.sim.observation import ObservationSpec
from nathlon.sim.race_env import RaceEnv

SPEC = ObservationSpec(course_points=8)


def short_race() -> RaceEnv:
    return sim.parallel_env(scenario="slipstream_pass", observation=SPEC)


def full_throttle(env: RaceEnv) -> dict[str, np.ndarray]:
    return {agent: np.array([1.0, 0.0], np.float32) for agent in env.agents}


def test_keeps_the_parallel_api() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        parallel_api_test(short_race(), num_cycles=450)


def test_keeps_the_parallel_api_with_a_camera() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        spec = ObservationSpec(camera=CameraSpec(mount="chase"))
        parallel_api_test(sim.parallel_env(scenario="slipstream_pass", observation=spec), num_cycles=20)


def test_same_seed_gives_the_same_race() -> None:
    parallel_seed_test(short_race, num_cycles=60)


def test_other_seed_gives_another_start_and_no_seed_goes_on() -> None:
    env = short_race()
    first, _ = env.reset(seed=1)
    second, _ = env.reset()
    other, _ = env.reset(seed=2)
    again, _ = env.reset(seed=1)
    np.testing.assert_array_equal(first["car_0"], again["car_0"])
    assert not np.array_equal(first["car_0"], second["car_0"])
    assert not np.array_equal(first["car_0"], other["car_0"])


def test_default_race_has_eight_agents_who_see_sixty_course_points() -> None:
    env = sim.parallel_env()
    observations, infos = env.reset(seed=0)
    assert env.possible_agents == [f"car_{i}" for i in range(8)]
    assert env.observation_space("car_7").shape == (ObservationSpec(course_points=60).size,)
    assert all(env.observation_space(agent).contains(observations[agent]) for agent in env.agents)
    assert [infos[agent]["place"] for agent in env.agents] == [1, 2, 3, 4, 5, 6, 7, 8]


def test_reward_is_the_progress_in_metres() -> None:
    env = short_race()
    _, infos = env.reset(seed=3)
    start = infos["car_1"]["progress_m"]
    gathered = 0.0
    for _ in range(20):
        _, rewards, _, _, infos = env.step(full_throttle(env))
        gathered += rewards["car_1"]
    # On the long straight, so 2 s from 44 m/s at full throttle are at least 88 m.
    assert gathered == pytest.approx(infos["car_1"]["progress_m"] - start)
    assert gathered > 88.0


def test_no_reward_off_course() -> None:
    env = short_race()
    env.reset(seed=3)
    rewards, infos = {"car_0": 1.0}, {"car_0": {"off_course": False}}
    while not infos["car_0"]["off_course"]:
        _, rewards, _, _, infos = env.step({agent: np.array([1.0, 0.2], np.float32) for agent in env.agents})
    assert rewards["car_0"] == 0.0


def test_a_car_at_rest_is_terminated_as_stuck() -> None:
    env = sim.parallel_env(scenario="standing_start", observation=SPEC)
    env.reset(seed=0)
    steps = 0
    while "car_0" in env.agents:
        _, _, terminations, truncations, infos = env.step(
            {agent: np.zeros(2, np.float32) for agent in env.agents}
        )
        steps += 1
    # The time at rest is a sum, so it may pass the limit by rounding.
    assert steps in (round(STUCK_S * 10), round(STUCK_S * 10) + 1)
    assert all(terminations.values())
    assert not any(truncations.values())
    assert infos["car_3"]["ending"] == "stuck"


def test_finishing_terminates_and_the_clock_truncates(tmp_path: Path) -> None:
    path = tmp_path / "sprint.toml"
    path.write_text(
        """
        name = "sprint"
        description = "two cars on the straight; only the first can reach the finish"
        cars = 2
        finish_m = 1800.0
        time_s = 4.0
        [start]
        kind = "rolling"
        leader_m = [1700.0, 1700.0]
        gap_m = [200.0, 200.0]
        lateral_m = [0.0, 0.0]
        speed_m_s = [40.0, 40.0]
        """
    )
    env = sim.parallel_env(scenario=str(path), observation=SPEC)
    env.reset(seed=0)
    ended: dict[str, tuple[bool, bool, str, int, int]] = {}
    for step in range(1, 41):
        _, _, terminations, truncations, infos = env.step(full_throttle(env))
        for agent, info in infos.items():
            if info["ending"]:
                ended[agent] = (terminations[agent], truncations[agent], info["ending"], info["place"], step)
    # 100 m from 40 m/s with at most 6 m/s^2 take between 2.1 and 2.5 s.
    assert ended["car_0"][:4] == (True, False, "finished", 1)
    assert 21 <= ended["car_0"][4] <= 25
    assert ended["car_1"] == (False, True, "time_up", 2, 40)
    assert env.agents == []


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_refuses_an_action_that_is_not_finite(bad: float) -> None:
    env = short_race()
    env.reset(seed=0)
    actions = full_throttle(env)
    actions["car_1"][1] = bad
    with pytest.raises(ValueError, match="the action of car 1 is"):
        env.step(actions)


@pytest.mark.parametrize(
    ("field", "known"), [("circuit", "lindenring"), ("car", "gt3"), ("scenario", "time_trial")]
)
def test_unknown_names_list_the_known_ones(field: str, known: str) -> None:
    names = {field: "nowhere"}
    with pytest.raises(InputError, match=f"{field} 'nowhere' is unknown; expected one of .*{known}"):
        sim.parallel_env(**names)  # type: ignore[arg-type]
