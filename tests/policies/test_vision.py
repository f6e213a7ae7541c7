"""Checkpoints that see: the network against PyTorch, the file, and races to the bit."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from pydantic import ValidationError

from nathlon.arena.entrant import enter
from nathlon.arena.results import POLICY_FAULTS
from nathlon.arena.runner import run_match
from nathlon.arena.single_race import single_race
from nathlon.arena.team import Team
from nathlon.policies.checkpoint import Card, SeeingPolicy, load_checkpoint, save_checkpoint
from nathlon.policies.driver import Driver
from nathlon.policies.load import load_policy
from nathlon.policies.training.seeing_actor import SeeingActor
from nathlon.policies.vision import Convolution, Vision
from nathlon.sim.camera_spec import CameraSpec
from nathlon.sim.observation import ObservationSpec
from tests.support.refusals import refusal

SPEC = ObservationSpec(camera=CameraSpec(width=40, height=36))
SMALL = (Convolution(filters=4, side=8, stride=4), Convolution(filters=6, side=3, stride=2))


def card(memory: int = 5, **facts: Any) -> Card:
    vision = Vision(convolutions=SMALL, features=7, memory=memory)
    told: dict[str, Any] = {
        "format": 2,
        "algorithm": "test",
        "hidden": (6,),
        "vision": vision,
        "observation": SPEC,
        "circuit": "lindenring",
        "car": "gt3",
        "scenarios": ("1v0",),
        "step": 1,
        "transitions": 2,
        "seed": 3,
        "created_by": {},
    }
    return Card(**(told | facts))


def tensors(card: Card) -> dict[str, np.ndarray]:
    """Weights that float16 holds exactly."""
    rng = np.random.default_rng(7)
    drawn = {name: rng.normal(0.0, 0.2, shape) for name, shape in card.shapes.items()}
    return {name: each.astype(np.float16).astype(np.float32) for name, each in drawn.items()}


@pytest.fixture
def path(tmp_path: Path) -> Path:
    path = tmp_path / "eye.safetensors"
    save_checkpoint(path, tensors(card()), card())
    return path


def seen(n: int = 3) -> np.ndarray:
    rng, blank = np.random.default_rng(1), SPEC.blank(n)
    blank["picture"] = rng.integers(0, 256, blank["picture"].shape)
    blank["sensors"] = rng.normal(size=blank["sensors"].shape)
    return blank


def expected(card: Card, own: dict[str, np.ndarray], seen: np.ndarray, memory: np.ndarray) -> Any:
    """Actions and memory as PyTorch computes them."""
    weights = {name: torch.from_numpy(each) for name, each in own.items()}
    now = torch.from_numpy(seen["picture"].copy()).permute(0, 3, 1, 2).float() / 255.0
    for index, layer in enumerate(SMALL):
        weight, bias = weights[f"vision.{index}.weight"], weights[f"vision.{index}.bias"]
        now = torch.relu(torch.nn.functional.conv2d(now, weight, bias, layer.stride))
    now = torch.relu(now.flatten(1) @ weights["vision.features.weight"] + weights["vision.features.bias"])
    now = torch.cat([now, torch.from_numpy(seen["sensors"].copy())], dim=1)
    kept = torch.from_numpy(memory)
    if card.vision and card.vision.memory:
        cell = torch.nn.GRUCell(now.shape[1], card.vision.memory)
        cell.load_state_dict(
            {
                "weight_ih": weights["vision.memory.inputs"].T,
                "weight_hh": weights["vision.memory.own"].T,
                "bias_ih": weights["vision.memory.inputs_bias"],
                "bias_hh": weights["vision.memory.own_bias"],
            }
        )
        now = kept = cell(now, kept)
    now = torch.relu(now @ weights["0.weight"] + weights["0.bias"])
    actions = torch.tanh(now @ weights["1.weight"][:, :2] + weights["1.bias"][:2])
    return actions.detach().numpy(), kept.detach().numpy()


@pytest.mark.parametrize("memory", [0, 5])
def test_the_network_computes_what_pytorch_does(memory: int) -> None:
    own = tensors(card(memory))
    policy = SeeingPolicy(card(memory), "id", own)
    kept = policy.initial_memory(3)
    assert kept.shape == (3, memory)
    for _ in range(2):
        wanted, then = expected(card(memory), own, seen(), kept)
        actions, kept = policy.act(seen(), kept)
        np.testing.assert_allclose(actions, wanted, atol=1e-6)
        np.testing.assert_allclose(kept, then, atol=1e-6)


def test_what_a_picture_comes_to_is_the_same_to_the_bit_in_any_batch() -> None:
    policy = SeeingPolicy(card(), "id", tensors(card()))
    many = seen(9)
    memory = np.random.default_rng(2).normal(size=(9, 5)).astype(np.float32)
    together = policy.act(many, memory)
    for row in range(9):
        alone = policy.act(many[row : row + 1], memory[row : row + 1])
        assert all(np.array_equal(each[0], all_[row]) for each, all_ in zip(alone, together, strict=True))


@pytest.mark.parametrize("memory", [0, 5])
def test_the_network_in_training_computes_the_same(memory: int) -> None:
    own = tensors(card(memory))
    actor, policy = SeeingActor(card(memory), own), SeeingPolicy(card(memory), "id", own)
    steps, kept = [seen(4)[turn : turn + 2] for turn in range(3)], np.ones((2, memory), np.float32)
    pictures, sensors = (
        torch.from_numpy(np.stack([step[name] for step in steps], axis=1)) for name in ("picture", "sensors")
    )
    known, after = actor.recall(pictures, sensors, torch.from_numpy(kept))
    means = actor.actions(known).detach().numpy()
    for turn, step in enumerate(steps):
        again = actor.means(*actor.inputs(step, kept))
        actions, kept = policy.act(step, kept)
        np.testing.assert_allclose(means[:, turn], actions, atol=1e-5)
        np.testing.assert_allclose(again.detach().numpy(), actions, atol=1e-5)
    np.testing.assert_allclose(after.detach().numpy(), kept, atol=1e-5)


def test_a_file_gives_back_what_was_saved(path: Path) -> None:
    policy = load_policy(str(path), "lindenring", "gt3")
    assert isinstance(policy, SeeingPolicy)
    assert policy.card == card()
    assert policy.observation_spec == SPEC
    same = SeeingPolicy(card(), "id", tensors(card()))
    np.testing.assert_array_equal(
        policy.act(seen(), policy.initial_memory(3))[0], same.act(seen(), same.initial_memory(3))[0]
    )


def test_a_card_without_a_camera_is_written_as_before() -> None:
    plain = card(vision=None, format=1, observation=ObservationSpec(course_points=2))
    told = json.loads(plain.model_dump_json())
    assert "vision" not in told
    assert "camera" not in told["observation"]


@pytest.mark.parametrize(
    ("facts", "said"),
    [
        ({"format": 1}, "format is 1, expected 2 with vision"),
        ({"vision": None}, "belong together"),
        ({"observation": ObservationSpec()}, "belong together"),
        ({"vision": Vision(convolutions=(SMALL[0],) * 3)}, "leave nothing of 36 x 40 pixels"),
    ],
)
def test_a_card_that_contradicts_itself_is_refused(facts: dict[str, Any], said: str) -> None:
    with pytest.raises(ValidationError, match=said):
        card(**facts)


def test_who_needs_numbers_refuses_it(path: Path) -> None:
    with refusal(path, "sees by a camera, expected a policy that is told numbers"):
        load_checkpoint(path)
    with refusal(path, "sees by a camera"):
        load_policy(f"mppi:{path}?objective=-kerb", "lindenring", "gt3")


def test_it_races_the_same_to_the_bit_and_remembers(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    memories: list[np.ndarray] = []
    act = Team.act

    def noted(team: Team, *arguments: Any) -> Any:
        answer = act(team, *arguments)
        if isinstance(team.policy, SeeingPolicy) and team._memory is not None:
            memories.append(team._memory)
        return answer

    monkeypatch.setattr(Team, "act", noted)
    entrants = [enter(source, "lindenring", "gt3") for source in (str(path), "driver")]
    match = single_race(entrants, "slipstream_pass", seed=1)
    policies = [load_policy(str(path), "lindenring", "gt3"), Driver("lindenring", "gt3")]
    results = [run_match(match, policies) for _ in range(2)]
    assert results[0].equals(results[1])
    assert not results[0]["ending"].is_in(POLICY_FAULTS).any()
    assert len({memory.tobytes() for memory in memories}) > 20
