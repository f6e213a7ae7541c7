"""Pairs of circuit and car: what is drawn, what is made, and a policy trained on them."""

from __future__ import annotations

import math
import shutil
from collections import Counter
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from nathlon.arena.entrance import home
from nathlon.arena.entrant import enter
from nathlon.policies.checkpoint import load_checkpoint, read_checkpoint
from nathlon.policies.sources.onnx import OnnxPolicy, export_onnx
from nathlon.policies.training import pairs, polish, trial
from nathlon.policies.training.config import TrainingConfig, Variety
from nathlon.policies.training.pairs import Pair, PairDraw, prepare
from nathlon.policies.training.polish import Polish, Round
from nathlon.policies.training.processes import start_processes
from nathlon.policies.training.rollout import tells_pace
from nathlon.policies.training.trainer import Trainer
from nathlon.sim.car import load_car
from nathlon.sim.car_family import PARENTS
from nathlon.sim.errors import InputError
from nathlon.sim.scenario import load_scenario
from nathlon.sim.track import load_track

pytestmark = pytest.mark.takes_long

CONFIG = TrainingConfig.model_validate(
    {
        "variety": {
            "pairs": 1,
            "held_out": 1,
            "first_seed": 2,
            "home": False,
            "slippery": 1.0,
            "stint_s": 1.0,
        },
        "updates": 8,
        "updates_per_step": 1,
        "warm_up": 60,
        "replay": 800,
        "checkpoint_every": 8,
        "rollouts": [{"scenario": "1v1", "races": 2, "worlds": 2, "learners": 1, "opponents": ["driver"]}],
        "observation": {"course_points": 3, "cars_ahead": 1, "cars_behind": 1, "version": 3},
        "qrsac": {"hidden": [8, 8], "encoder": [6, 4], "quantiles": 4, "batch": 16, "n_step": 3},
    }
)


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("variety") / "run"
    with pytest.MonkeyPatch.context() as patch:
        # Each takes longer to start than to make a pair.
        patch.setattr(pairs, "start_processes", partial(start_processes, 1))
        Trainer.start(folder, CONFIG, 1).run(lambda _: None)
    return folder


@pytest.fixture
def checkpoint(run: Path) -> Path:
    [path] = (run / "checkpoints").iterdir()
    return path


def test_what_goes_badly_is_drawn_more_often() -> None:
    cars = [Pair("lindenring", car, lap_s=100.0) for car in ("gt3", "coupe", "prototype")]
    draw = PairDraw(cars)
    rng = np.random.default_rng(0)
    full = load_track("lindenring").length / 100.0
    for _ in range(20):
        draw.note(cars[0], full)
        draw.note(cars[1], 0.85 * full)
    drawn = Counter(draw.draw(rng).car for _ in range(2000))
    # Weights 0.05, 0.2 and 1, of which 1 stands for what was never driven.
    expected = {"gt3": 80, "coupe": 320, "prototype": 1600}
    assert all(abs(drawn[car] - count) < 6 * count**0.5 for car, count in expected.items())


@pytest.mark.parametrize("weights", [[1.0, 1.0], [1.0, math.nan, 1.0], [1.0, 0.0, 1.0], [math.inf] * 3])
def test_weights_by_which_no_pair_can_be_drawn_are_refused(weights: list[float]) -> None:
    cars = [Pair("lindenring", car) for car in ("gt3", "coupe", "prototype")]
    with pytest.raises(InputError, match="expected 3 numbers above 0"):
        PairDraw(cars, np.array(weights))
    assert PairDraw(cars[:1], np.array([math.nan])).draw(np.random.default_rng(0)) == cars[0]


@pytest.mark.parametrize(
    ("scenario", "expected"),
    [("1v0", True), ("recovery", False), ("1v1", False), ("time_trial", True), ("tyre_care", False)],
)
def test_only_laps_alone_tell_how_well_a_pair_goes(scenario: str, expected: bool) -> None:
    assert tells_pace(load_scenario(scenario)) is expected


def test_drivers_practise_for_the_road_as_it_is() -> None:
    wet = Pair("lindenring", "gt3", 0.7)
    assert wet.wise("driver") == "driver:grip=0.7"
    assert wet.wise("driver:pace=0.9") == "driver:pace=0.9,grip=0.7"
    assert wet.wise("past") == "past"
    assert Pair("lindenring", "gt3").wise("driver:pace=0.9") == "driver:pace=0.9"


def test_pairs_are_made_once_and_those_held_out_are_others(run: Path) -> None:
    assert CONFIG.variety is not None
    before = {path: path.stat().st_mtime_ns for path in (run / "pairs").rglob("*")}
    told: list[tuple[int, int]] = []
    trained, held_out = prepare(run / "pairs", CONFIG.variety, lambda *ready: told.append(ready))
    assert told == [(2, 2)]
    assert {path: path.stat().st_mtime_ns for path in (run / "pairs").rglob("*")} == before
    assert len({pair.circuit for pair in trained + held_out}) == 2
    for pair in trained + held_out:
        assert 20.0 < pair.lap_s < 300.0
        assert 0.6 <= pair.grip <= 0.95


def test_a_note_that_is_none_is_named(tmp_path: Path) -> None:
    (tmp_path / "generated-5.json").write_text("{")
    with pytest.raises(InputError, match=r"generated-5\.json: expected the JSON of a circuit"):
        prepare(tmp_path, Variety(pairs=1, held_out=1, home=False, first_seed=5), lambda *_: None)


def test_a_policy_of_any_pair_drives_everywhere(run: Path, checkpoint: Path) -> None:
    policy = load_checkpoint(checkpoint)
    assert (policy.card.circuit, policy.card.car, policy.card.encoder) == ("any", "any", (6, 4))
    assert home(checkpoint) == (None, None)
    for place in (("lindenring", "gt3"), ("porto-sereno", "coupe")):
        entrant = enter(str(checkpoint), *place)
        assert (entrant.circuit, entrant.car) == place


def test_the_checkpoint_acts_as_the_learner_does(run: Path, checkpoint: Path, tmp_path: Path) -> None:
    policy = load_checkpoint(checkpoint)
    seen = np.random.default_rng(0).standard_normal((30, policy.observation_spec.size)).astype(np.float32)
    seen[:20, -policy.observation_spec.facts :] = seen[0, -policy.observation_spec.facts :]
    actions, _ = policy.act(seen, policy.initial_memory(30))
    learner = Trainer.resume(run).learner
    np.testing.assert_allclose(actions, learner.act(seen, stochastic=False), atol=2e-3)  # stored as float16
    export_onnx(policy, tmp_path / "policy.onnx")
    graph = OnnxPolicy.load(tmp_path / "policy.onnx")
    assert graph.card.circuit == "any"
    np.testing.assert_allclose(graph.act(seen, graph.initial_memory(30))[0], actions, atol=1e-6)


def polished(checkpoint: Path, folder: Path, rounds: int, stop_after: int | None = None) -> Path:
    def on_round(done: Round) -> None:
        if done.rounds == stop_after:
            raise KeyboardInterrupt

    Polish(checkpoint, CONFIG, folder, rounds, seed=3).run(on_round)
    return folder / "checkpoints" / f"round-{rounds:05d}.safetensors"


def test_a_policy_of_any_pair_is_polished_on_many(
    run: Path, checkpoint: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Encoder and all; and going on after a stop comes to the same, draw of pairs included."""
    for name, value in {"GROUP": 4, "HORIZON_S": 3.0, "UNTOLD_S": 1.0}.items():
        monkeypatch.setattr(trial, name, value)
    monkeypatch.setattr(polish, "STARTS", 3)
    for folder in ("whole", "halves"):
        shutil.copytree(run / "pairs", tmp_path / folder / "pairs")
    whole = polished(checkpoint, tmp_path / "whole", 3)
    with pytest.raises(KeyboardInterrupt):
        polished(checkpoint, tmp_path / "halves", 3, stop_after=1)
    assert whole.read_bytes() == polished(checkpoint, tmp_path / "halves", 3).read_bytes()
    card, tensors = read_checkpoint(whole)
    assert (card.circuit, card.encoder, card.algorithm) == ("any", (6, 4), "QR-SAC, polished")
    before = read_checkpoint(checkpoint)[1]
    assert [name for name, tensor in tensors.items() if np.array_equal(tensor, before[name])] == []


def test_on_loose_ground_a_shipped_car_has_tyres_that_peak_later(tmp_path: Path) -> None:
    seed = 2  # of the style whose circuits are short
    firm = Variety(pairs=1, slippery=1.0, shipped=1.0)
    assert pairs._generated(tmp_path, seed, firm).car in PARENTS
    loose = pairs._generated(tmp_path, seed, firm.model_copy(update={"loose": 1.0}))
    car = load_car(loose.car)
    parent = load_car(car.name)
    factor = car.tyre.peak_slip_ratio[0] / parent.tyre.peak_slip_ratio[0]
    assert 1.0 < factor < 3.5
    assert car.tyre.peak_slip_angle_rad[1] == pytest.approx(factor * parent.tyre.peak_slip_angle_rad[1])
    assert car.tyre.shape < parent.tyre.shape
    assert 0.22 <= loose.grip <= 0.8
