"""QR-SAC through passages: a policy that remembers, and critics that see more than it does."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
import torch
from gymnasium.spaces import Box, Dict
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from numpy.typing import NDArray

from nathlon.policies.general.checkpoint import load_general_checkpoint
from nathlon.policies.qrsac.config import QRSACConfig
from nathlon.policies.qrsac.gymnasium_training import GymnasiumTraining, evaluate
from nathlon.policies.qrsac.recurrent import RecurrentNetwork, act
from nathlon.policies.replay_buffer.passages import PassageReplay, Windows
from nathlon.sim.errors import InputError

SMALL = QRSACConfig(
    hidden=(16,),
    quantiles=2,
    n_step=1,
    gamma=0.9,
    alpha=0.003,
    critic_rate=2e-2,
    policy_rate=2e-2,
    polyak=0.1,
    batch=64,
    dropout=0.0,
    passage=3,
    recalled=0,
)
ASKED = 0.8


class Cue(gymnasium.Env[Any, NDArray[np.float32]]):
    """Shows a sign, then nothing; an action that is not 0.8 of that sign costs its square."""

    action_space = Box(-1.0, 1.0, (1,), np.float32)

    def __init__(self, told: bool) -> None:
        box = Box(-1.0, 1.0, (1,), np.float32)
        self.told = told
        self.observation_space = Dict({"observation": box, "critic_observation": box}) if told else box

    def _shown(self) -> Any:
        seen = np.array([self.sign if self.count == 0 else 0.0], np.float32)
        hidden = np.array([self.sign], np.float32)
        return {"observation": seen, "critic_observation": hidden} if self.told else seen

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> Any:
        super().reset(seed=seed)
        self.sign, self.count = float(self.np_random.choice([-1.0, 1.0])), 0
        return self._shown(), {}

    def step(self, action: NDArray[np.float32]) -> Any:
        self.count += 1
        cost = (float(action[0]) - ASKED * self.sign) ** 2 if self.count == 3 else 0.0
        return self._shown(), -cost, self.count == 3, False, {}


def cues(told: bool, count: int) -> SyncVectorEnv:
    return SyncVectorEnv([partial(Cue, told)] * count, autoreset_mode=AutoresetMode.SAME_STEP)


def trained(told: bool, memory: int, updates: int = 150) -> GymnasiumTraining:
    training = GymnasiumTraining(cues(told, 8), SMALL, 1, warm_up=160, memory=memory, capacity=4000)
    training.advance(160 + 8 * updates)
    return training


@pytest.mark.parametrize(
    ("told", "memory", "most_lost"),
    [(True, 8, (0.0, 0.1)), (False, 8, (0.5, 1.0)), (True, 0, (0.5, 1.0))],
    ids=["both", "critics see no more", "no memory"],
)
def test_an_old_sign_is_heeded_with_a_memory_and_critics_that_know_it(
    told: bool, memory: int, most_lost: tuple[float, float]
) -> None:
    returns = evaluate(trained(told, memory).learner, cues(told, 16), seed=5)
    least, most = most_lost
    assert least <= -returns.mean() <= most


def test_a_policy_that_remembers_is_kept_and_acts_as_it_did(tmp_path: Path) -> None:
    training = trained(told=True, memory=8, updates=1)
    training.save(tmp_path / "policy.safetensors")
    policy = load_general_checkpoint(tmp_path / "policy.safetensors")
    memory, kept = policy.initial_memory(4), np.zeros((4, 8), np.float32)
    for _ in range(3):
        seen = np.random.default_rng(1).normal(size=(4, 1)).astype(np.float32)
        numbers, memory = policy.act(seen, memory)
        actions, kept = training.learner.drive(seen, kept, stochastic=False)
        np.testing.assert_allclose(numbers, actions, atol=2e-3)
    assert np.abs(memory).max() > 0.01


def test_a_passage_gives_what_the_policy_gave_step_by_step() -> None:
    network = RecurrentNetwork.of_numbers(3, 5, (4,), 2)
    parameters = network.initial(torch.Generator().manual_seed(1))
    seen = np.random.default_rng(1).normal(size=(2, 6, 3)).astype(np.float32)
    memory, means = np.zeros((2, 5), np.float32), []
    for step in range(6):
        actions, memory = act(network, parameters, seen[:, step], memory, None)
        means.append(actions)
    outputs = network(parameters, [torch.from_numpy(seen)], torch.zeros(2, 5), recalled=2)
    np.testing.assert_allclose(torch.tanh(outputs[..., :2]), np.stack(means[2:], axis=1), atol=1e-6)


def filled(windows: Windows, steps: int, capacity: int) -> PassageReplay:
    """Of two slots that count; the first ends truly after every seventh step, the second is cut off then."""
    table = PassageReplay(capacity, 2, np.zeros((1, 1), np.float32), 1, 1, 1, windows)
    for step in range(steps):
        now = np.array([[step], [1000 + step]], np.float32)
        seventh = step % 7 == 6
        table.add(
            now, now / np.float32(1024), now, now, np.array([2.0**step % 97] * 2, np.float32),
            np.array([seventh, False]), np.array([False, seventh]), np.array([True, True]),
        )  # fmt: skip
    return table


def test_passages_hold_the_transitions_of_one_run() -> None:
    windows = Windows(length=4, recalled=1, n_step=2, gamma=0.5)
    table = filled(windows, 40, capacity=60)
    batch = table.sample(200, np.random.default_rng(1))
    first = batch.observation.reshape(200, 3).numpy()
    last = batch.next_observation.reshape(200, 3).numpy()
    start = batch.seen[0][:, 0, 0].numpy()
    np.testing.assert_allclose(batch.memory[:, 0] * 1024, start, atol=0.5)
    np.testing.assert_array_equal(first, start[:, None] + [1, 2, 3])
    assert start.min() >= 10  # thirty steps of each slot are kept
    ends = (start < 1000) & ((start + 3) % 7 == 6)
    assert ends.any()
    np.testing.assert_array_equal(last[~ends], start[~ends, None] + [3, 4, 4])
    # Nobody goes on into another run; the second slot's last step is not learnt from.
    assert ((start % 1000) // 7 == (start % 1000 + 3) // 7)[start < 1000].all()
    assert ((start % 1000) // 7 == (start % 1000 + 4) // 7)[start >= 1000].all()
    discount = batch.discount.reshape(200, 3).numpy()
    np.testing.assert_array_equal(discount[~ends], np.tile([0.25, 0.25, 0.5], ((~ends).sum(), 1)))
    np.testing.assert_array_equal(discount[ends], np.tile([0.25, 0.0, 0.0], (ends.sum(), 1)))
    rewards = 2.0 ** (first % 1000) % 97
    expected = rewards + 0.5 * np.append(rewards[:, 1:], np.zeros((200, 1)), axis=1)
    np.testing.assert_allclose(batch.reward.reshape(200, 3).numpy(), expected)


def test_a_table_without_a_whole_passage_says_so() -> None:
    with pytest.raises(ValueError, match="without a passage"):
        filled(Windows(4, 1, 2, 0.5), 3, 60).sample(1, np.random.default_rng(1))
    with pytest.raises(InputError, match=r"capacity is 10, expected at least 12 \(2 slots times"):
        filled(Windows(4, 1, 2, 0.5), 3, 10)
