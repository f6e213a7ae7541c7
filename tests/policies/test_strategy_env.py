"""Stops as an environment: Gymnasium's checker, what laps and stops take, and the planner in it."""

from __future__ import annotations

import warnings
from pathlib import Path
from statistics import fmean
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import nathlon  # noqa: F401  # makes the environments known
from nathlon.policies.environments.lap_race import FOLLOWS_S, GRID_S, OUT_S, LapRace
from nathlon.policies.environments.strategy_env import StrategyEnv
from nathlon.sim.errors import InputError
from nathlon.sim.rules import PitParameters
from nathlon.sim.service import Service
from tests.policies.test_stint_planner import MODEL, SLOWER_S, USED_KG

PIT = PitParameters(8.0, 2.5, False)


def race(*pace_s: float, laps: int = 3) -> LapRace:
    return LapRace(MODEL, laps, PIT, 80.0, pace_s, np.random.default_rng(1), noise_s=0.0)


def test_a_lap_and_a_stop_take_what_the_model_says() -> None:
    alone = race(0.0)
    alone.fit(0, Service("racing-soft", 20.0))
    assert alone.drive([None])[0] == pytest.approx(100.0 + 0.03 * 20.0)
    stopped = alone.drive([Service("racing-hard", 30.0)])[0]
    assert stopped == pytest.approx(100.0 + SLOWER_S + 0.03 * 16.0 + 12.0 + 8.0 + (30.0 - 12.0) / 2.5)
    assert alone.compounds == ["racing-hard"]
    assert alone.drive([Service("racing-soft", 30.0)])[0] == pytest.approx(102.0 + 0.03 * 30.0)
    assert alone.stops.tolist() == [1]


def test_a_car_that_is_a_little_faster_stays_behind_and_one_that_is_much_faster_passes() -> None:
    close, clear = race(0.0, -0.4), race(0.0, -2.0)
    close.drive([None, None])
    assert close.time_s[1] - close.time_s[0] == pytest.approx(FOLLOWS_S)
    clear.drive([None, None])
    assert clear.time_s[1] - clear.time_s[0] == pytest.approx(GRID_S - 2.0)


def test_a_car_without_fuel_is_out() -> None:
    dry = race(0.0)
    dry.fit(0, Service("racing-soft", USED_KG + 1.0))
    dry.drive([None])
    assert dry.drive([None])[0] == OUT_S
    assert dry.out.all()


def test_the_checker_of_gymnasium_finds_nothing() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        env = gymnasium.make("nathlon/Strategy-v0", laps=5, cars=3)
        check_env(env.unwrapped, skip_render_check=True)


def test_the_planner_stops_and_gains_by_it() -> None:
    env = StrategyEnv()
    returns, places = {}, {}
    for name in ("planner", "never"):
        totals, ended = [], []
        for seed in range(5):
            env.reset(seed=seed)
            total, over, facts = 0.0, False, dict[str, Any]()
            while not over:
                action = env.planned() if name == "planner" else 0
                _, reward, over, _, facts = env.step(np.int64(action))
                total += reward
            assert bool(facts["stops"]) == (name == "planner")
            totals.append(total)
            ended.append(facts["place"])
        returns[name], places[name] = fmean(totals), fmean(ended)
    assert returns["planner"] > returns["never"] + 20.0
    assert places["planner"] < places["never"]


def test_a_file_without_a_planner_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "plain.toml"
    path.write_text('name = "plain"\n[[part]]\npolicy = "driver:pace=0.9"\n', "utf-8")
    with pytest.raises(InputError, match=r"plain.toml: field planner is missing, expected a composite as"):
        StrategyEnv(str(path))
