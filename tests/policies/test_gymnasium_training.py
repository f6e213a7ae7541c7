"""QR-SAC on environments that have nothing to do with racing."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.spaces import Box, Discrete
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from numpy.typing import NDArray

from nathlon.policies.qrsac.config import QRSACConfig
from nathlon.policies.qrsac.gymnasium_training import FlatEnvironments, GymnasiumTraining, evaluate
from nathlon.sim.errors import InputError

SMALL = QRSACConfig(
    hidden=(16, 16),
    quantiles=4,
    n_step=3,
    gamma=0.9,
    alpha=0.02,
    critic_rate=5e-3,
    policy_rate=5e-3,
    polyak=0.05,
    batch=64,
    dropout=0.0,
)


class Counter(gymnasium.Env[NDArray[np.float64], NDArray[np.float32]]):
    """Shows episode and step. Even episodes end truly after three steps, odd ones are cut off after two."""

    observation_space = Box(-np.inf, np.inf, (2, 1), np.float64)
    action_space = Box(np.array([-2.0, 0.0], np.float32), np.array([6.0, 1.0], np.float32))

    def __init__(self) -> None:
        self.episode, self.count = -1, 0

    def _seen(self) -> NDArray[np.float64]:
        return np.array([[self.episode], [self.count]], np.float64)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float64], dict[str, Any]]:
        self.episode, self.count = self.episode + 1, 0
        return self._seen(), {}

    def step(
        self, action: NDArray[np.float32]
    ) -> tuple[NDArray[np.float64], float, bool, bool, dict[str, Any]]:
        self.count += 1
        odd = self.episode % 2 == 1
        return self._seen(), float(action[0]), not odd and self.count == 3, odd and self.count == 2, {}


class Target(gymnasium.Env[NDArray[np.float32], NDArray[np.float32]]):
    """A point on a line, moved by at most 0.5 a step, loses its distance from 0 in each of eight steps."""

    observation_space = Box(-4.0, 4.0, (1,), np.float32)
    action_space = Box(-0.5, 0.5, (1,), np.float32)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        super().reset(seed=seed)
        self.start = self.place = self.np_random.uniform(-2.0, 2.0, 1)
        self.count = 0
        return self.place.astype(np.float32), {}

    def step(
        self, action: NDArray[np.float32]
    ) -> tuple[NDArray[np.float32], float, bool, bool, dict[str, Any]]:
        self.place = np.clip(self.place + action, -4.0, 4.0)
        self.count += 1
        return self.place.astype(np.float32), -float(abs(self.place[0])), False, self.count == 8, {}


def counters(mode: AutoresetMode) -> SyncVectorEnv:
    return SyncVectorEnv([Counter, Counter], autoreset_mode=mode)


def targets(count: int) -> SyncVectorEnv:
    return SyncVectorEnv([Target] * count)


@pytest.mark.parametrize("mode", AutoresetMode)
def test_transitions_end_where_the_episode_does(mode: AutoresetMode) -> None:
    environments = FlatEnvironments(counters(mode))
    environments.reset(0)
    steps = 12 if mode is AutoresetMode.NEXT_STEP else 9
    made = [environments.step(np.zeros((2, 2), np.float32)) for _ in range(steps)]
    found = [
        (
            *(int(value) for value in (*step.observation[1], *step.next_observation[1])),
            *(bool(flag) for flag in (step.terminated[1], step.truncated[1])),
        )
        for step in made
        if step.valid[1]
    ]
    assert found == [
        (0, 0, 0, 1, False, False),
        (0, 1, 0, 2, False, False),
        (0, 2, 0, 3, True, False),
        (1, 0, 1, 1, False, False),
        (1, 1, 1, 2, False, True),
        (2, 0, 2, 1, False, False),
        (2, 1, 2, 2, False, False),
        (2, 2, 2, 3, True, False),
        (3, 0, 3, 1, False, False),
    ]


def test_actions_are_scaled_to_the_environment() -> None:
    environments = FlatEnvironments(counters(AutoresetMode.NEXT_STEP))
    environments.reset(0)
    rewards = [
        environments.step(np.array([[value, 0.0], [0.0, 0.0]], np.float32)).reward for value in (-1, 0.5)
    ]
    np.testing.assert_allclose(rewards, [[-2.0, 2.0], [4.0, 2.0]])


@pytest.mark.parametrize("mode", AutoresetMode)
def test_only_the_first_episode_counts(mode: AutoresetMode) -> None:
    learner = GymnasiumTraining(counters(mode), SMALL, 0, compiled=False).learner
    returns = evaluate(learner, counters(mode), 0)
    seen = np.array([[0, 0], [0, 1], [0, 2]], np.float32)
    expected = (-2.0 + 4.0 * (learner.act(seen, stochastic=False)[:, 0] + 1.0)).sum()
    np.testing.assert_allclose(returns, expected, rtol=1e-5)


def test_it_learns() -> None:
    """The best policy goes straight to the target: its return follows from the start."""
    training = GymnasiumTraining(targets(4), SMALL, seed=1, warm_up=400, capacity=10_000, compiled=False)
    before = evaluate(training.learner, targets(20), seed=100).mean()
    training.advance(1600)
    after = evaluate(training.learner, targets(20), seed=100).mean()
    starts = np.abs([Target().reset(seed=100 + i)[0][0] for i in range(20)])
    best = -np.maximum(starts[:, None] - 0.5 * np.arange(1, 9), 0.0).sum(1).mean()
    assert before < best - 2.0
    assert best - 0.5 < after <= best + 1e-6


def test_the_seed_decides() -> None:
    states = []
    for seed in (3, 3, 4):
        training = GymnasiumTraining(targets(2), SMALL, seed, warm_up=10, capacity=100, compiled=False)
        training.advance(30)
        states.append(training.learner.state_dict())
    assert all(tensor.equal(states[1][name]) for name, tensor in states[0].items())
    assert not states[0]["policy"].equal(states[2]["policy"])


def test_steps_in_which_an_environment_resets_are_not_counted() -> None:
    training = GymnasiumTraining(targets(1), SMALL, 0, warm_up=1000, capacity=100, compiled=False)
    training.advance(16)
    assert training.steps == 16
    assert len(training._replay) == 16


class Wrong(Counter):
    observation_space = Discrete(3)  # type: ignore[assignment]


class Unbounded(Counter):
    action_space = Box(-np.inf, np.inf, (1,), np.float32)


@pytest.mark.parametrize(
    ("kind", "message"),
    [
        (Wrong, r"observation space is Discrete\(3\), expected a Box"),
        (Unbounded, r"action space is Box\(-inf.*, expected a bounded Box"),
    ],
)
def test_other_spaces_are_refused(kind: type[Counter], message: str) -> None:
    with pytest.raises(InputError, match=message):
        FlatEnvironments(SyncVectorEnv([kind]))


def test_an_unknown_autoreset_mode_is_refused() -> None:
    environments = targets(1)
    environments.metadata = {}
    with pytest.raises(InputError, match="autoreset_mode"):
        FlatEnvironments(environments)
