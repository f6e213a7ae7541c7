"""Training runs: what they leave, going on after a stop, ends and cuts of episodes."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest

from policies.checkpoint import load_checkpoint
from policies.training.config import Rollouts, TrainingConfig, read_config
from policies.training.rollout import Rollout
from policies.training.trainer import CURVE_FILE, Status, Trainer
from sim.errors import InputError

SMALL = TrainingConfig.model_validate(
    {
        "circuit": "lindenring",
        "car": "gt3",
        "updates": 8,
        "updates_per_step": 2,
        "warm_up": 60,
        "replay": 500,
        "checkpoint_every": 4,
        "rollouts": [
            {"scenario": "1v0", "races": 3, "learners": 1},
            {"scenario": "1v3", "races": 1, "learners": 2, "opponents": ["driver:pace=0.9"]},
        ],
        "observation": {"course_points": 3, "cars_ahead": 1, "cars_behind": 1},
        "qrsac": {"hidden": [8, 8], "quantiles": 4, "batch": 16, "n_step": 3},
    }
)


def train(trainer: Trainer) -> list[Status]:
    seen: list[Status] = []
    trainer.run(seen.append)
    return seen


def test_a_run_leaves_checkpoints_that_drive_and_a_curve(tmp_path: Path) -> None:
    statuses = train(Trainer.start(tmp_path / "run", SMALL, seed=3))
    assert statuses
    paths = sorted((tmp_path / "run" / "checkpoints").iterdir())
    assert [load_checkpoint(path).card.step for path in paths] == [4, 8]
    policy = load_checkpoint(paths[0])
    assert policy.card.seed == 3
    assert policy.card.scenarios == ("1v0", "1v3")
    assert policy.observation_spec == SMALL.observation.spec()
    rows = list(csv.DictReader((tmp_path / "run" / CURVE_FILE).open()))
    assert [int(row["updates"]) for row in rows] == [4, 8]
    assert list((tmp_path / "run" / "tensorboard").glob("events*"))


def test_the_same_seed_gives_the_same_checkpoints(tmp_path: Path) -> None:
    contents = []
    for name, seed in (("a", 1), ("b", 1), ("c", 2)):
        train(Trainer.start(tmp_path / name, SMALL, seed))
        contents.append((tmp_path / name / "checkpoints" / "step-0000008.safetensors").read_bytes())
    assert contents[0] == contents[1]
    assert contents[0] != contents[2]


def test_resume_goes_on_from_the_stop(tmp_path: Path) -> None:
    trainer = Trainer.start(tmp_path, SMALL, seed=1)

    def stop(status: Status) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        trainer.run(stop)
    stopped = trainer.learner.state_dict()
    again = Trainer.resume(tmp_path)
    assert again.updates == trainer.updates > 0
    assert again.transitions == trainer.transitions
    for name, tensor in again.learner.state_dict().items():
        assert tensor.equal(stopped[name]), name
    train(again)
    assert again.updates == SMALL.updates


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ("", "no training run to resume"),
        ("{", "expected the JSON of a training run"),
        ('{"seed": 1, "config": {"circuit": 3}}', "circuit"),
    ],
)
def test_a_folder_that_holds_no_run_cannot_be_resumed(tmp_path: Path, change: str, said: str) -> None:
    if change:
        (tmp_path / "run.json").write_text(change)
    with pytest.raises(InputError, match=said):
        Trainer.resume(tmp_path)


def test_a_folder_with_a_run_is_not_overwritten(tmp_path: Path) -> None:
    Trainer.start(tmp_path, SMALL, seed=1)
    with pytest.raises(InputError, match="already"):
        Trainer.start(tmp_path, SMALL, seed=1)


def test_a_stuck_car_terminates_and_a_time_limit_truncates() -> None:
    rollout = Rollout(SMALL, Rollouts(scenario="1v0", races=2, learners=1), np.random.default_rng(0))
    braking = np.array([[-1.0, 0.0]] * 2, np.float32)
    ends = []
    for _ in range(120):
        step, _ = rollout.step(braking)
        assert not (step.terminated & step.truncated).any()
        ends.append((step.terminated.copy(), step.valid.copy()))
        if step.terminated.any():
            break
    assert ends[-1][0].any()
    # 5 s at rest after braking: within 12 s, and never before 5 s.
    assert len(ends) > 50
    rollout.episodes.limit_s[:] = 0.05
    step, _ = rollout.step(braking)
    assert step.truncated.all()
    assert not step.terminated.any()
    assert (rollout.episodes.world.time == 0.0).all()


def test_the_final_observation_is_the_one_before_the_reset() -> None:
    rollout = Rollout(SMALL, Rollouts(scenario="1v0", races=1, learners=1), np.random.default_rng(0))
    rollout.episodes.limit_s[:] = 0.05
    step, _ = rollout.step(np.zeros((1, 2), np.float32))
    assert step.truncated.all()
    assert not np.array_equal(step.next_observation, rollout.observation)


def test_every_shipped_configuration_reads() -> None:
    folder = Path(read_config.__code__.co_filename).parent / "configs"
    for path in folder.glob("*.toml"):
        assert read_config(path).rollouts


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("circuit = 1", "circuit"),
        ("[", "not a TOML file"),
        ("wheels = 4", "circuit: Field required"),
    ],
)
def test_a_wrong_configuration_names_file_and_field(tmp_path: Path, text: str, said: str) -> None:
    path = tmp_path / "config.toml"
    path.write_text(text)
    with pytest.raises(InputError, match=said) as error:
        read_config(path)
    assert str(path) in str(error.value)
