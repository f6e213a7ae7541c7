"""Polishing: what candidates drive and earn, where it leads, and going on after a stop."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from safetensors.numpy import load_file

from policies.bundled import BUNDLED
from policies.checkpoint import load_checkpoint, read_card
from policies.training import polish
from policies.training.config import TrainingConfig
from policies.training.evaluation import evaluate_laps
from policies.training.polish import Polish, Trial, ascent
from sim.errors import InputError
from tests.command_line import nathlon, refused
from tests.refusals import refusal

CHECKPOINT = BUNDLED / "lindenring" / "lindenring-wake-028k.safetensors"
COMMON = {
    "circuit": "lindenring",
    "car": "gt3",
    "updates": 1,
    "updates_per_step": 1,
    "warm_up": 1,
    "replay": 1,
}


def config(*rollouts: dict, **more: object) -> TrainingConfig:
    return TrainingConfig.model_validate({**COMMON, "checkpoint_every": 1, "rollouts": rollouts, **more})


ALONE = config({"scenario": "1v0", "races": 1, "learners": 1})
TRAFFIC = config({"scenario": "1v1", "races": 1, "learners": 1, "opponents": ["driver", "self", "past"]})


@pytest.fixture
def few(monkeypatch: pytest.MonkeyPatch) -> None:
    """Little is driven."""
    for name, value in {"CANDIDATES": 8, "RACES": 2, "HORIZON_S": 3.0, "CHECKPOINT_EVERY": 2}.items():
        monkeypatch.setattr(polish, name, value)


def polished(folder: Path, rounds: int, stop_after: int | None = None) -> None:
    work = Polish(CHECKPOINT, ALONE, folder, rounds, seed=3)

    def on_round(done: polish.Round) -> None:
        if done.rounds == stop_after:
            raise KeyboardInterrupt

    work.run(on_round)


@pytest.mark.usefixtures("few")
@pytest.mark.parametrize("settings", [ALONE, TRAFFIC], ids=["alone", "traffic"])
def test_candidates_drive_the_same_races(settings: TrainingConfig) -> None:
    """Who drives alike earns alike, to the last bit, and other starts earn something else."""
    network = load_checkpoint(CHECKPOINT).network
    trial = Trial(settings, settings.rollouts[0], 2, CHECKPOINT, threads=1)
    earned = trial.earn(network, np.random.default_rng(5))
    assert earned.shape == (8, 2)
    assert np.array_equal(earned, np.tile(earned[0], (8, 1)))
    assert earned[0, 0] != earned[0, 1]
    assert np.array_equal(trial.earn(network, np.random.default_rng(5)), earned)


@pytest.mark.usefixtures("few")
def test_each_candidate_drives_its_own_cars(tmp_path: Path) -> None:
    work = Polish(CHECKPOINT, ALONE, tmp_path / "out", 1, seed=1)
    network = load_checkpoint(CHECKPOINT).network
    seen = np.random.default_rng(0).normal(size=(16, 231)).astype(np.float32)
    changes = np.zeros((8, 256, 2))
    np.testing.assert_allclose(work._candidates(changes)(seen), network(seen), atol=1e-6)
    changes[3, :, 1] = 0.1
    actions = work._candidates(changes)(seen)
    differs = ~np.isclose(actions, network(seen), atol=1e-6)
    assert differs[6:8, 1].all()
    assert differs.sum() == 2


def test_reward_is_what_the_configuration_counts() -> None:
    network = load_checkpoint(CHECKPOINT).network
    rollouts = {"scenario": "1v0", "races": 1, "learners": 1}
    progress, half = (
        config(rollouts, reward={"progress": weight, "off_course": 0.0}) for weight in (1.0, 0.5)
    )
    earned = [
        Trial(each, each.rollouts[0], 1, CHECKPOINT, threads=1).earn(network, np.random.default_rng(1))
        for each in (progress, half)
    ]
    np.testing.assert_allclose(earned[0], 2.0 * earned[1])


def test_ascent_leads_to_what_earns_more() -> None:
    random = np.random.default_rng(0)
    wanted = random.standard_normal((5, 2))
    noise = random.standard_normal((32, 5, 2))
    noise = np.concatenate([noise, -noise])
    worth = np.tensordot(noise, wanted)
    earned = np.stack([100.0 + worth, -3.0 + 0.01 * worth, np.zeros(64)], axis=1)
    found = ascent(earned, noise)
    assert (found * wanted).sum() / np.linalg.norm(found) / np.linalg.norm(wanted) > 0.8
    assert ascent(np.ones((64, 3)), noise) == pytest.approx(0.0)


def test_a_polished_policy_laps_faster(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name, value in {"CANDIDATES": 32, "RACES": 4, "HORIZON_S": 30.0}.items():
        monkeypatch.setattr(polish, name, value)
    Polish(CHECKPOINT, ALONE, tmp_path, 25, seed=1).run(lambda _: None)
    found = tmp_path / "checkpoints" / "round-00025.safetensors"
    laps = []
    for path in (CHECKPOINT, found):
        policy = load_checkpoint(path)
        laps.append(evaluate_laps("lindenring", "gt3", policy.observation_spec, policy.network, seed=7))
    assert laps[1].lap_s < laps[0].lap_s - 0.05
    assert laps[1].off_course_share == 0.0
    card, before = read_card(found), read_card(CHECKPOINT)
    assert card.algorithm == "QR-SAC, polished"
    assert card.scenarios == tuple(dict.fromkeys((*before.scenarios, "1v0")))
    assert card.transitions == before.transitions + 25 * 32 * 4 * 300
    assert (card.step, card.seed, card.hidden) == (before.step, before.seed, before.hidden)
    tensors, old = load_file(found), load_file(CHECKPOINT)
    changed = [name for name in old if not np.array_equal(tensors[name], old[name])]
    assert changed == ["2.weight"]
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
    state.write_bytes(state.read_bytes()[:100])
    with refusal(state, "not the state of a polishing"):
        Polish(CHECKPOINT, ALONE, tmp_path, 2, seed=3)


@pytest.mark.usefixtures("few")
def test_a_checkpoint_of_another_circuit_is_refused(tmp_path: Path) -> None:
    elsewhere = BUNDLED / "porto-sereno" / "porto-sereno-cup-044k.safetensors"
    with refusal(elsewhere, "circuit is porto-sereno, expected lindenring"):
        Polish(elsewhere, ALONE, tmp_path / "out", 2, seed=3)
    assert not (tmp_path / "out").exists()
    shown = config({**ALONE.rollouts[0].model_dump(), "demonstrators": ["driver"]})
    with pytest.raises(InputError, match=r"all rollouts .* are demonstrations"):
        Polish(CHECKPOINT, shown, tmp_path / "out", 2, seed=3)


@pytest.mark.usefixtures("few")
def test_the_command(tmp_path: Path) -> None:
    done = nathlon("polish", CHECKPOINT, "--rounds", "2", "--out", "p", "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout) == {"rounds": 2, "checkpoints": "p/checkpoints"}
    load_checkpoint(tmp_path / "p" / "checkpoints" / "round-00002.safetensors")
    refused(nathlon("polish", "none.safetensors", cwd=tmp_path), "none.safetensors", "no such file")
    refused(nathlon("polish", CHECKPOINT, "--config", "fast", cwd=tmp_path), "fast")
