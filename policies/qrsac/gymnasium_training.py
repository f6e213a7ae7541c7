"""QR-SAC on any Gymnasium environment with continuous observations and actions."""

from __future__ import annotations

from importlib.metadata import version
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import torch
from gymnasium.spaces import Box
from gymnasium.vector import AutoresetMode, VectorEnv
from numpy.typing import NDArray

from nathlon.policies.general.checkpoint import GeneralCard, save_general
from nathlon.policies.qrsac.config import QRSACConfig
from nathlon.policies.qrsac.learner import QRSAC
from nathlon.policies.replay_buffer.table import NStepReplay
from nathlon.sim.errors import InputError

Array = NDArray[np.float32]
Flags = NDArray[np.bool_]
Environments = VectorEnv[Any, Any, Any]


class Transitions(NamedTuple):
    """One step of each of n environments.

    Attributes:
        observation: (n, d) before the step.
        reward: (n,) float64.
        next_observation: (n, d) after the step, before any reset.
        terminated, truncated: (n,) as Gymnasium has them.
        valid: (n,) False where the environment only reset itself in this step and ignored the action.
    """

    observation: Array
    reward: NDArray[np.float64]
    next_observation: Array
    terminated: Flags
    truncated: Flags
    valid: Flags


class FlatEnvironments:
    """A vector environment with flat observations and actions in [-1, 1], whatever its autoreset mode.

    Attributes:
        observation: (n, d) what the environments show now.
        observation_size, action_size: lengths of one observation and one action.
    """

    def __init__(self, environments: Environments) -> None:
        """Wraps environments; `reset` comes before anything else.

        Raises:
            InputError: if the spaces are not boxes, the actions unbounded or the autoreset mode unknown.
        """
        seen, done = environments.single_observation_space, environments.single_action_space
        if not isinstance(seen, Box):
            raise InputError(f"environment: observation space is {seen}, expected a Box")
        if not isinstance(done, Box) or not done.is_bounded():
            raise InputError(f"environment: action space is {done}, expected a bounded Box")
        self._environments = environments
        try:
            self._mode = AutoresetMode(environments.metadata.get("autoreset_mode"))
        except ValueError as error:
            raise InputError(f"environment: metadata autoreset_mode: {error}") from None
        self._action_space = done
        self.count = environments.num_envs
        self.observation_size = int(np.prod(seen.shape))
        self.action_size = int(np.prod(done.shape))
        self.observation: Array
        self._resetting: Flags

    def reset(self, seed: int) -> None:
        """Starts all environments anew, the first with this seed, the others with the next ones."""
        observation, _ = self._environments.reset(seed=seed)
        self.observation = self._flat(observation)
        self._resetting = np.zeros(self.count, np.bool_)

    def step(self, actions: Array) -> Transitions:
        """Advances all environments; those that ended before start anew.

        Args:
            actions: (n, a) in [-1, 1], scaled to the environment's bounds.
        """
        low, high = self._action_space.low, self._action_space.high
        scaled = low + 0.5 * (actions.reshape(self.count, *low.shape) + 1.0) * (high - low)
        shown, reward, terminated, truncated, infos = self._environments.step(
            np.clip(scaled, low, high).astype(self._action_space.dtype)
        )
        ended = terminated | truncated
        reached = self._flat(shown)
        before, self.observation = self.observation, reached
        valid = ~self._resetting
        if self._mode is AutoresetMode.NEXT_STEP:
            self._resetting = ended
        elif ended.any():
            if self._mode is AutoresetMode.SAME_STEP:
                reached = reached.copy()
                reached[ended] = np.stack(list(infos["final_obs"][ended])).reshape(-1, self.observation_size)
            else:
                self.observation = self._flat(self._environments.reset(options={"reset_mask": ended})[0])
        return Transitions(before, reward, reached, terminated, truncated, valid)

    def _flat(self, observation: NDArray[Any]) -> Array:
        return np.array(observation, np.float32).reshape(self.count, self.observation_size)


class GymnasiumTraining:
    """QR-SAC that learns in the environments of one `VectorEnv`.

    Attributes:
        learner: the learner, on the CPU.
        steps: made so far, of all environments together.
    """

    def __init__(
        self,
        environments: Environments,
        config: QRSACConfig,
        seed: int,
        *,
        warm_up: int = 1_000,
        capacity: int = 1_000_000,
        updates: int = 1,
        compiled: bool = True,
    ) -> None:
        """A run at its beginning; equal arguments make equal runs.

        Args:
            environments: as `gymnasium.make_vec` makes them; of any autoreset mode.
            config: hyperparameters.
            seed: of the environments, the replay and the learner.
            warm_up: steps, of all environments together, with random actions and without updates.
            capacity: transitions that the replay keeps.
            updates: after each step of the vector environment.
            compiled: whether to compile the update.

        Raises:
            InputError: if the environments are not such that QR-SAC can act in them, or the capacity is
                too small for them.
        """
        starts, choices, learner = (
            int(part.generate_state(1)[0]) for part in np.random.SeedSequence(seed).spawn(3)
        )
        self.steps = 0
        self._seed = seed
        self._environments = FlatEnvironments(environments)
        self._rng = np.random.default_rng(choices)
        self._warm_up, self._updates = warm_up, updates
        sizes = self._environments.observation_size, self._environments.action_size
        self.learner = QRSAC(*sizes, config, torch.Generator().manual_seed(learner), compiled)
        self._replay = NStepReplay(capacity, self._environments.count, *sizes, config.n_step, config.gamma)
        self._environments.reset(starts)

    def advance(self, steps: int) -> None:
        """Trains over at least that many more steps, counted over all environments together."""
        end = self.steps + steps
        while self.steps < end:
            warm = self.steps >= self._warm_up
            actions = self._act() if warm else self._random()
            made = self._environments.step(actions)
            self._replay.add(
                made.observation,
                actions,
                made.reward.astype(np.float32),
                made.next_observation,
                made.terminated,
                made.truncated,
                made.valid,
            )
            self.steps += int(made.valid.sum())
            if warm:
                for _ in range(self._updates):
                    self.learner.update(self._replay.sample(self.learner.config.batch, self._rng))

    def save(self, path: Path) -> None:
        """Writes the policy, which acts by its mean, as `nathlon.policies.general.load_general` reads it.

        Args:
            path: the file, a `.safetensors`, replaced whole if it exists.

        Raises:
            InputError: if it cannot be written, or the policy is not finite as float16.
        """
        card = GeneralCard(
            algorithm="qr-sac",
            hidden=self.learner.config.hidden,
            observation_size=self._environments.observation_size,
            action_size=self._environments.action_size,
            step=self.learner.made,
            seed=self._seed,
            created_by={"nathlon": version("nathlon"), "torch": version("torch")},
        )
        try:
            save_general(path, self.learner.policy_tensors(), card)
        except OSError as error:
            raise InputError(f"{path}: cannot be written ({error.strerror})") from None

    def _act(self) -> Array:
        return self.learner.act(self._environments.observation, stochastic=True)

    def _random(self) -> Array:
        shape = self._environments.count, self._environments.action_size
        return self._rng.uniform(-1.0, 1.0, shape).astype(np.float32)


def evaluate(learner: QRSAC, environments: Environments, seed: int) -> NDArray[np.float64]:
    """Undiscounted returns (n,) of one episode in each environment, acting by the policy's mean.

    Args:
        learner: whose policy acts.
        environments: n of them, which must end their episodes.
        seed: of the first environment, the others follow.
    """
    flat = FlatEnvironments(environments)
    flat.reset(seed)
    returns, running = np.zeros(flat.count), np.ones(flat.count, np.bool_)
    while running.any():
        made = flat.step(learner.act(flat.observation, stochastic=False))
        returns += np.where(running, made.reward, 0.0)
        running &= ~(made.terminated | made.truncated)
    return returns
