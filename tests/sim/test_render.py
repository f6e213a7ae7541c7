"""Rendering: pictures that show what is where, in every mode and face."""

from __future__ import annotations

import subprocess
import sys

import gymnasium
import numpy as np
import pytest
from numpy.typing import NDArray

import nathlon  # noqa: F401  # makes the environments known
from nathlon import sim
from nathlon.sim.errors import InputError
from nathlon.sim.observation import ObservationSpec
from nathlon.sim.race_env import RaceEnv
from tests.policies.test_gym_env import RACE, SPEC, TIME_TRIAL, Steady

Picture = NDArray[np.uint8]


def race(scenario: str = "race", mode: str = "rgb_array") -> RaceEnv:
    env = sim.parallel_env(scenario=scenario, observation=ObservationSpec(course_points=1), render_mode=mode)
    env.reset(seed=1)
    return env


def picture_of(env: RaceEnv) -> Picture:
    picture = env.render()
    assert picture is not None
    return picture


def blob(picture: Picture, colour: tuple[int, int, int]) -> NDArray[np.float64]:
    """Middle of the scene's pixels in a colour, x right, y down; the panels are left out."""
    scene = picture[200:400].astype(int)
    rows, columns = np.nonzero(np.abs(scene - colour).max(axis=2) < 12)
    assert len(rows) > 20
    return np.array([columns.mean(), rows.mean() + 200])


def test_a_picture_shows_the_cars_where_they_are() -> None:
    from nathlon.sim.render.screen import COLOURS, SIZE, WIDTH_M

    env = race()
    picture = picture_of(env)
    assert picture.shape == (SIZE[1], SIZE[0], 3)
    assert picture.dtype == np.uint8
    cars = env._episodes.world.state[0]
    scale = SIZE[0] / WIDTH_M
    leader = np.array([cars["x"][0], cars["y"][0]])
    # At rest the camera looks straight down on the leader.
    np.testing.assert_allclose(blob(picture, COLOURS[0]), [400, 300], atol=3)
    for car in (1, 2, 3):
        east, north = np.array([cars["x"][car], cars["y"][car]]) - leader
        found = blob(picture, COLOURS[car]) - [400, 300]
        np.testing.assert_allclose(found, [east * scale, -north * scale], atol=3)


def test_the_same_race_gives_the_same_picture_and_another_another() -> None:
    first, again = picture_of(race()), picture_of(race())
    np.testing.assert_array_equal(first, again)
    env = race()
    env.step({agent: np.array([1.0, 0.0], np.float32) for agent in env.agents})
    assert not np.array_equal(picture_of(env), first)


def test_looking_changes_nothing() -> None:
    seen = []
    for mode in (None, "rgb_array"):
        env = sim.parallel_env(scenario="slipstream_pass", render_mode=mode)
        env.reset(seed=4)
        for _ in range(5):
            observations, *_ = env.step({agent: np.array([1.0, 0.01], np.float32) for agent in env.agents})
            env.render()
        seen.append(observations["car_1"])
    np.testing.assert_array_equal(seen[0], seen[1])


def test_single_environments_follow_the_agent_and_colour_by_entrant() -> None:
    from nathlon.sim.render.screen import COLOURS

    env = gymnasium.make(
        RACE, scenario="race", opponents=[Steady()], place=5, observation=SPEC, render_mode="rgb_array"
    )
    env.reset(seed=1)
    picture = env.render()
    assert isinstance(picture, np.ndarray)
    # The opponents' name comes first in starting order, the agent's second.
    np.testing.assert_allclose(blob(picture, COLOURS[1]), [400, 300], atol=3)


@pytest.mark.parametrize("circuit", ["porto-sereno", "grandes-landes"])
def test_every_place_of_a_circuit_can_be_drawn(circuit: str) -> None:
    env = gymnasium.make(TIME_TRIAL, circuit=circuit, observation=SPEC, render_mode="rgb_array")
    for seed in range(6):
        env.reset(seed=seed)
        picture = env.render()
        assert isinstance(picture, np.ndarray)
        assert len(np.unique(picture[200:400].reshape(-1, 3), axis=0)) > 30


def test_a_window_shows_the_steps_by_itself(monkeypatch: pytest.MonkeyPatch) -> None:
    import pygame

    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    env = race("slipstream_pass", "human")
    window = pygame.display.get_surface()
    assert window is not None
    before = pygame.surfarray.array3d(window)
    env.step({agent: np.array([1.0, 0.0], np.float32) for agent in env.agents})
    assert before.any()
    assert not np.array_equal(before, pygame.surfarray.array3d(window))
    assert env.render() is None
    env.close()
    assert not pygame.display.get_init()


def test_a_window_needs_a_display(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SDL_VIDEODRIVER", "x11")
    monkeypatch.setenv("DISPLAY", ":nowhere")
    with pytest.raises(InputError, match="render_mode 'human' needs a display and found none"):
        race(mode="human")


def test_refuses_an_unknown_mode() -> None:
    with pytest.raises(InputError, match="render_mode is 'ansi', expected None, 'human' or 'rgb_array'"):
        race(mode="ansi")


def test_without_a_mode_nothing_is_shown_nor_loaded() -> None:
    script = (
        "import sys, nathlon.sim as sim; env = sim.parallel_env(scenario='time_trial'); env.reset(seed=0);"
        "print(env.render(), 'pygame' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "None False"
