"""A coach's findings as starts of training races."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from nathlon.policies.training.coached import (
    EACH,
    JITTER_M,
    JITTER_M_S,
    SHARE,
    Coached,
    CoachedStart,
    read_coach,
)
from nathlon.policies.training.config import TrainingConfig, read_config
from nathlon.policies.training.pairs import Pair
from nathlon.policies.training.rollout import Rollout
from nathlon.sim.episode import Episodes
from tests.support.command_line import nathlon as command
from tests.support.command_line import refused
from tests.support.refusals import refusal
from tests.support.trainings import TOML

PLACE = "lindenring", "gt3"
STARTS = [
    {"section": name, "lost_s": lost, "progress_m": at, "lateral_m": 2.0, "heading_rad": 0.05}
    | {"speed_m_s": speed, "side_speed_m_s": 0.2, "yaw_rate_rad_s": 0.01}
    for name, lost, at, speed in (("Haarnadel", 0.3, 2150.0, 60.0), ("Kehre", 0.1, 3970.0, 65.0))
]


def facts(path: Path, **other: Any) -> Path:
    found = {"format": 1, "raced": {"circuit": "lindenring", "car": "gt3", "match": "0"}, "starts": STARTS}
    path.write_text(json.dumps(found | {"sections": []} | other))
    return path


def config(tmp_path: Path, races: int, coached: tuple[CoachedStart, ...]) -> TrainingConfig:
    path = tmp_path / "run.toml"
    path.write_text(TOML)
    read = read_config(path)
    alone = read.rollouts[0].model_copy(update={"races": races})
    return read.model_copy(update={"rollouts": (alone, read.rollouts[1]), "coached": coached})


def test_moments_are_those_that_the_coach_has_found(tmp_path: Path) -> None:
    starts = read_coach(facts(tmp_path / "coach.json"), *PLACE)
    coached = Coached(Episodes(*PLACE, "1v0", 2), starts, np.random.default_rng(0))
    assert len(coached) == 2 * EACH
    rng = np.random.default_rng(1)
    cars = np.array([coached.draw(rng).state[0] for _ in range(400)])
    first = np.abs(cars["progress"] - 2150.0) <= JITTER_M + 1e-6
    second = np.abs(cars["progress"] - 3970.0) <= JITTER_M + 1e-6
    assert (first ^ second).all()
    # Three quarters of the loss are before the first, of 400 draws 300 within four deviations.
    assert 265 < first.sum() < 335
    assert np.abs(cars["velocity_x"][first] - 60.0).max() <= JITTER_M_S + 0.05
    np.testing.assert_allclose(cars["heading_error"], 0.05, atol=1e-3)
    np.testing.assert_allclose(cars["yaw_rate"], 0.01)
    assert len(np.unique(cars["velocity_x"])) > EACH, "no two begin alike"


def test_a_fifth_of_the_races_of_one_car_begin_there(tmp_path: Path) -> None:
    coached = read_coach(facts(tmp_path / "coach.json"), *PLACE)
    races = 500
    settings = config(tmp_path, races, coached)
    places = [
        Rollout(settings, rollouts, Pair(*PLACE), np.random.default_rng(3)).episodes.world.state["progress"][
            :, 0
        ]
        for rollouts in settings.rollouts
    ]
    alone, grid = (
        np.isclose(np.abs(at[:, None] - [2150.0, 3970.0]).min(axis=1), 0.0, atol=JITTER_M + 1e-6)
        for at in places
    )
    # 100 within four deviations.
    assert abs(alone.sum() - SHARE * races) < 36
    assert not grid.any()


def test_what_is_no_coach_s_file_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "coach.json"
    with refusal(facts(path), "circuit is 'lindenring', expected 'porto-sereno' as in the training"):
        read_coach(path, "porto-sereno", "gt3")
    with refusal(facts(path, starts=[]), "starts is empty"):
        read_coach(path, *PLACE)
    with refusal(facts(path, starts=[STARTS[0] | {"speed_m_s": 1e9}]), r"field starts.0.speed_m_s is 1"):
        read_coach(path, *PLACE)
    path.write_text("{")
    with refusal(path, "."):
        read_coach(path, *PLACE)


def test_a_run_keeps_what_the_coach_has_found(tmp_path: Path) -> None:
    (tmp_path / "run.toml").write_text(TOML)
    found = facts(tmp_path / "coach.json")
    done = command("train", "run.toml", "--out", "out", "--coach", found, "--threads", "1", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    kept = json.loads((tmp_path / "out" / "run.json").read_text())["config"]["coached"]
    assert [start["section"] for start in kept] == ["Haarnadel", "Kehre"]
    refused(
        command("train", "--resume", "--out", "out", "--coach", found, cwd=tmp_path),
        "--from, --coach: expected for a new run",
    )
    (tmp_path / "many.toml").write_text(TOML.replace('"1v0"', '"1v1"'))
    refused(
        command("train", "many.toml", "--out", "other", "--coach", found, cwd=tmp_path),
        "no rollouts of the configuration have one car",
    )
