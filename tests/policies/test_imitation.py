"""Imitation: what is noted under instruction, what is learnt of it, and going on after a stop."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import nathlon
from nathlon.arena.match import Match, Race, Seat
from nathlon.arena.runner import run_match
from nathlon.policies.checkpoint import Card, encoded, load_checkpoint, read_card
from nathlon.policies.driver import Driver
from nathlon.policies.mlp import EncodedMlp, Mlp
from nathlon.policies.training import imitation
from nathlon.policies.training.config import TrainingConfig
from nathlon.policies.training.evaluation import LapEvaluation
from nathlon.policies.training.imitation import Imitation, fresh
from nathlon.policies.training.instruction import Class, Notes, instruct
from nathlon.policies.training.pairs import Pair
from nathlon.policies.training.teacher import Teacher
from nathlon.policies.training.trainer import Trainer
from nathlon.policies.weights import mean_network
from nathlon.sim.errors import InputError
from tests.support.trainings import TOML, polishing

HOME = Pair("lindenring", "gt3")
VIEW = {"version": 4, "course_points": 2, "cars_ahead": 1, "cars_behind": 1}
ALONE = polishing(
    {"scenario": "1v0", "races": 4, "learners": 1},
    updates=40,
    checkpoint_every=20,
    replay=10_000,
    imitation={"rounds": 2, "length_s": 2.0},
    observation=VIEW,
    qrsac={"hidden": [16], "encoder": [4], "batch": 32, "policy_rate": 3e-3},
)
TRAFFIC = polishing(
    {"scenario": "1v1", "races": 2, "learners": 1, "opponents": ["driver:pace=0.9"]},
    imitation={"length_s": 2.0},
    observation=VIEW,
)


def novice(config: TrainingConfig) -> Mlp | EncodedMlp:
    card = Card(
        algorithm="none",
        hidden=(8,),
        observation=config.observation.spec(),
        circuit="any",
        car="any",
        scenarios=(),
        step=0,
        transitions=0,
        seed=0,
        created_by={},
    )
    tensors = fresh(card, np.random.default_rng(1))
    return encoded(card, tensors, mean_network(tensors, 2))


def taught(config: TrainingConfig, share: float = 0.0) -> Notes:
    return instruct(config, novice(config), Class(config.rollouts[0], HOME, 1.0, share, seed=3))


def test_each_step_of_each_car_is_noted_with_what_the_driver_would_do_there() -> None:
    notes = taught(ALONE)
    assert notes.seen.shape == (20 * 4, ALONE.observation.spec().size)
    assert notes.said.shape == (20 * 4, 2)
    assert np.abs(notes.said).max() <= 1.0
    again = taught(ALONE)
    assert np.array_equal(again.seen, notes.seen)
    # Where the driver leads it goes forward.
    assert taught(ALONE, 1.0).seen[-4:, 0].mean() > notes.seen[-4:, 0].mean()


@pytest.mark.parametrize(("config", "remembers"), [(ALONE, False), (TRAFFIC, True)], ids=["alone", "traffic"])
def test_the_driver_remembers_how_far_it_moved_aside_only_among_others(
    config: TrainingConfig, remembers: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    remembered: list[float] = []
    advice = Teacher.advice

    def watched(self: Teacher, asked: np.ndarray) -> np.ndarray:
        remembered.append(float(np.abs(self._memory).max()))
        return advice(self, asked)

    monkeypatch.setattr(Teacher, "advice", watched)
    taught(config)
    assert bool(max(remembered)) is remembers


@pytest.fixture
def unmeasured(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nobody drives laps."""
    monkeypatch.setattr(imitation, "evaluate_laps", lambda *_: LapEvaluation(100.0, 0.1))


@pytest.mark.usefixtures("unmeasured")
def test_a_run_that_was_stopped_goes_on_as_if_it_had_not_been(tmp_path: Path) -> None:
    class Stop(Exception):
        pass

    def stop(_: object) -> None:
        raise Stop

    Imitation.start(tmp_path / "whole", ALONE, seed=2).run(lambda _: None)
    with pytest.raises(Stop):
        Imitation.start(tmp_path / "stopped", ALONE, seed=2).run(stop)
    Imitation.resume(tmp_path / "stopped").run(lambda _: None)
    for name in ("curve.csv", "checkpoints/step-0000020.safetensors", "checkpoints/step-0000040.safetensors"):
        whole, stopped = ((tmp_path / run / name).read_bytes() for run in ("whole", "stopped"))
        assert whole == stopped, name
    losses = [float(row.split(",")[3]) for row in (tmp_path / "whole" / "curve.csv").read_text().split()[1:]]
    assert losses[1] < losses[0]
    facts = tmp_path / "whole" / "run.json"
    facts.write_text(facts.read_text().replace('"seed": 2', '"seed": 3', 1))
    with pytest.raises(InputError, match="is of another seed"):
        Imitation.resume(tmp_path / "whole")


@pytest.mark.usefixtures("unmeasured")
def test_who_has_seen_the_plan_in_training_sees_it_in_races(tmp_path: Path) -> None:
    Imitation.start(tmp_path, ALONE, seed=2).run(lambda _: None)
    policy = load_checkpoint(tmp_path / "checkpoints" / "step-0000040.safetensors")
    assert policy.card.observation.plan_pace == 0.97
    match = Match(
        "race",
        "slipstream_pass",
        "slipstream_pass",
        "lindenring",
        "gt3",
        ("pupil", "driver"),
        ("pupil", "driver"),
        (Race(1, (Seat(0), Seat(1))),),
    )
    results = run_match(match, [policy, Driver("lindenring", "gt3")])
    assert not set(results["ending"]) & {"simulator_fault", "policy_error", "illegal_action"}


@pytest.mark.usefixtures("unmeasured")
def test_it_is_trained_as_others_are_but_what_only_rewards_know_is_refused(tmp_path: Path) -> None:
    path, run = tmp_path / "pupil.toml", tmp_path / "run"
    path.write_text(f"{TOML}\n[imitation]\nrounds = 2\nlength_s = 1.0\n")
    with pytest.raises(InputError, match="origin: expected for training by rewards, not by imitation"):
        nathlon.train(path, run, origin=tmp_path, progress=False)
    trained = nathlon.train(path, run, progress=False)
    assert [read_card(path).step for path in trained.checkpoints] == [2, 4]
    assert trained.curve["lap_s"].to_list() == [100.0, 100.0]
    assert nathlon.train(out=run, resume=True, progress=False).updates == 4
    with pytest.raises(InputError, match="imitation: expected none in a training by rewards"):
        Trainer.resume(run)
