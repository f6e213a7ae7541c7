"""Passages of runs, for policies that remember and need not see what their critics see."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from nathlon.policies.replay_buffer.table import Array, Flags, Numbers
from nathlon.policies.replay_buffer.tables import apportion, available_memory
from nathlon.sim.errors import InputError

Observations = NDArray[Any]
"""(n, d) numbers, or (n,) records of several parts."""


def parts(seen: Observations) -> tuple[NDArray[Any], ...]:
    """What is seen, each part an array of its own."""
    if seen.dtype.names is None:
        return (seen,)
    return tuple(np.ascontiguousarray(seen[name]) for name in seen.dtype.names)


class PassageBatch(NamedTuple):
    """Passages and the N-step transitions within them, passage by passage.

    A transition begins at each step but the first `recalled` ones, and none goes on beyond its passage. The
    first five are as of `nathlon.policies.replay_buffer.table.Batch`.

    Attributes:
        observation, next_observation: (n, c) float32, what the critics see.
        action: (n, a).
        reward: (n,).
        discount: (n,).
        seen: what the policy sees, each part (passages, length + 1, ...) of its own type.
        memory: (passages, m) float32, what the policy remembered before the first step.
    """

    observation: Tensor
    action: Tensor
    reward: Tensor
    discount: Tensor
    next_observation: Tensor
    seen: tuple[Tensor, ...]
    memory: Tensor

    def to(self, device: torch.device) -> PassageBatch:
        """The same on a device."""
        *others, seen, memory = self
        alike = (tensor.to(device) for tensor in others)
        return PassageBatch._make((*alike, tuple(part.to(device) for part in seen), memory.to(device)))

    @classmethod
    def join(cls, batches: Sequence[PassageBatch]) -> PassageBatch:
        """Several as one."""
        *others, seen, memory = zip(*batches, strict=True)
        alike = (torch.cat(column) for column in others)
        parts_of_all = tuple(torch.cat(column) for column in zip(*seen, strict=True))
        return cls._make((*alike, parts_of_all, torch.cat(memory)))


class Windows(NamedTuple):
    """How passages are cut into transitions.

    Attributes:
        length: steps of a passage.
        recalled: of these, the first ones, which only bring the memory up to date.
        n_step: steps of a full transition.
        gamma: discount of one step.
    """

    length: int
    recalled: int
    n_step: int
    gamma: float

    @property
    def firsts(self) -> Numbers:
        """(t,) the step at which each transition of a passage begins."""
        return np.arange(self.recalled, self.length)

    @property
    def lasts(self) -> Numbers:
        """(t,) the number of steps after which it ends."""
        return np.minimum(self.firsts + self.n_step, self.length)


class PassageReplay:
    """The newest steps of slots that run side by side, and what a policy remembered before each.

    What is seen is stored once. A passage lies within one run; that a true end (terminated) follows its last
    step counts, the step that cuts a run off (truncated) is left out, as what it led to is not stored.
    """

    def __init__(
        self,
        capacity: int,
        slots: int,
        seen: Observations,
        critic_size: int,
        action_size: int,
        memory: int,
        windows: Windows,
    ) -> None:
        """An empty table; memory is taken as it fills.

        Args:
            capacity: steps to hold, of all slots together.
            slots: cars side by side.
            seen: an example of what the policy sees, for its type and shape.
            critic_size: length of what the critics see.
            action_size: length of an action.
            memory: numbers that the policy remembers; 0 for none.
            windows: lengths of passages and transitions.

        Raises:
            InputError: if the capacity does not hold a passage of each slot, or memory does not hold it.
        """
        rows = capacity // slots
        if rows <= windows.length + 1:
            raise InputError(
                f"replay: capacity is {capacity}, expected at least {slots * (windows.length + 2)} "
                f"({slots} slots times a passage of {windows.length} steps)"
            )
        self.gathered = 0
        """Steps taken in so far, with those forgotten."""
        self._windows, self._time = windows, 0
        shapes: dict[str, tuple[tuple[int, ...], Any]] = {
            "critic": ((critic_size,), np.float16),
            "memory": ((memory,), np.float16),
            "action": ((action_size,), np.float32),
            "reward": ((), np.float32),
            "run": ((), np.int64),
            "terminated": ((), np.bool_),
            "whole": ((), np.bool_),
        }
        self.nbytes = rows * slots * seen.dtype.itemsize * int(np.prod(seen.shape[1:])) + sum(
            rows * slots * int(np.prod(shape)) * np.dtype(kind).itemsize for shape, kind in shapes.values()
        )
        """Bytes of memory that the full table takes."""
        if self.nbytes > (available := available_memory()):
            raise InputError(
                f"replay: {capacity} steps need {self.nbytes:,} bytes of memory, "
                f"expected at most the {available:,} available"
            )
        self._columns = {
            name: np.zeros((rows, slots, *shape), kind) for name, (shape, kind) in shapes.items()
        }
        self._seen = np.zeros((rows, slots, *seen.shape[1:]), seen.dtype)
        self._run = np.arange(slots)

    def add(
        self,
        seen: Observations,
        memory: Array,
        critic_seen: Array,
        action: Array,
        reward: Array,
        terminated: Flags,
        truncated: Flags,
        valid: Flags,
    ) -> None:
        """Takes in one step of all slots, as `NStepReplay.add`, but for what it leads to.

        Args:
            seen: (slots, ...) by the policy, before the step.
            memory: (slots, m) before the step.
            critic_seen: (slots, c) before the step.
            action, reward, terminated, truncated, valid: as there.
        """
        columns, length = self._columns, self._windows.length
        rows, slots = columns["run"].shape
        here, before, first = (at % rows for at in (self._time, self._time - 1, self._time - length))
        self._seen[here] = seen
        columns["memory"][here], columns["action"][here], columns["reward"][here] = memory, action, reward
        bound = np.finfo(np.float16).max
        columns["critic"][here] = np.clip(critic_seen, -bound, bound)
        columns["run"][here] = np.where(valid, self._run, -1)
        columns["terminated"][here] = terminated
        columns["whole"][here] = False
        if self._time >= length:
            run = columns["run"]
            goes_on = run[here] == run[first]
            ends = columns["terminated"][before] & (run[before] == run[first])
            columns["whole"][first] = (run[first] >= 0) & (goes_on | ends)
        # Of the step that cuts a run off only what was seen counts.
        self._run = np.where(terminated | truncated | ~valid, self._run + slots, self._run)
        self._time += 1
        self.gathered += int(valid.sum())

    def drop_open(self) -> None:
        """Has no run go on: a resumed run starts new ones."""
        self._run = self._run + len(self._run)

    def __len__(self) -> int:
        """Passages stored."""
        return int(self._columns["whole"].sum())

    def sample(self, passages: int, rng: np.random.Generator) -> PassageBatch:
        """So many stored passages, drawn with replacement and equal chances.

        Raises:
            ValueError: if none is stored yet.
        """
        columns, windows = self._columns, self._windows
        rows, slots = columns["run"].shape
        whole = np.flatnonzero(columns["whole"])
        if not len(whole):
            raise ValueError("cannot sample from a replay table without a passage")
        start, slot = np.divmod(whole[rng.integers(len(whole), size=passages)], slots)
        steps = (start[:, None] + np.arange(windows.length + 1)) % rows
        places = steps, slot[:, None]
        firsts, lasts = windows.firsts, windows.lasts
        # The sight after a true end is another run's, and does not count.
        ended = columns["terminated"][steps[:, -2], slot]
        discount = np.repeat(windows.gamma ** (lasts - firsts)[None], passages, axis=0)
        discount[ended] = np.where(lasts == windows.length, 0.0, discount[ended])
        rewards = columns["reward"][places][:, :-1].astype(np.float64)
        reward = np.stack(
            [
                rewards[:, first:last] @ windows.gamma ** np.arange(last - first)
                for first, last in zip(firsts, lasts, strict=True)
            ],
            axis=1,
        )
        critic = columns["critic"][places]

        def flat(values: NDArray[Any]) -> Tensor:
            return torch.from_numpy(values.astype(np.float32)).flatten(0, 1)

        return PassageBatch(
            flat(critic[:, firsts]),
            flat(columns["action"][places][:, firsts]),
            flat(reward),
            flat(discount),
            flat(critic[:, lasts]),
            tuple(map(torch.from_numpy, parts(self._seen[places]))),
            torch.from_numpy(columns["memory"][start, slot].astype(np.float32)),
        )


class PassageTables:
    """Tables of passages, and minibatches with a fixed share of each.

    Attributes:
        tables: to be added to.
        nbytes: of memory that the full tables take.
    """

    def __init__(self, tables: Sequence[PassageReplay], shares: Sequence[float], passages: int) -> None:
        """Of empty tables, positive weights of them, and passages of a minibatch.

        Raises:
            InputError: if a share comes to no passage.
        """
        self.tables = tuple(tables)
        self.nbytes = sum(table.nbytes for table in tables)
        self._shares = np.asarray(shares, np.float64) / np.sum(shares)
        self._counts = apportion(passages, shares)
        if not all(self._counts):
            raise InputError(
                f"replay: the shares {tuple(shares)} of {passages} passages are {tuple(self._counts)}, "
                "expected at least 1 of each table"
            )

    def ready(self, warm_up: int) -> bool:
        """Whether every table has a passage, and has gathered its share of `warm_up` steps."""
        needs = np.floor(warm_up * self._shares)
        return all(
            table.gathered >= need and len(table) > 0 for table, need in zip(self.tables, needs, strict=True)
        )

    def sample(self, rng: np.random.Generator) -> PassageBatch:
        """A minibatch, table by table.

        Raises:
            ValueError: if a table has no passage; see `ready`.
        """
        return PassageBatch.join(
            [table.sample(count, rng) for table, count in zip(self.tables, self._counts, strict=True)]
        )
