"""Polishing: what groups drive and earn, where it leads, and going on after a stop."""

from __future__ import annotations

import json
import re
from itertools import count
from pathlib import Path

import numpy as np
import pytest
from safetensors import safe_open
from safetensors.numpy import load_file, save_file

from nathlon.policies.bundled import BUNDLED
from nathlon.policies.checkpoint import Card, load_checkpoint, open_checkpoint, read_card, save_checkpoint
from nathlon.policies.training import polish, trial
from nathlon.policies.training.actor import Actor
from nathlon.policies.training.advantage import advantages
from nathlon.policies.training.config import TrainingConfig
from nathlon.policies.training.evaluation import LapEvaluation, evaluate_laps
from nathlon.policies.training.failures import Failure, Failures
from nathlon.policies.training.pairs import Pair
from nathlon.policies.training.polish import Polish
from nathlon.policies.training.pupil import fresh
from nathlon.policies.training.rewards import Reward
from nathlon.policies.training.trial import Driven, Trial, lasting
from nathlon.policies.vision import Convolution, Vision
from nathlon.selection.publish.curves import find_curves
from nathlon.sim.camera_spec import CameraSpec
from nathlon.sim.errors import InputError
from nathlon.sim.observation import ObservationSpec
from tests.support.command_line import nathlon, refused
from tests.support.refusals import refusal
from tests.support.trainings import polishing

CHECKPOINT = BUNDLED / "lindenring" / "lindenring-wake-028k.safetensors"
HOME = Pair("lindenring", "gt3")
ALONE = polishing({"scenario": "1v0", "races": 1, "learners": 1})
LOST = polishing({"scenario": "recovery", "races": 1, "learners": 1}, polish={"rate": 5e-4, "batch": 64})
TRAFFIC = polishing({"scenario": "1v1", "races": 1, "learners": 1, "opponents": ["driver", "self", "past"]})


@pytest.fixture
def few(monkeypatch: pytest.MonkeyPatch) -> None:
    """Little is driven."""
    for name, value in {"GROUP": 4, "HORIZON_S": 3.0, "UNTOLD_S": 1.0}.items():
        monkeypatch.setattr(trial, name, value)
    for name, value in {"STARTS": 2, "CHECKPOINT_EVERY": 2}.items():
        monkeypatch.setattr(polish, name, value)


def polished(folder: Path, rounds: int, stop_after: int | None = None) -> None:
    work = Polish(CHECKPOINT, ALONE, folder, rounds, seed=3)

    def on_round(done: polish.Round) -> None:
        if done.rounds == stop_after:
            raise KeyboardInterrupt

    work.run(on_round)


def drive(settings: TrainingConfig, seed: int = 5) -> tuple[Driven, float]:
    races = Trial(settings, settings.rollouts[0], HOME, 2, CHECKPOINT)
    drive = races.drive(load_checkpoint(CHECKPOINT), np.random.default_rng(seed))
    assert len(drive.driven) == 1
    return drive.driven[0], drive.reward


@pytest.mark.usefixtures("few")
@pytest.mark.parametrize("settings", [ALONE, TRAFFIC], ids=["alone", "traffic"])
def test_a_group_leaves_the_same_start(settings: TrainingConfig) -> None:
    driven, _ = drive(settings)
    assert len(driven.seen) == len(driven.advantage) == 20 * 8  # steps that are told, cars
    first, later = (driven.seen[8 * step : 8 * step + 8].reshape(4, 2, -1) for step in (0, 10))
    assert np.array_equal(first, np.tile(first[:1], (4, 1, 1)))
    assert not np.array_equal(first[0, 0], first[0, 1])
    assert not np.array_equal(later[0], later[1])
    np.testing.assert_allclose(load_checkpoint(CHECKPOINT).network(driven.seen), driven.means, atol=1e-5)
    assert abs(driven.noise.std() - 1.0) < 0.1
    assert driven.advantage.std() == pytest.approx(1.0, rel=1e-3)


@pytest.mark.usefixtures("few")
@pytest.mark.parametrize("settings", [ALONE, TRAFFIC], ids=["alone", "traffic"])
def test_who_drives_alike_earns_alike(settings: TrainingConfig) -> None:
    alike = settings.polish.model_copy(update={"deviation": (1e-30, 1e-30)})
    settings = settings.model_copy(update={"polish": alike})
    driven, reward = drive(settings)
    assert np.array_equal(driven.advantage, np.zeros(len(driven.advantage)))
    again, the_same = drive(settings)
    assert np.array_equal(again.seen, driven.seen)
    assert the_same == reward
    assert drive(settings, seed=6)[1] != reward


@pytest.mark.usefixtures("few")
@pytest.mark.parametrize("settings", [ALONE, TRAFFIC], ids=["alone", "traffic"])
def test_what_went_wrong_is_driven_again(settings: TrainingConfig, monkeypatch: pytest.MonkeyPatch) -> None:
    """By a group of its own, from the same moment, against the same opponents, with bolder noise."""
    monkeypatch.setattr(trial, "AGAIN_S", 11.0)
    asked, moments = [], []

    def draw(self: Failures, count: int) -> list[Failure]:
        asked.append(count)
        moments.append(races._episodes.moment().of(5))
        return [Failure(5, moments[0])] * count

    monkeypatch.setattr(Failures, "draw", draw)
    rollouts = settings.rollouts[0].model_copy(update={"mistakes": 0.5})
    races = Trial(settings, rollouts, HOME, 2, CHECKPOINT)
    policy = load_checkpoint(CHECKPOINT)
    done = races.drive(policy, np.random.default_rng(5))
    first, again = done.driven
    assert asked == [1]  # half of two starts
    assert done.steps == 30 * 8 + 110 * 4
    assert len(first.seen) == 20 * 8
    assert len(again.seen) == 100 * 4
    begun = again.seen[:4]
    assert np.array_equal(begun, np.tile(begun[:1], (4, 1)))
    assert not np.array_equal(again.seen[4], again.seen[5])
    episodes = races._episodes
    episodes.start([0], [np.random.default_rng(0)], {0: moments[0]})
    assert np.array_equal(races._env.seen[0], begun[0])
    if settings is TRAFFIC:
        assert np.array_equal(races._env.seated([0, 2, 4, 6]), races._env.seated([5] * 4))
    noise = again.noise.reshape(100, 8)
    assert noise.std() == pytest.approx(1.0 / trial.BOLDNESS, rel=0.2)
    assert np.corrcoef(noise[1:].ravel(), noise[:-1].ravel())[0, 1] == pytest.approx(trial.KEPT, abs=0.15)
    assert again.advantage.std() == pytest.approx(1.0, rel=1e-3)


def test_noise_that_lasts_is_no_larger() -> None:
    drawn = np.random.default_rng(0).standard_normal((20_000, 3)).astype(np.float32)
    lasts = lasting(drawn, 0.8)
    assert lasts.dtype == np.float32
    assert lasts.std() == pytest.approx(1.0, rel=0.02)
    for lag in (1, 3):
        assert np.corrcoef(lasts[lag:, 0], lasts[:-lag, 0])[0, 1] == pytest.approx(0.8**lag, abs=0.02)
    assert np.array_equal(lasting(drawn, 0.0), drawn)


@pytest.mark.usefixtures("few")
@pytest.mark.parametrize(("component", "discount"), [("progress", 0.985), ("unsporting", 0.95)])
def test_a_charge_is_laid_to_what_led_there(
    component: str, discount: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The longer ago an action was, the less counts for it what a car is charged: least of a contact."""
    components, laid, step = Reward.components, [], count()

    def charged(self: Reward, before: np.ndarray, after: np.ndarray, *rest: np.ndarray) -> dict:
        found = {name: np.zeros(after.shape) for name in components(self, before, after, *rest)}
        found[component][0, 0] = -1.0 if next(step) == 15 else 0.0
        return found

    def told(returns: np.ndarray, charges: np.ndarray, motion: np.ndarray) -> np.ndarray:
        laid.append(returns + charges)
        return advantages(returns, charges, motion)

    monkeypatch.setattr(Reward, "components", charged)
    monkeypatch.setattr(trial, "advantages", told)
    drive(polishing({"scenario": "1v0", "races": 1, "learners": 1}, reward={component: 2.0}))
    (values,) = laid
    assert values.shape == (20, 2, 4)  # steps that are told, starts, group
    np.testing.assert_allclose(values[:16, 0, 0], -2.0 * discount ** np.arange(15, -1, -1))
    assert not values[16:].any()
    values[:, 0, 0] = 0.0
    assert not values.any()


def test_reward_is_what_the_configuration_counts(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(trial, "GROUP", 2)
    rollouts = {"scenario": "1v0", "races": 1, "learners": 1}
    earned = [
        drive(polishing(rollouts, reward={"progress": weight, "off_course": 0.0, "steering": price}))[1]
        for weight, price in ((1.0, 0.0), (0.5, 0.0), (1.0, 10.0))
    ]
    assert earned[0] == pytest.approx(2.0 * earned[1])
    assert earned[2] == earned[0]


def test_who_brakes_less_than_its_group_before_a_straight_has_the_advantage(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Of the steps in which all are at full throttle, noise on the pedals can but slow."""
    monkeypatch.setattr(trial, "GROUP", 16)
    driven, _ = drive(ALONE)
    full = driven.means[:, 0] > 0.99
    assert full.sum() > 1000
    slowed = np.minimum(driven.noise[full, 0], 0.0)
    assert np.corrcoef(slowed, driven.advantage[full])[0, 1] > 0.05


def test_a_polished_policy_laps_faster(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(trial, "HORIZON_S", 40.0)
    monkeypatch.setattr(polish, "STARTS", 8)
    Polish(CHECKPOINT, ALONE, tmp_path, 4, seed=1).run(lambda _: None)
    found = tmp_path / "checkpoints" / "round-00004.safetensors"
    laps = []
    for path in (CHECKPOINT, found):
        policy = load_checkpoint(path)
        laps.append(evaluate_laps(Pair("lindenring", "gt3"), policy, seed=7))
    assert laps[1].lap_s < laps[0].lap_s - 0.05
    assert laps[1].off_course_share == 0.0
    card, before = read_card(found), read_card(CHECKPOINT)
    assert card.algorithm == "QR-SAC, polished"
    assert card.scenarios == tuple(dict.fromkeys((*before.scenarios, "1v0")))
    assert card.transitions == before.transitions + 4 * 8 * 32 * 400
    assert card.step == before.step + 4 * (8 * 32 * 270 // 8192)
    assert (card.seed, card.hidden) == (before.seed, before.hidden)
    assert find_curves([str(found)])["updates"].to_list() == [card.step]
    tensors, old = load_file(found), load_file(CHECKPOINT)
    for name, tensor in old.items():
        assert not np.array_equal(tensors[name], tensor)
    assert np.array_equal(tensors["2.weight"][:, 2:], old["2.weight"][:, 2:])


@pytest.mark.usefixtures("few")
def test_going_on_after_a_stop_comes_to_the_same(tmp_path: Path) -> None:
    polished(tmp_path / "whole", 5)
    with pytest.raises(KeyboardInterrupt):
        polished(tmp_path / "halves", 5, stop_after=3)
    polished(tmp_path / "halves", 5)
    names = sorted(str(path.relative_to(tmp_path / "whole")) for path in (tmp_path / "whole").rglob("*.*"))
    assert names == [
        "checkpoints/round-00002.safetensors",
        "checkpoints/round-00004.safetensors",
        "checkpoints/round-00005.safetensors",
        "curve.csv",
        "state.safetensors",
    ]
    for name in names[:-1]:
        assert (tmp_path / "whole" / name).read_bytes() == (tmp_path / "halves" / name).read_bytes()
    lines = (tmp_path / "whole" / "curve.csv").read_text().splitlines()
    assert [line.split(",")[0] for line in lines] == ["rounds", "2", "4", "5"]


@pytest.mark.usefixtures("few")
def test_a_checkpoint_is_an_average_of_rounds(tmp_path: Path) -> None:
    work = Polish(CHECKPOINT, ALONE, tmp_path, 14, seed=3)
    rounds: list[np.ndarray] = []
    averages: list[np.ndarray] = []

    def on_round(_: polish.Round) -> None:
        assert isinstance(work._actor, Actor)
        rounds.append(work._actor.layers[0][0].detach().numpy().copy())
        averages.append(dict(work._actor.averages())["0.weight"].copy())

    work.run(on_round)
    expected = np.mean(rounds[:10], axis=0)
    np.testing.assert_allclose(averages[9], expected, atol=1e-6)
    for each in rounds[10:]:
        expected = 0.9 * expected + 0.1 * each
    np.testing.assert_allclose(averages[13], expected, atol=1e-6)
    assert np.abs(rounds[13] - expected).max() > 1e-5
    kept = load_file(tmp_path / "checkpoints" / "round-00014.safetensors")["0.weight"]
    np.testing.assert_array_equal(kept, averages[13].astype(kept.dtype))


@pytest.mark.usefixtures("few")
def test_what_is_polished_can_be_polished_further(tmp_path: Path) -> None:
    polished(tmp_path / "once", 2)
    once = tmp_path / "once" / "checkpoints" / "round-00002.safetensors"
    Polish(once, ALONE, tmp_path / "twice", 2, seed=3).run(lambda _: None)
    card, before = read_card(tmp_path / "twice" / "checkpoints" / once.name), read_card(once)
    assert card.algorithm == before.algorithm == "QR-SAC, polished"
    assert card.transitions - before.transitions == before.transitions - read_card(CHECKPOINT).transitions


@pytest.fixture
def eye(tmp_path: Path) -> Path:
    """A checkpoint that sees by a camera, and has learnt nothing."""
    card = Card(
        format=2,
        algorithm="none",
        hidden=(6,),
        vision=Vision(convolutions=(Convolution(filters=3, side=8, stride=4),), features=5, memory=4),
        observation=ObservationSpec(camera=CameraSpec(width=24, height=16)),
        circuit="lindenring",
        car="gt3",
        scenarios=(),
        step=0,
        transitions=0,
        seed=0,
        created_by={},
    )
    path = tmp_path / "eye.safetensors"
    save_checkpoint(path, fresh(card, np.random.default_rng(1)), card)
    return path


@pytest.mark.usefixtures("few")
def test_who_sees_by_a_camera_is_polished_likewise(
    eye: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(polish, "evaluate_laps", lambda *_: LapEvaluation(100.0, 0.1))
    races = Trial(TRAFFIC, TRAFFIC.rollouts[0], HOME, 2, eye)
    policy = open_checkpoint(eye)
    (driven,) = races.drive(policy, np.random.default_rng(5)).driven
    means, _ = policy.act(driven.seen, driven.memory)
    assert np.array_equal(means, driven.means)
    assert np.abs(driven.memory).max() > 0.0
    work = Polish(eye, TRAFFIC, tmp_path / "polished", 2, seed=3)
    work.run(lambda _: None)
    found = open_checkpoint(tmp_path / "polished" / "checkpoints" / "round-00002.safetensors")
    assert found.card.algorithm == "none, polished"
    tensors, old = (
        load_file(path) for path in (tmp_path / "polished/checkpoints/round-00002.safetensors", eye)
    )
    assert {name for name, tensor in old.items() if np.array_equal(tensors[name], tensor)} <= {"1.bias"}


@pytest.mark.usefixtures("few")
def test_another_polishing_is_refused(tmp_path: Path) -> None:
    polished(tmp_path, 2)
    state = tmp_path / "state.safetensors"
    with refusal(state, "another seed"):
        Polish(CHECKPOINT, ALONE, tmp_path, 2, seed=4)
    with refusal(state, "another rounds"):
        Polish(CHECKPOINT, ALONE, tmp_path, 3, seed=3)
    with refusal(state, "another configuration"):
        Polish(CHECKPOINT, TRAFFIC, tmp_path, 2, seed=3)
    with refusal(state, "another checkpoint"):
        Polish(CHECKPOINT.with_name("lindenring-grid-044k.safetensors"), ALONE, tmp_path, 2, seed=3)
    with safe_open(state, framework="np") as file:
        facts = file.metadata()
    tensors = load_file(state)
    kept = {name: tensor for name, tensor in tensors.items() if name != "average.0"}
    save_file(kept, state, facts)  # as states were before checkpoints were averages
    with refusal(state, "tensor 'average.0' is missing"):
        Polish(CHECKPOINT, ALONE, tmp_path, 2, seed=3)
    counts = np.array([2, 6])  # as states had them that did not count transitions
    save_file({**tensors, "counts": counts}, state, facts)
    with refusal(state, r"tensor 'counts' has shape \(2,\), expected \(3\)"):
        Polish(CHECKPOINT, ALONE, tmp_path, 2, seed=3)
    for name, wrong, said in (
        ("counts", np.array([2.0, np.nan, 3.0]), "tensor 'counts' is [2.0, nan, 3.0]"),
        ("counts", np.array([2, -6, 3]), "tensor 'counts' is [2.0, -6.0, 3.0]"),
        ("counts", np.array(3), "tensor 'counts' has shape ()"),
        ("weights", np.zeros((1, 1)), "tensor 'weights' has shape (1, 1)"),
        ("curve", np.zeros((1, 5)), "tensor 'curve' has shape (1, 5), expected (any, 6)"),
        ("average.0", np.zeros((2, 2), np.float32), "tensor 'average.0' is (2, 2) torch.float32"),
        ("parameter.0", np.full_like(tensors["parameter.0"], np.nan), "finite numbers"),
        ("adam.0.step", np.zeros(3, np.float32), "tensor 'adam.0.step' is (3,)"),
    ):
        save_file({**tensors, name: wrong}, state, facts)
        with refusal(state, re.escape(said)):
            Polish(CHECKPOINT, ALONE, tmp_path, 2, seed=3)
    state.write_bytes(state.read_bytes()[:100])
    with refusal(state, "not the state of a polishing"):
        Polish(CHECKPOINT, ALONE, tmp_path, 2, seed=3)


@pytest.mark.usefixtures("few")
def test_a_checkpoint_of_another_circuit_is_refused(tmp_path: Path) -> None:
    elsewhere = BUNDLED / "porto-sereno" / "porto-sereno-cup-044k.safetensors"
    with refusal(elsewhere, "circuit is porto-sereno, expected lindenring"):
        Polish(elsewhere, ALONE, tmp_path / "out", 2, seed=3)
    assert not (tmp_path / "out").exists()
    shown = polishing({**ALONE.rollouts[0].model_dump(), "demonstrators": ["driver"]})
    with pytest.raises(InputError, match=r"all rollouts .* are demonstrations"):
        Polish(CHECKPOINT, shown, tmp_path / "out", 2, seed=3)


@pytest.mark.usefixtures("few")
def test_the_command(tmp_path: Path) -> None:
    done = nathlon("polish", CHECKPOINT, "--rounds", "2", "--out", "p", "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout) == {"rounds": 2, "checkpoints": "p/checkpoints"}
    load_checkpoint(tmp_path / "p" / "checkpoints" / "round-00002.safetensors")
    refused(nathlon("polish", "none.safetensors", cwd=tmp_path), "none.safetensors", "No such file")
    refused(nathlon("polish", CHECKPOINT, "--config", "fast", cwd=tmp_path), "fast")


@pytest.mark.usefixtures("few")
def test_with_a_teacher_the_policy_learns_from_it_alone(tmp_path: Path) -> None:
    seen = drive(LOST)[0].seen
    before, moved = load_checkpoint(CHECKPOINT).network(seen), {}
    for teacher in ("driver", str(CHECKPOINT)):
        settings = LOST.model_copy(update={"polish": LOST.polish.model_copy(update={"teacher": teacher})})
        folder = tmp_path / Path(teacher).stem
        Polish(CHECKPOINT, settings, folder, 2, seed=3).run(lambda _: None)
        after = load_checkpoint(folder / "checkpoints" / "round-00002.safetensors").network(seen)
        moved[teacher] = np.abs(after - before).mean()
    # Who is its own teacher has nothing to learn.
    assert moved[str(CHECKPOINT)] < 0.2 * moved["driver"]
