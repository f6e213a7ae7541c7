"""Imitation: what is noted under instruction, what is learnt of it, and going on after a stop."""

from __future__ import annotations

from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from pydantic import ValidationError

import nathlon
from nathlon.arena.match import Match, Race, Seat
from nathlon.arena.runner import run_match
from nathlon.policies.checkpoint import (
    Card,
    SeeingPolicy,
    load_checkpoint,
    open_checkpoint,
    read_card,
    read_checkpoint,
)
from nathlon.policies.driver import Driver
from nathlon.policies.environments.opponents import OpponentWrapper
from nathlon.policies.load import load_policy
from nathlon.policies.policy import Policy
from nathlon.policies.training import imitation, instruction, teacher
from nathlon.policies.training.config import (
    CONFIGS,
    ObservationSettings,
    Rollouts,
    TrainingConfig,
    read_config,
)
from nathlon.policies.training.evaluation import LapEvaluation
from nathlon.policies.training.imitation import Imitation
from nathlon.policies.training.instruction import Class, Notes, instruct
from nathlon.policies.training.mistakes import Mistakes
from nathlon.policies.training.pairs import CHAMPION, Pair
from nathlon.policies.training.pupil import NumbersPupil, fresh, note_numbers
from nathlon.policies.training.seeing_pupil import note_passages
from nathlon.policies.training.teacher import Teacher
from nathlon.policies.training.trainer import Trainer
from nathlon.sim.episode import Episodes
from nathlon.sim.errors import InputError
from nathlon.sim.observation import ObservationSpec
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

SEEING = polishing(
    {"scenario": "1v1", "races": 2, "learners": 1, "opponents": [CHAMPION]},
    updates=8,
    checkpoint_every=4,
    replay=10_000,
    imitation={"rounds": 2, "length_s": 2.0, "teacher": CHAMPION, "passage": 4, "recalled": 1},
    observation={"camera": {"width": 24, "height": 16}},
    vision={"convolutions": [{"filters": 3, "side": 8, "stride": 4}], "features": 5, "memory": 4},
    qrsac={"hidden": [6], "batch": 16, "policy_rate": 1e-2},
)


def novice(config: TrainingConfig) -> Policy:
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
    return NumbersPupil(card, 1, False, fresh(card, np.random.default_rng(1))).policy


def taught(config: TrainingConfig, share: float = 0.0) -> Notes:
    return instruct(config, novice(config), note_numbers, Class(config.rollouts[0], HOME, 1.0, share, seed=3))


def test_each_step_of_each_car_is_noted_with_what_the_driver_would_do_there() -> None:
    notes = taught(ALONE)
    seen, said = notes.rows["seen"], notes.rows["said"]
    assert seen.shape == (20 * 4, ALONE.observation.spec().size)
    assert said.shape == (20 * 4, 2)
    assert np.abs(said).max() <= 1.0
    assert np.array_equal(taught(ALONE).rows["seen"], seen)
    # Where the driver leads it goes forward.
    assert taught(ALONE, 1.0).rows["seen"][-4:, 0].mean() > seen[-4:, 0].mean()


def test_who_sees_is_told_what_the_champion_would_do_with_all_that_a_passage_needs(tmp_path: Path) -> None:
    pupil = Imitation(tmp_path, SEEING, seed=1)._pupil
    policy = pupil.policy
    rows = instruct(SEEING, policy, note_passages, Class(SEEING.rollouts[0], HOME, 1.0, 0.0, seed=3)).rows
    assert rows["left"].tolist() == [*range(19, -1, -1)] * 2
    seen = policy.observation_spec.blank(40)
    for name in ("picture", "sensors"):
        seen[name] = rows[name]
    # What a car remembers comes of its step before; each begins with nothing.
    _, after = policy.act(seen, rows["memory"].astype(np.float32))
    np.testing.assert_allclose(rows["memory"][1:20], after[:19], atol=2e-3)
    np.testing.assert_array_equal(rows["memory"][[0, 20]], 0.0)
    champion = load_policy(HOME.wise(CHAMPION), *HOME[:2])
    said, _ = champion.act(rows["shown"].astype(np.float32), champion.initial_memory(40))
    np.testing.assert_allclose(rows["said"], said, atol=0.02)
    noted = [{name: torch.from_numpy(each) for name, each in rows.items()}]
    losses = []
    for loss in islice(pupil.losses(noted, np.random.default_rng(1)), 60):
        pupil.trained.step(loss, 1e-2)
        losses.append(loss.item())
    assert sum(losses[-10:]) < 0.8 * sum(losses[:10])


@pytest.mark.parametrize(("config", "remembers"), [(ALONE, False), (TRAFFIC, True)], ids=["alone", "traffic"])
def test_the_driver_remembers_how_far_it_moved_aside_only_among_others(
    config: TrainingConfig, remembers: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    remembered: list[float] = []
    look = Teacher.look

    def watched(self: Teacher, asked: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        remembered.append(float(np.abs(self._memory).max()))
        return look(self, asked)

    monkeypatch.setattr(Teacher, "look", watched)
    taught(config)
    assert bool(max(remembered)) is remembers


@pytest.mark.parametrize(("of_all", "own"), [(0.25, None), (9.0, 0.25)], ids=["all", "rollouts"])
def test_whoever_is_out_of_control_for_long_begins_anew(
    of_all: float, own: float | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(instruction, "out_of_control", lambda cars: np.ones(len(cars), np.bool_))
    assert SEEING.imitation is not None
    settings = SEEING.imitation.model_copy(update={"length_s": 0.9, "patience_s": of_all})
    rollouts = SEEING.rollouts[0].model_copy(update={"patience_s": own})
    config = SEEING.model_copy(update={"imitation": settings, "rollouts": (rollouts,)})
    policy = Imitation(tmp_path, config, seed=1)._pupil.policy
    rows = instruct(config, policy, note_passages, Class(config.rollouts[0], HOME, 1.0, 0.0, seed=3)).rows
    # No passage goes on from one start to the next, and none remembers what was before.
    assert rows["left"].tolist() == [2, 1, 0] * 6
    assert (np.abs(rows["memory"]).max(axis=1) == 0.0).tolist() == [True, False, False] * 6


@pytest.mark.parametrize(("role", "where"), [("rescuer", "astray"), ("racer", "racing")])
def test_a_rescuer_or_racer_says_what_to_do_where_it_is_asked_and_the_teacher_elsewhere(
    role: str, where: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert SEEING.imitation is not None
    settings = SEEING.imitation.model_copy(update={"length_s": 0.5})
    policy = Imitation(tmp_path, SEEING, seed=1)._pupil.policy
    steps: list[int] = []

    def in_turn(env: OpponentWrapper) -> np.ndarray:
        steps.append(len(steps))
        return np.arange(len(env.cars)) == len(steps) % 2

    monkeypatch.setattr(teacher, where, in_turn)

    def said(**imitation: str) -> np.ndarray:
        config = SEEING.model_copy(update={"imitation": settings.model_copy(update=imitation)})
        steps.clear()
        drive = instruct(config, policy, note_passages, Class(config.rollouts[0], HOME, 1.0, 0.0, seed=3))
        return drive.rows["said"].reshape(2, -1, 2).swapaxes(0, 1)

    slow = "driver:pace=0.8"
    both, alone, instead = said(**{role: slow}), said(), said(teacher=slow)
    asked = np.stack([np.arange(2) == step % 2 for step in range(1, len(both) + 1)])
    np.testing.assert_array_equal(both[asked], instead[asked])
    np.testing.assert_array_equal(both[~asked], alone[~asked])
    assert not np.allclose(instead[asked], alone[asked])


def test_champions_show_at_full_pace_how_they_race_at_home(tmp_path: Path) -> None:
    assert TRAFFIC.imitation is not None
    here, away = Pair("lindenring", "gt3"), Pair("lindenring", "coupe")
    anywhere, at_home = (TRAFFIC.rollouts[0].model_copy(update={"racer": name}) for name in (None, CHAMPION))
    settings = TRAFFIC.imitation.model_copy(update={"paces": (0.9,), "length_s": 0.5})
    run = Imitation.start(tmp_path, TRAFFIC.model_copy(update={"imitation": settings}), seed=1)
    run.hold([away, here])
    rng = np.random.default_rng(1)
    held = [[run._class(rollouts, 0.0, rng) for _ in range(9)] for rollouts in (anywhere, at_home)]
    assert {(each.pair, each.pace) for each in held[0]} == {(here, 0.9), (away, 0.9)}
    assert {(each.pair, each.pace) for each in held[1]} == {(here, 1.0)}

    def said(rollouts: Rollouts, **also: str) -> np.ndarray:
        config = TRAFFIC.model_copy(update={"imitation": settings.model_copy(update=also)})
        planned = Class(rollouts, here, 1.0, 0.0, seed=3)
        return instruct(config, novice(config), note_numbers, planned).rows["said"]

    np.testing.assert_array_equal(said(at_home), said(anywhere, racer=CHAMPION))
    assert not np.array_equal(said(at_home), said(anywhere))


def test_champions_are_missed_where_there_are_none(tmp_path: Path) -> None:
    at_home = TRAFFIC.rollouts[0].model_copy(update={"racer": CHAMPION})
    run = Imitation.start(tmp_path, TRAFFIC.model_copy(update={"rollouts": (at_home,)}), seed=1)
    with pytest.raises(InputError, match=r"1v1: racer is 'champion', expected a pair for which one comes"):
        run.hold([Pair("lindenring", "coupe")])


@pytest.fixture
def driven(monkeypatch: pytest.MonkeyPatch) -> list[np.ndarray]:
    """Actions of all steps of classes held meanwhile."""
    actions: list[np.ndarray] = []
    steps = OpponentWrapper.step

    def step(env: OpponentWrapper, acted: np.ndarray) -> None:
        actions.append(acted.copy())
        steps(env, acted)

    monkeypatch.setattr(OpponentWrapper, "step", step)
    return actions


def test_every_second_car_is_pushed_off_its_way(driven: list[np.ndarray]) -> None:
    assert ALONE.imitation is not None
    notes, actions = [], []
    for disturbance in (0.0, 0.02):
        driven.clear()
        imitates = ALONE.imitation.model_copy(update={"disturbance": disturbance})
        notes.append(taught(ALONE.model_copy(update={"imitation": imitates})).rows)
        actions.append(np.stack(driven))
    pushes = actions[1] - actions[0]
    assert not pushes[:, ::2].any()
    first = pushes[0, 1::2]
    assert (np.abs(first) > 0.0).all()
    assert np.abs(first).max() < 0.1
    # Each car is told from where it has come to.
    seen = [rows["seen"].reshape(20, 4, -1) for rows in notes]
    assert np.array_equal(seen[0][:, ::2], seen[1][:, ::2])
    assert not np.array_equal(seen[0][-1, 1], seen[1][-1, 1])


def test_pushes_are_smaller_by_the_grip(driven: list[np.ndarray], monkeypatch: pytest.MonkeyPatch) -> None:
    # Practice on that grip would take long, and nobody heeds the teacher.
    monkeypatch.setattr(Pair, "wise", lambda pair, policy: policy)
    still = ALONE.imitation
    assert still is not None
    config = ALONE.model_copy(update={"observation": ObservationSettings(version=3)})

    def pushes(grip: float) -> np.ndarray:
        driven.clear()
        for disturbance in (0.0, 0.02):
            imitates = still.model_copy(update={"disturbance": disturbance, "length_s": 0.1})
            pushed = config.model_copy(update={"imitation": imitates})
            planned = Class(config.rollouts[0], HOME._replace(grip=grip), 1.0, 0.0, seed=3)
            instruct(pushed, novice(config), note_numbers, planned)
        return driven[1] - driven[0]

    np.testing.assert_allclose(pushes(0.25), 0.25 * pushes(1.0), atol=1e-7)


def test_a_racer_that_remembers_nothing_may_be_asked_now_and_then_but_by_who_heeds_it_always(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    assert TRAFFIC.imitation is not None
    monkeypatch.setattr(teacher, "racing", lambda env: np.arange(len(env.cars)) == 0)
    imitates = {"length_s": 0.8, "racer": "driver:rollout=2", "racer_every": 4}
    config = TRAFFIC.model_copy(update={"imitation": TRAFFIC.imitation.model_copy(update=imitates)})
    rows = {share: taught(config, share).rows["said"] for share in (0.0, 1.0)}
    # Of eight steps: one car is asked in two of them, the other one by its own teacher in all.
    assert [len(said) for said in rows.values()] == [2 + 8, 8 + 8]
    assert all(np.isfinite(said).all() for said in rows.values())


def test_cars_race_with_those_near_them_on_the_road_across_the_line_too() -> None:
    episodes = Episodes("lindenring", "gt3", "1v3")
    env = OpponentWrapper(episodes, [0, 1, 2, 3], ObservationSpec(), ())
    env.start([0], [np.random.default_rng(1)])
    length = episodes.world.track.length

    def racing(*progress: float) -> list[bool]:
        episodes.world.state["progress"] = progress
        return teacher.racing(env).tolist()

    assert racing(2.0, length - 30.0, 500.0, 900.0) == [False, True, False, False]
    assert racing(2.0, 2.0 * length - 10.0, 500.0, 900.0) == [True, True, False, False]
    episodes.world.state["driving"][0, 0] = False
    assert racing(2.0, length - 10.0, 500.0, 530.0) == [True, False, True, False]


def test_mistakes_are_driven_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    class First(Mistakes):
        """Takes the end of the first step for one."""

        def watch(self) -> None:
            if not self._found:
                self._found.append(self._episodes.moment().of(0))

    monkeypatch.setattr(instruction, "out_of_control", lambda cars: np.ones(len(cars), np.bool_))
    monkeypatch.setattr(instruction, "Mistakes", First)
    assert SEEING.imitation is not None
    settings = SEEING.imitation.model_copy(update={"length_s": 0.9, "patience_s": 0.25})
    rollouts = SEEING.rollouts[0].model_copy(update={"mistakes": 1.0})
    config = SEEING.model_copy(update={"imitation": settings})
    policy = Imitation(tmp_path, config, seed=1)._pupil.policy
    rows = instruct(config, policy, note_passages, Class(rollouts, HOME, 1.0, 0.0, seed=3)).rows
    again = rows["picture"][[3, 6, 12, 15]]
    assert (again == again[0]).all()
    assert np.array_equal(again[0], rows["picture"][1])
    assert not np.array_equal(rows["picture"][9], rows["picture"][0])


@pytest.fixture
def unmeasured(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nobody drives laps."""
    monkeypatch.setattr(imitation, "evaluate_laps", lambda *_: LapEvaluation(100.0, 0.1))


@pytest.mark.usefixtures("unmeasured")
@pytest.mark.parametrize("config", [ALONE, SEEING], ids=["numbers", "seeing"])
def test_a_run_that_was_stopped_goes_on_as_if_it_had_not_been(tmp_path: Path, config: TrainingConfig) -> None:
    class Stop(Exception):
        pass

    def stop(_: object) -> None:
        raise Stop

    Imitation.start(tmp_path / "whole", config, seed=2).run(lambda _: None)
    with pytest.raises(Stop):
        Imitation.start(tmp_path / "stopped", config, seed=2).run(stop)
    Imitation.resume(tmp_path / "stopped").run(lambda _: None)
    checkpoints = sorted((tmp_path / "whole" / "checkpoints").iterdir())
    assert len(checkpoints) == 2
    for path in (tmp_path / "whole" / "curve.csv", *checkpoints):
        assert path.read_bytes() == (tmp_path / "stopped" / path.relative_to(tmp_path / "whole")).read_bytes()
    if config.vision:
        assert isinstance(open_checkpoint(checkpoints[0]), SeeingPolicy)
    if config is ALONE:
        curve = (tmp_path / "whole" / "curve.csv").read_text().split()
        losses = [float(row.split(",")[3]) for row in curve[1:]]
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
    with pytest.raises(InputError, match="device: expected for training by rewards, not by imitation"):
        nathlon.train(path, run, device="cuda", progress=False)
    with pytest.raises(InputError, match="no run of imitation to start from"):
        nathlon.train(path, run, origin=tmp_path, progress=False)
    trained = nathlon.train(path, run, progress=False)
    assert [read_card(path).step for path in trained.checkpoints] == [2, 4]
    assert trained.curve["lap_s"].to_list() == [100.0, 100.0]
    assert nathlon.train(out=run, resume=True, progress=False).updates == 4
    further = Imitation.start(tmp_path / "further", read_config(path), 2, run)
    (_, before), after = read_checkpoint(trained.checkpoints[-1]), further._pupil.averaged()
    np.testing.assert_allclose(after["0.weight"], before["0.weight"], atol=1e-3)
    # Stopped in its first round, it still goes on from the other one.
    resumed = Imitation.resume(tmp_path / "further")
    assert np.array_equal(resumed._pupil.averaged()["0.weight"], after["0.weight"])
    resumed.hold([HOME])
    alone = Imitation.start(tmp_path / "alone", read_config(path), 2, trained.checkpoints[-1])
    np.testing.assert_array_equal(alone._pupil.averaged()["0.weight"], before["0.weight"])
    with pytest.raises(InputError, match="imitation: expected none in a training by rewards"):
        Trainer.resume(run)


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"vision": None}, "belong together"),
        ({"imitation": None, "keep_replay": True}, "expected false beside a vision"),
        ({"qrsac": {"encoder": [4]}}, "expected none beside a vision"),
        ({"imitation": {"mirrored": True}}, "mirrored is given, expected none beside a vision"),
        ({"observation": {"camera": {"width": 8}}}, "width is 8, expected a whole number from 16"),
        ({"imitation": {"passage": 4, "recalled": 4}}, "expected less than passage"),
        ({"vision": {"convolutions": [{"filters": 3, "side": 20, "stride": 4}]}}, "leave nothing of 16 x 24"),
    ],
)
def test_a_configuration_of_seeing_that_contradicts_itself_is_refused(changed: dict, said: str) -> None:
    with pytest.raises(ValidationError, match=said):
        TrainingConfig.model_validate(SEEING.model_dump() | changed)


@pytest.mark.parametrize(("name", "value"), [("racer", CHAMPION), ("patience_s", 6.0)])
def test_what_belongs_to_lessons_is_refused_without_imitation(name: str, value: Any) -> None:
    races = [rollouts.model_dump() | {name: value} for rollouts in TRAFFIC.rollouts]
    with pytest.raises(ValidationError, match=f"{name} is given, expected an imitation beside it"):
        TrainingConfig.model_validate(TRAFFIC.model_dump() | {"imitation": None, "rollouts": races})


def test_the_configuration_that_is_shipped_is_read(tmp_path: Path) -> None:
    pupil = Imitation(tmp_path, read_config(CONFIGS / "vision.toml"), seed=1)._pupil
    assert isinstance(pupil.policy, SeeingPolicy)
    with pytest.raises(InputError, match="champion: none comes with nathlon for lindenring and coupe"):
        Pair("lindenring", "coupe").wise(CHAMPION)
