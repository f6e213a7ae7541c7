"""N-step transitions and the ring buffer that keeps them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from sim.errors import InputError

Array = NDArray[np.float32]
Flags = NDArray[np.bool_]


class Batch(NamedTuple):
    """Transitions, one a row, all float32.

    Attributes:
        observation: (n, d) at the first step of the window.
        action: (n, a) taken there.
        reward: (n,) sum of gamma^i times the reward of step i, over the k steps of the window.
        discount: (n,) gamma^k, or 0 where the window ended in a true end.
        next_observation: (n, d) after the window's last step.
    """

    observation: Tensor
    action: Tensor
    reward: Tensor
    discount: Tensor
    next_observation: Tensor


class NStepReplay:
    """Ring buffer of the N-step transitions of slots that run side by side; a slot is one car of one run.

    A window opens at each step of a slot. It closes after `n_step` steps, or earlier at the end of the
    run: with discount 0 if the end was a true one (terminated), with gamma^k after k steps if the run was
    cut off (truncated). No window crosses an end.
    """

    def __init__(
        self, capacity: int, slots: int, observation_size: int, action_size: int, n_step: int, gamma: float
    ) -> None:
        """An empty buffer for `capacity` transitions.

        Raises:
            InputError: if the capacity cannot hold what a single step of all slots can close.
        """
        if capacity < slots * n_step:
            raise InputError(
                f"replay: capacity is {capacity}, expected at least {slots * n_step} "
                f"({slots} slots times {n_step} steps)"
            )
        self.capacity = capacity
        self._stored = Batch(
            observation=torch.empty(capacity, observation_size),
            action=torch.empty(capacity, action_size),
            reward=torch.empty(capacity),
            discount=torch.empty(capacity),
            next_observation=torch.empty(capacity, observation_size),
        )
        self._columns = [column.numpy() for column in self._stored]
        self._size = 0
        self._head = 0
        # The windows of all slots that opened at time t stand in column t % n_step.
        self._time = 0
        self._open = np.zeros(slots, np.int64)
        self._observation = np.zeros((slots, n_step, observation_size), np.float32)
        self._action = np.zeros((slots, n_step, action_size), np.float32)
        self._reward = np.zeros((slots, n_step))
        self._powers = gamma ** np.arange(n_step + 1, dtype=np.float64)

    def __len__(self) -> int:
        """Transitions stored."""
        return self._size

    @property
    def nbytes(self) -> int:
        """Bytes of memory that the full buffer takes."""
        windows = (self._observation, self._action, self._reward, self._open)
        return sum(column.nbytes for column in self._stored) + sum(array.nbytes for array in windows)

    def add(
        self,
        observation: Array,
        action: Array,
        reward: Array,
        next_observation: Array,
        terminated: Flags,
        truncated: Flags,
        valid: Flags | None = None,
    ) -> None:
        """Takes in one step of all slots.

        Args:
            observation: (slots, d) before the step.
            action: (slots, a).
            reward: (slots,).
            next_observation: (slots, d) after the step, before any reset.
            terminated: (slots,) whether the step led to a true end; counts before `truncated`.
            truncated: (slots,) whether the run was cut off after the step.
            valid: (slots,) whether the slot was driven in this step; the open windows of one that was
                not are dropped. None for all.
        """
        n_step = self._reward.shape[1]
        column = self._time % n_step
        age = (self._time - np.arange(n_step)) % n_step
        self._observation[:, column] = observation
        self._action[:, column] = action
        self._reward[:, column] = 0.0
        self._reward += self._powers[age] * np.asarray(reward)[:, None]
        self._open += 1
        if valid is not None:
            self._open[~valid] = 0

        ended = terminated | truncated
        closing = (age < self._open[:, None]) & (ended[:, None] | (age == n_step - 1))
        slot, window = np.nonzero(closing)
        bootstrap = np.where(terminated[slot], 0.0, self._powers[age[window] + 1])
        self._store(
            self._observation[slot, window],
            self._action[slot, window],
            self._reward[slot, window],
            bootstrap,
            next_observation[slot],
        )
        self._open = np.where(ended, 0, np.minimum(self._open, n_step - 1))
        self._time += 1

    def _store(self, *columns: NDArray) -> None:
        count = len(columns[0])
        rows = (self._head + np.arange(count)) % self.capacity
        for stored, new in zip(self._columns, columns, strict=True):
            stored[rows] = new
        self._head = (self._head + count) % self.capacity
        self._size = min(self._size + count, self.capacity)

    def stored(self) -> Batch:
        """All stored transitions, in the order of the ring: views, not copies."""
        return Batch(*(column[: self._size] for column in self._stored))

    def sample(self, batch: int, rng: np.random.Generator) -> Batch:
        """`batch` stored transitions, drawn with replacement and equal chances.

        Raises:
            ValueError: if nothing is stored yet.
        """
        if not self._size:
            raise ValueError("cannot sample from an empty replay buffer")
        rows = torch.from_numpy(rng.integers(self._size, size=batch))
        return Batch(*(column.index_select(0, rows) for column in self._stored))
