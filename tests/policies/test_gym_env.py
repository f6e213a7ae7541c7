"""The single Gymnasium face: the checkers of Gymnasium and Stable-Baselines3, and the runs behind them."""

from __future__ import annotations

import subprocess
import sys
import warnings
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from stable_baselines3.common.env_checker import check_env as check_env_for_stable_baselines

import nathlon  # noqa: F401  # makes the environments known
from nathlon import sim
from nathlon.policies.driver import Driver
from nathlon.policies.environments.opponents import OpponentWrapper
from nathlon.policies.policy import Batch
from nathlon.sim.camera_spec import CameraSpec
from nathlon.sim.episode import Episodes
from nathlon.sim.errors import InputError
from nathlon.sim.observation import ObservationSpec
from nathlon.sim.race_env import RaceEnv

TIME_TRIAL, RACE = "nathlon/TimeTrial-v0", "nathlon/Race-v0"
SPEC = ObservationSpec(course_points=8)


class Steady:
    """Drives straight on with some throttle, and counts its steps."""

    observation_spec = ObservationSpec(course_points=1, cars_ahead=1, cars_behind=0)

    def __init__(self, throttle: float = 0.5) -> None:
        self.throttle = throttle
        self.memories: list[Batch] = []

    def initial_memory(self, n: int) -> Batch:
        """None driven yet."""
        return np.zeros((n, 1), np.float32)

    def act(self, observations: Batch, memory: Batch) -> tuple[Batch, Batch]:
        """The same for all."""
        self.memories.append(memory.copy())
        return np.tile(np.array([[self.throttle, 0.0]], np.float32), (len(observations), 1)), memory + 1


@pytest.mark.parametrize("version", [2, 3, 4])
def test_cars_have_a_reverse_gear_if_their_drivers_know_one(version: int) -> None:
    episodes = Episodes("lindenring", "gt3", "race:cars=3", races=2)
    spec = ObservationSpec(course_points=1, version=version)
    env = OpponentWrapper(episodes, [2], spec, [Steady(), Driver("lindenring", "gt3")])
    env.start([0, 1], map(np.random.default_rng, (1, 2)))
    own = version == 4
    assert episodes.world.state["has_reverse"].tolist() == [[False, True, own], [True, False, own]]
    env.seat([0], np.array([[1, 0]]))
    env.start([0], [np.random.default_rng(1)])
    assert episodes.world.state["has_reverse"].tolist() == [[True, False, own]] * 2


SMALL: dict[str, dict[str, Any]] = {
    TIME_TRIAL: {"observation": SPEC},
    RACE: {"observation": SPEC, "opponents": [Steady()]},
}
"""Arguments that make the environments fast."""
SEEING: dict[str, Any] = {"observation": ObservationSpec(camera=CameraSpec(width=40, height=36))}


@pytest.mark.parametrize(
    ("name", "arguments"), [(TIME_TRIAL, SMALL[TIME_TRIAL]), (RACE, SMALL[RACE]), (TIME_TRIAL, SEEING)]
)
def test_passes_the_checker_of_gymnasium(
    name: str, arguments: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        # Standardised observations have no honest bounds; the checker would rather see some.
        warnings.filterwarnings(
            "ignore", "(?s).*A Box observation space (minimum|maximum) value is -?infinity"
        )
        check_env(gymnasium.make(name, disable_env_checker=True, **arguments).unwrapped)


@pytest.mark.parametrize(("name", "arguments"), [(TIME_TRIAL, {}), (RACE, {}), (RACE, SEEING)])
def test_passes_the_checker_of_stable_baselines(name: str, arguments: dict[str, Any]) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env_for_stable_baselines(gymnasium.make(name, **arguments).unwrapped)


@pytest.mark.parametrize("name", [TIME_TRIAL, RACE])
def test_same_seed_gives_the_same_run(name: str) -> None:
    runs = []
    for _ in range(2):
        env = gymnasium.make(name)
        env.action_space.seed(5)
        rows = [env.reset(seed=5)[0]]
        rows += [env.step(env.action_space.sample())[0] for _ in range(30)]
        runs.append(np.stack(rows))
    np.testing.assert_array_equal(runs[0], runs[1])
    assert not np.array_equal(gymnasium.make(name).reset(seed=6)[0], runs[0][0])


def test_with_a_camera_it_gives_a_picture_beside_numbers() -> None:
    env = gymnasium.make(RACE, **SEEING)
    first, _ = env.reset(seed=3)
    assert {name: (part.shape, str(part.dtype)) for name, part in first.items()} == {
        "picture": ((36, 40, 3), "uint8"),
        "sensors": ((16,), "float32"),
    }
    kept = first["picture"].copy()
    then, *_ = env.step(np.array([1.0, 0.3], np.float32))
    assert (then["picture"] != kept).any()
    assert (first["picture"] == kept).all()
    again, _ = env.reset(seed=3)
    assert (again["picture"] == kept).all()


def test_a_driver_goes_round_until_the_time_is_up() -> None:
    driver = Driver("lindenring", "gt3")
    env = gymnasium.make(TIME_TRIAL, observation=driver.observation_spec)
    seen, info = env.reset(seed=1)
    start, memory = info["progress_m"], driver.initial_memory(1)
    steps, gathered, truncated, terminated = 0, 0.0, False, False
    while not (truncated or terminated):
        action, memory = driver.act(seen[None], memory)
        seen, reward, terminated, truncated, info = env.step(action[0])
        steps, gathered = steps + 1, gathered + float(reward)
    assert (steps, terminated, info["ending"]) == (1500, False, "time_up")
    assert info["progress_m"] - start > 5000.0
    assert gathered == pytest.approx(info["progress_m"] - start)


def test_drives_as_the_parallel_environment_does() -> None:
    single = gymnasium.make(TIME_TRIAL, scenario="time_trial")
    parallel: RaceEnv = sim.parallel_env(scenario="time_trial")
    seen, _ = single.reset(seed=4)
    seen_too, _ = parallel.reset(seed=4)
    action = np.array([0.7, 0.05], np.float32)
    for _ in range(10):
        np.testing.assert_array_equal(seen, seen_too["car_0"])
        seen, reward, _, _, _ = single.step(action)
        seen_too, rewards, _, _, _ = parallel.step({"car_0": action})
        assert reward == rewards["car_0"]


def test_opponents_drive_the_other_cars_as_they_do_in_the_parallel_environment() -> None:
    single = gymnasium.make(RACE, scenario="race", opponents=[Steady(0.4), Steady(0.9)], place=2)
    parallel = sim.parallel_env(scenario="race")
    single.reset(seed=7)
    parallel.reset(seed=7)
    throttles = [0.4, 1.0, 0.9, 0.4, 0.9, 0.4, 0.9, 0.4]
    for _ in range(40):
        seen, reward, _, _, info = single.step(np.array([1.0, 0.0], np.float32))
        seen_too, rewards, _, _, infos = parallel.step(
            {f"car_{i}": np.array([throttle, 0.0], np.float32) for i, throttle in enumerate(throttles)}
        )
    np.testing.assert_array_equal(seen, seen_too["car_1"])
    assert (reward, info) == (rewards["car_1"], infos["car_1"])


def test_the_agent_starts_last_unless_told_otherwise() -> None:
    for place, found in ((None, 8), (3, 3)):
        env = gymnasium.make(RACE, scenario="race", opponents=[Steady()], place=place)
        assert env.reset(seed=0)[1]["place"] == found


def test_opponents_forget_at_a_new_start() -> None:
    opponent = Steady()
    env = gymnasium.make(RACE, opponents=[opponent], observation=SPEC).unwrapped
    for _ in range(2):
        env.reset(seed=0)
        for _ in range(3):
            env.step(np.zeros(2, np.float32))
    assert [memory.ravel().tolist() for memory in opponent.memories] == [[k] * 3 for k in (0, 1, 2, 0, 1, 2)]


def scenario_file(folder: Path, **settings: str) -> str:
    """Two cars on a straight, with further settings, as the path of a new file."""
    lines = [f"{name} = {value}" for name, value in settings.items()]
    path = folder / f"scenario-{len(list(folder.iterdir()))}.toml"
    text = """
        name = "test"
        description = "along the straight"
        cars = 2
        time_s = 20.0
        {}
        [start]
        kind = "rolling"
        leader_m = [30.0, 40.0]
        gap_m = [13.0, 15.0]
        lateral_m = [1.0, 3.0]
        speed_m_s = [44.0, 45.0]
        """
    path.write_text(text.format("\n".join(lines)))
    return str(path)


@pytest.mark.parametrize("late", ["0.2", "[0.05, 0.2]"])
def test_a_delayed_agent_sees_what_an_alert_one_saw_before(tmp_path: Path, late: str) -> None:
    plain = scenario_file(tmp_path, rules='"free"')
    delayed = scenario_file(tmp_path, perception_delay_s=late)
    opponent = [Steady()]
    seen = {}
    for scenario in (plain, delayed):
        env = gymnasium.make(RACE, scenario=scenario, opponents=opponent, observation=SPEC)
        action = np.random.default_rng(0)
        rows = [env.reset(seed=2)[0]]
        rows += [env.step(action.uniform(-1.0, 1.0, 2) * [1.0, 0.05])[0] for _ in range(20)]
        seen[scenario] = np.array(rows)
    alert = seen[plain]
    np.testing.assert_allclose(seen[delayed][2:], alert[:-2], atol=1e-6)
    np.testing.assert_array_equal(seen[delayed][:2], alert[[0, 0]])


def test_a_higher_action_rate_makes_shorter_steps(tmp_path: Path) -> None:
    ground = {}
    for rate, steps in (("10", 20), ("20", 40)):
        env = gymnasium.make(
            RACE, scenario=scenario_file(tmp_path, action_hz=rate), opponents=[Steady()], observation=SPEC
        )
        _, info = env.reset(seed=2)
        start, gathered = info["progress_m"], 0.0
        for _ in range(steps):
            _, reward, _, _, info = env.step(np.array([0.8, 0.0], np.float32))
            gathered += float(reward)
        assert env.unwrapped.metadata["render_fps"] == float(rate)
        ground[rate] = info["progress_m"] - start
        assert gathered == pytest.approx(ground[rate])
    assert ground["20"] == pytest.approx(ground["10"], abs=0.01)


def test_refuses_cars_that_act_at_different_rates(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="action_hz differs between cars, expected one rate"):
        gymnasium.make(RACE, scenario=scenario_file(tmp_path, action_hz="[10, 20]"))


def test_refuses_an_action_that_is_not_finite() -> None:
    env = gymnasium.make(TIME_TRIAL)
    env.reset(seed=0)
    with pytest.raises(ValueError, match="expected finite numbers"):
        env.unwrapped.step(np.array([np.nan, 0.0], np.float32))


def test_refuses_unknown_names_and_empty_seats() -> None:
    with pytest.raises(InputError, match=r"circuit 'nowhere' is unknown; expected one of .*lindenring"):
        gymnasium.make(TIME_TRIAL, circuit="nowhere")
    with pytest.raises(InputError, match="expected someone for 7 of the 8 cars of scenario 'race'"):
        gymnasium.make(TIME_TRIAL, scenario="race")
    with pytest.raises(InputError, match="place is 9, expected 1 to 8 in scenario 'race'"):
        gymnasium.make(RACE, scenario="race", opponents=[Steady()], place=9)
    with pytest.raises(InputError, match="unknown setting 'courage'"):
        gymnasium.make(RACE, opponents=["driver:courage=1"])


def test_importing_the_package_loads_neither_compiler_nor_networks() -> None:
    script = (
        "import sys, nathlon; print(sorted({'numba', 'torch', 'pettingzoo', 'pygame'} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
