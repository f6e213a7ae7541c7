"""The Gymnasium face: the checkers of Gymnasium and Stable-Baselines3, and the run behind them."""

from __future__ import annotations

import subprocess
import sys
import warnings

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from stable_baselines3.common.env_checker import check_env as check_env_for_stable_baselines

import sim
from policies.driver import Driver
from sim.errors import InputError
from sim.race_env import RaceEnv

ENV = "nathlon/TimeTrial-v0"


def test_passes_the_checker_of_gymnasium() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        # Standardised observations have no honest bounds; the checker would rather see some.
        warnings.filterwarnings(
            "ignore", "(?s).*A Box observation space (minimum|maximum) value is -?infinity"
        )
        check_env(gymnasium.make(ENV, disable_env_checker=True).unwrapped)


def test_passes_the_checker_of_stable_baselines() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env_for_stable_baselines(gymnasium.make(ENV).unwrapped)


def test_same_seed_gives_the_same_run() -> None:
    runs = []
    for _ in range(2):
        env = gymnasium.make(ENV)
        env.action_space.seed(5)
        rows = [env.reset(seed=5)[0]]
        rows += [env.step(env.action_space.sample())[0] for _ in range(30)]
        runs.append(np.stack(rows))
    np.testing.assert_array_equal(runs[0], runs[1])
    assert not np.array_equal(gymnasium.make(ENV).reset(seed=6)[0], runs[0][0])


def test_a_driver_goes_round_until_the_time_is_up() -> None:
    driver = Driver("lindenring", "gt3")
    env = gymnasium.make(ENV, observation=driver.observation_spec)
    seen, info = env.reset(seed=1)
    start, memory = info["progress_m"], driver.initial_memory(1)
    steps, gathered, truncated, terminated = 0, 0.0, False, False
    while not (truncated or terminated):
        action, memory = driver.act(seen[None], memory)
        seen, reward, terminated, truncated, info = env.step(action[0])
        steps, gathered = steps + 1, gathered + float(reward)
    assert (steps, terminated, info["ending"]) == (1500, False, "time_up")
    assert info["laps"] >= 1
    assert gathered == pytest.approx(info["progress_m"] - start)


def test_drives_as_the_parallel_environment_does() -> None:
    single = gymnasium.make(ENV, scenario="time_trial")
    parallel: RaceEnv = sim.parallel_env(scenario="time_trial")
    seen, _ = single.reset(seed=4)
    seen_too, _ = parallel.reset(seed=4)
    action = np.array([0.7, 0.05], np.float32)
    for _ in range(10):
        np.testing.assert_array_equal(seen, seen_too["car_0"])
        seen, reward, _, _, _ = single.step(action)
        seen_too, rewards, _, _, _ = parallel.step({"car_0": action})
        assert reward == rewards["car_0"]


def test_refuses_an_action_that_is_not_finite() -> None:
    env = gymnasium.make(ENV)
    env.reset(seed=0)
    with pytest.raises(ValueError, match="expected finite numbers"):
        env.unwrapped.step(np.array([np.nan, 0.0], np.float32))


def test_refuses_unknown_names_and_scenarios_for_many() -> None:
    with pytest.raises(InputError, match="circuit 'nowhere' is unknown; expected one of lindenring"):
        gymnasium.make(ENV, circuit="nowhere")
    with pytest.raises(InputError, match="scenario 'race' has 8 cars, expected one car alone"):
        gymnasium.make(ENV, scenario="race")


def test_importing_the_package_loads_neither_compiler_nor_networks() -> None:
    script = "import sys, sim; print(sorted({'numba', 'torch', 'pettingzoo'} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
