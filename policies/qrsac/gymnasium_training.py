"""QR-SAC on any Gymnasium environment with continuous observations and actions.

An environment may show its critics more than its policy: its observations are then a Dict of `observation`,
which the policy sees, and `critic_observation`, which its critics see instead.
"""

from __future__ import annotations

from importlib.metadata import version
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import torch
from gymnasium.spaces import Box, Dict
from gymnasium.vector import AutoresetMode, VectorEnv
from numpy.typing import NDArray

from nathlon.policies.general.checkpoint import GeneralCard, save_general
from nathlon.policies.qrsac.config import QRSACConfig
from nathlon.policies.qrsac.learner import QRSAC
from nathlon.policies.qrsac.recurrent import RecurrentNetwork
from nathlon.policies.qrsac.update import Minibatch, passages_of, windows_of
from nathlon.policies.replay_buffer.passages import PassageReplay
from nathlon.policies.replay_buffer.table import NStepReplay
from nathlon.sim.errors import InputError

Array = NDArray[np.float32]
Flags = NDArray[np.bool_]
Environments = VectorEnv[Any, Any, Any]
PARTS = "observation", "critic_observation"
"""Of what an environment shows that shows its critics something else."""


class Transitions(NamedTuple):
    """One step of each of n environments.

    Attributes:
        observation: (n, d) before the step: what the policy sees, then what its critics see instead, if any.
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
        observation: (n, d) what the environments show now, see `Transitions`.
        observation_size, critic_size, action_size: lengths of what the policy sees, of what its critics see
            instead, 0 if they see the same, and of an action.
    """

    def __init__(self, environments: Environments) -> None:
        """Wraps environments; `reset` comes before anything else.

        Raises:
            InputError: if the spaces are not boxes, the actions unbounded or the autoreset mode unknown.
        """
        shown, done = environments.single_observation_space, environments.single_action_space
        boxes = (
            [shown[name] for name in PARTS]
            if isinstance(shown, Dict) and set(shown) == set(PARTS)
            else [shown]
        )
        if not all(isinstance(box, Box) for box in boxes):
            raise InputError(
                f"environment: observation space is {shown}, expected a Box, or a Dict of two named "
                f"{' and '.join(PARTS)}"
            )
        if not isinstance(done, Box) or not done.is_bounded():
            raise InputError(f"environment: action space is {done}, expected a bounded Box")
        self._environments = environments
        try:
            self._mode = AutoresetMode(environments.metadata.get("autoreset_mode"))
        except ValueError as error:
            raise InputError(f"environment: metadata autoreset_mode: {error}") from None
        self._action_space = done
        self.count = environments.num_envs
        self.observation_size, *critic = (int(np.prod(box.shape)) for box in boxes if isinstance(box, Box))
        self.critic_size = critic[0] if critic else 0
        self.action_size = int(np.prod(done.shape))
        self.observation: Array
        self._resetting: Flags

    def reset(self, seed: int) -> None:
        """Starts all environments anew, the first with this seed, the others with the next ones."""
        observation, _ = self._environments.reset(seed=seed)
        self.observation = self._flat(observation)
        self._resetting = np.zeros(self.count, np.bool_)

    def parted(self, observation: Array) -> tuple[Array, Array]:
        """What the policy sees of rows (n, d), and what its critics see."""
        seen = observation[:, : self.observation_size]
        return seen, observation[:, self.observation_size :] if self.critic_size else seen

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
                reached[ended] = [_row(final) for final in infos["final_obs"][ended]]
            else:
                self.observation = self._flat(self._environments.reset(options={"reset_mask": ended})[0])
        return Transitions(before, reward, reached, terminated, truncated, valid)

    def _flat(self, observation: NDArray[Any] | dict[str, NDArray[Any]]) -> Array:
        if not isinstance(observation, dict):
            return np.array(observation, np.float32).reshape(self.count, -1)
        return np.concatenate([self._flat(observation[part]) for part in PARTS], axis=1)


def _row(observation: NDArray[Any] | dict[str, NDArray[Any]]) -> Array:
    """One observation, flat."""
    if not isinstance(observation, dict):
        return np.asarray(observation, np.float32).ravel()
    return np.concatenate([_row(observation[part]) for part in PARTS])


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
        memory: int = 0,
    ) -> None:
        """A run at its beginning; equal arguments make equal runs.

        Args:
            environments: as `gymnasium.make_vec` makes them; of any autoreset mode.
            config: hyperparameters.
            seed: of the environments, the replay and the learner.
            warm_up: steps, of all environments together, with random actions and without updates.
            capacity: transitions that the replay keeps.
            updates: after each step of the vector environment.
            compiled: whether to compile the update; one that goes through passages never is.
            memory: units of the policy's gated recurrent unit; 0 for a policy that remembers nothing.

        Raises:
            InputError: if the environments are not such that QR-SAC can act in them, or the capacity is
                too small for them.
        """
        starts, choices, learner = (
            int(part.generate_state(1)[0]) for part in np.random.SeedSequence(seed).spawn(3)
        )
        self.steps = 0
        self._seed = seed
        self._environments = flat = FlatEnvironments(environments)
        self._rng = np.random.default_rng(choices)
        self._warm_up, self._updates = warm_up, updates
        seen, done = flat.observation_size, flat.action_size
        hidden = flat.critic_size or seen
        self._recurrent = (
            RecurrentNetwork.of_numbers(seen, memory, config.hidden, done)
            if memory or flat.critic_size
            else None
        )
        self.learner = QRSAC(
            hidden, done, config, torch.Generator().manual_seed(learner), compiled, recurrent=self._recurrent
        )
        self._memory = np.zeros((flat.count, memory), np.float32)
        self._replay: NStepReplay | PassageReplay
        if self._recurrent is None:
            self._replay = NStepReplay(capacity, flat.count, seen, done, config.n_step, config.gamma)
        else:
            example = np.zeros((1, seen), np.float32)
            self._replay = PassageReplay(
                capacity, flat.count, example, hidden, done, memory, windows_of(config)
            )
        flat.reset(starts)

    def advance(self, steps: int) -> None:
        """Trains over at least that many more steps, counted over all environments together."""
        end = self.steps + steps
        while self.steps < end:
            warm = self.steps >= self._warm_up
            memory = self._memory
            if warm or self._recurrent:
                actions = self._act()
            if not warm:
                actions = self._random()
            made = self._environments.step(actions)
            self._remember(made, actions, memory)
            self._memory[made.terminated | made.truncated | ~made.valid] = 0.0
            self.steps += int(made.valid.sum())
            if warm:
                for _ in range(self._updates):
                    self.learner.update(self._sample())

    def _act(self) -> Array:
        """Actions of the policy, which remembers them."""
        seen, _ = self._environments.parted(self._environments.observation)
        actions, self._memory = self.learner.drive(seen, self._memory, stochastic=True)
        return actions

    def _remember(self, made: Transitions, actions: Array, memory: Array) -> None:
        reward, ends = made.reward.astype(np.float32), (made.terminated, made.truncated, made.valid)
        if isinstance(self._replay, NStepReplay):
            self._replay.add(made.observation, actions, reward, made.next_observation, *ends)
        else:
            seen, hidden = self._environments.parted(made.observation)
            self._replay.add(seen, memory, hidden, actions, reward, *ends)

    def _sample(self) -> Minibatch:
        config = self.learner.config
        return self._replay.sample(passages_of(config) if self._recurrent else config.batch, self._rng)

    def save(self, path: Path) -> None:
        """Writes the policy, which acts by its mean, as `nathlon.policies.general.load_general` reads it.

        Args:
            path: the file, a `.safetensors`, replaced whole if it exists.

        Raises:
            InputError: if it cannot be written, or the policy is not finite as float16.
        """
        memory = self._memory.shape[1]
        card = GeneralCard(
            format=2 if memory else 1,
            algorithm="qr-sac",
            hidden=self.learner.config.hidden,
            observation_size=self._environments.observation_size,
            action_size=self._environments.action_size,
            memory=memory,
            step=self.learner.made,
            seed=self._seed,
            created_by={"nathlon": version("nathlon"), "torch": version("torch")},
        )
        try:
            save_general(path, self.learner.policy_tensors(), card)
        except OSError as error:
            raise InputError(f"{path}: cannot be written ({error.strerror})") from None

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
    memory = np.zeros((flat.count, learner.memory), np.float32)
    returns, running = np.zeros(flat.count), np.ones(flat.count, np.bool_)
    while running.any():
        actions, memory = learner.drive(flat.parted(flat.observation)[0], memory, stochastic=False)
        made = flat.step(actions)
        returns += np.where(running, made.reward, 0.0)
        running &= ~(made.terminated | made.truncated)
    return returns
