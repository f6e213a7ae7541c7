"""Teachers of polishing: where they are asked, and what they say."""

from __future__ import annotations

import numpy as np
import pytest

from nathlon.policies.bundled import BUNDLED
from nathlon.policies.checkpoint import load_checkpoint
from nathlon.policies.training import trial
from nathlon.policies.training.config import TrainingConfig
from nathlon.policies.training.pairs import Pair
from nathlon.policies.training.teacher import lost
from nathlon.policies.training.trial import Trial
from nathlon.sim.errors import InputError
from nathlon.sim.state import CAR_STATE
from tests.support.trainings import polishing

CHECKPOINT = BUNDLED / "lindenring" / "lindenring-wake-028k.safetensors"
HOME = Pair("lindenring", "gt3")


def taught_by(teacher: str | None) -> TrainingConfig:
    return polishing({"scenario": "recovery", "races": 1, "learners": 1}, polish={"teacher": teacher})


def recovery(teacher: str | None) -> trial.Driven:
    settings = taught_by(teacher)
    races = Trial(settings, settings.rollouts[0], HOME, 8, CHECKPOINT)
    (driven,) = races.drive(load_checkpoint(CHECKPOINT), np.random.default_rng(2)).driven
    return driven


@pytest.mark.parametrize(
    ("car", "expected"),
    [
        ({}, False),
        ({"heading_error": 2.0}, True),
        ({"heading_error": -2.0, "velocity_x": 40.0}, False),
        ({"off_course": True}, True),
        ({"off_course": True, "velocity_x": 40.0}, False),
        ({"wall_contact": True, "velocity_y": 3.0}, True),
    ],
)
def test_who_is_lost(car: dict[str, float], expected: bool) -> None:
    state = np.zeros(1, CAR_STATE)
    for name, value in car.items():
        state[name] = value
    assert lost(state).tolist() == [expected]


def test_the_teacher_is_asked_where_cars_are_lost_and_says_what_it_would_do(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    for name, value in {"GROUP": 4, "HORIZON_S": 3.0, "UNTOLD_S": 1.0}.items():
        monkeypatch.setattr(trial, name, value)
    asked = np.isfinite(recovery("driver").lesson).all(axis=1)
    assert 0.0 < asked.mean() < 1.0
    assert np.isnan(recovery(None).lesson).all()
    # Who is its own teacher would do what it does.
    own = recovery(str(CHECKPOINT))
    asked = np.isfinite(own.lesson).all(axis=1)
    np.testing.assert_allclose(own.lesson[asked], own.means[asked], atol=1e-5)


def test_with_a_teacher_races_that_begin_lost_begin_apart_and_only_lessons_count(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    for name, value in {"GROUP": 4, "HORIZON_S": 3.0, "UNTOLD_S": 2.9}.items():
        monkeypatch.setattr(trial, name, value)
    taught, alone = recovery("driver"), recovery(None)
    assert not taught.advantage.any()
    assert alone.advantage.any()
    assert len(np.unique(taught.seen, axis=0)) == 32  # eight starts of four races each
    assert len(np.unique(alone.seen, axis=0)) == 8


def test_an_unknown_teacher_is_refused() -> None:
    settings = taught_by("professor")
    with pytest.raises(InputError, match="professor"):
        Trial(settings, settings.rollouts[0], HOME, 1, CHECKPOINT)
