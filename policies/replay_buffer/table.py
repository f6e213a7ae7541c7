"""N-step transitions and the table that keeps them."""

from __future__ import annotations

from math import prod
from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import DTypeLike, NDArray
from torch import Tensor

from nathlon.sim.errors import InputError

ENDS = 1 / 8
"""A full table holds its capacity as long as a smaller share of the steps ends a run."""

Array = NDArray[np.float32]
Flags = NDArray[np.bool_]
Numbers = NDArray[np.int64]


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

    def to(self, device: torch.device) -> Batch:
        """The same on a device."""
        return Batch(*(tensor.to(device) for tensor in self))

    @classmethod
    def empty(cls, count: int, observation_size: int, action_size: int) -> Batch:
        """Room for `count` transitions."""
        observation, action = (count, observation_size), (count, action_size)
        shapes = (observation, action, (count,), (count,), observation)
        return cls(*(torch.empty(shape) for shape in shapes))


def _margin(slots: int, n_step: int) -> int:
    """Rows that can be written from the opening of a window to its end."""
    return 2 * slots * (n_step + 1)


def _columns(
    capacity: int, slots: int, observation_size: int, action_size: int, n_step: int, dtype: DTypeLike
) -> dict[str, tuple[tuple[int, ...], DTypeLike]]:
    """Shape and type of all arrays of a table by name: rows, transitions, open windows."""
    rows = int(capacity * (1 + ENDS)) + 2 * _margin(slots, n_step)
    return {
        "observation": ((rows, observation_size), dtype),
        "first": ((capacity,), np.int64),
        "last": ((capacity,), np.int64),
        "action": ((capacity, action_size), np.float32),
        "reward": ((capacity,), np.float32),
        "discount": ((capacity,), np.float32),
        "open": ((slots,), np.int64),
        "present": ((slots,), np.int64),
        "open_first": ((slots, n_step), np.int64),
        "open_action": ((slots, n_step, action_size), np.float32),
        "open_reward": ((slots, n_step), np.float64),
    }


def table_bytes(
    capacity: int,
    slots: int,
    observation_size: int,
    action_size: int,
    n_step: int,
    dtype: DTypeLike = np.float32,
) -> int:
    """Bytes of memory that the full table takes; see NStepReplay."""
    columns = _columns(capacity, slots, observation_size, action_size, n_step, dtype)
    return sum(prod(shape) * np.dtype(kind).itemsize for shape, kind in columns.values())


class NStepReplay:
    """The newest N-step transitions of slots that run side by side; a slot is one car of one run.

    A window opens at each step of a slot. It closes after `n_step` steps, or earlier at the end of the
    run: with discount 0 if the end was a true one (terminated), with gamma^k after k steps if the run was
    cut off (truncated). No window crosses an end.

    An observation is stored once, as one row of a ring, although it begins one window, ends another and
    lies within more; a transition, in a ring of its own, names its two rows. Rows are numbered through
    without end, number r lying at r modulo the ring's length, so a number tells whether its row is still
    there. A transition is forgotten when `capacity` newer ones have come, or before its first row is
    overwritten, whichever comes first.
    """

    def __init__(
        self,
        capacity: int,
        slots: int,
        observation_size: int,
        action_size: int,
        n_step: int,
        gamma: float,
        dtype: DTypeLike = np.float32,
    ) -> None:
        """An empty table for `capacity` transitions; memory is taken as it fills.

        Args:
            capacity: transitions to hold. Fewer are held where more than the share ENDS of the steps
                ends a run, for the observation after an end takes a row beside those of the steps.
            slots: cars side by side.
            observation_size: length d of an observation.
            action_size: length a of an action.
            n_step: steps of a full window.
            gamma: discount of one step.
            dtype: what observations are stored as; np.float16 halves the memory, rounds them to 11
                significant bits and clips them to 65,504.

        Raises:
            InputError: if the capacity cannot hold what a single step of all slots can close.
        """
        if capacity < slots * n_step:
            raise InputError(
                f"replay: capacity is {capacity}, expected at least {slots * n_step} "
                f"({slots} slots times {n_step} steps)"
            )
        self.capacity = capacity
        self.gathered = 0
        """Transitions taken in so far, with those forgotten."""
        self.nbytes = table_bytes(capacity, slots, observation_size, action_size, n_step, dtype)
        """Bytes of memory that the full table takes."""
        columns = _columns(capacity, slots, observation_size, action_size, n_step, dtype)
        # numpy asks for huge pages, torch does not; rows lie scattered, and looking up pages costs a third.
        self._columns = {name: np.zeros(shape, kind) for name, (shape, kind) in columns.items()}
        self._tensors = {name: torch.from_numpy(column) for name, column in self._columns.items()}
        self._margin = _margin(slots, n_step)
        self._powers = gamma ** np.arange(n_step + 1, dtype=np.float64)
        self._size = 0
        self._rows = 0
        # The windows of all slots that opened at time t stand in column t % n_step.
        self._time = 0
        # Row of what a slot sees now, if its run goes on.
        self._columns["present"].fill(-1)

    def __len__(self) -> int:
        """Transitions stored."""
        return self._size

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
        state = self._columns
        slots, n_step = state["open_reward"].shape
        if valid is None:
            valid = np.ones(slots, np.bool_)
        column = self._time % n_step
        age = (self._time - np.arange(n_step)) % n_step
        state["open_first"][:, column] = self._rows_before(observation, valid)
        state["open_action"][:, column] = action
        state["open_reward"][:, column] = 0.0
        state["open_reward"] += self._powers[age] * np.asarray(reward)[:, None]
        after = np.full(slots, -1)
        after[valid] = self._write(self._rounded(next_observation)[valid])
        opened = np.where(valid, state["open"] + 1, 0)

        ended = terminated | truncated
        closing = (age < opened[:, None]) & (ended[:, None] | (age == n_step - 1))
        slot, window = np.nonzero(closing)
        self._append(
            first=state["open_first"][slot, window],
            last=after[slot],
            action=state["open_action"][slot, window],
            reward=state["open_reward"][slot, window],
            discount=np.where(terminated[slot], 0.0, self._powers[age[window] + 1]),
        )
        state["open"][:] = np.where(ended, 0, np.minimum(opened, n_step - 1))
        state["present"][:] = after
        self._time += 1

    def drop_open(self) -> None:
        """Drops the open windows of all slots, whose runs do not go on: a resumed run starts new ones."""
        self._columns["open"].fill(0)
        self._columns["present"].fill(-1)

    def _rounded(self, observation: Array) -> NDArray:
        dtype = self._tensors["observation"].dtype
        bound = torch.finfo(dtype).max
        rounded: NDArray = torch.from_numpy(observation).clamp(-bound, bound).to(dtype).numpy()
        return rounded

    def _rows_before(self, observation: Array, valid: Flags) -> Numbers:
        """The row of each slot's observation: where it went on from the last step, the one written then."""
        stored, rows = self._columns["observation"], self._columns["present"].copy()
        rounded = self._rounded(observation)
        new = valid & ((rows < 0) | (stored[rows % len(stored)] != rounded).any(axis=1))
        rows[new] = self._write(rounded[new])
        return rows

    def _write(self, observation: NDArray) -> Numbers:
        """Stores (n, d) observations of the table's own type, and numbers their rows."""
        rows = np.arange(self._rows, self._rows + len(observation))
        stored = self._columns["observation"]
        stored[rows % len(stored)] = observation
        self._rows += len(observation)
        return rows

    def _append(self, **transitions: NDArray) -> None:
        count = len(transitions["first"])
        places = np.arange(self.gathered, self.gathered + count) % self.capacity
        for name, values in transitions.items():
            self._columns[name][places] = values
        self.gathered += count
        self._size = min(self._size + count, self.capacity)
        # Windows close out of order, but none later than a margin: what is younger than the oldest
        # transition by place can be older by that much by row.
        kept = self._rows - len(self._columns["observation"]) + self._margin
        while self._size and self._columns["first"][(self.gathered - self._size) % self.capacity] < kept:
            self._size -= 1

    def _fill(self, batch: Batch, numbers: Numbers) -> None:
        """Copies the transitions of these numbers, 0 being the oldest stored, to the rows of a batch."""
        stored = self._tensors
        places = torch.from_numpy((self.gathered - self._size + numbers) % self.capacity)
        for name in ("action", "reward", "discount"):
            torch.index_select(stored[name], 0, places, out=getattr(batch, name))
        for name, observation in (("first", batch.observation), ("last", batch.next_observation)):
            rows = stored[name].index_select(0, places) % len(stored["observation"])
            observation.copy_(stored["observation"].index_select(0, rows))

    def _room(self, count: int) -> Batch:
        return Batch.empty(count, self._tensors["observation"].shape[1], self._tensors["action"].shape[1])

    def stored(self) -> Batch:
        """A copy of all stored transitions, the oldest first."""
        batch = self._room(self._size)
        self._fill(batch, np.arange(self._size))
        return batch

    def sample(self, batch: int, rng: np.random.Generator) -> Batch:
        """`batch` stored transitions, drawn with replacement and equal chances.

        Raises:
            ValueError: if nothing is stored yet.
        """
        drawn = self._room(batch)
        self.sample_into(drawn, rng)
        return drawn

    def sample_into(self, batch: Batch, rng: np.random.Generator) -> None:
        """Fills all rows of a batch with stored transitions, drawn with replacement and equal chances.

        Raises:
            ValueError: if nothing is stored yet.
        """
        if not self._size:
            raise ValueError("cannot sample from an empty replay table")
        self._fill(batch, rng.integers(self._size, size=len(batch.reward)))

    def _used(self, rows: int, gathered: int) -> dict[str, Tensor]:
        """Views of the tensors by name, without what was never written."""
        used = dict(self._tensors)
        used["observation"] = used["observation"][:rows]
        for name in ("first", "last", "action", "reward", "discount"):
            used[name] = used[name][:gathered]
        return used

    def state_dict(self) -> dict[str, Tensor]:
        """All that the table holds, by name: views, to be saved before the next step is added.

        Only what has been written is there, so a young table is small.
        """
        counts = torch.tensor([self.gathered, self._size, self._rows, self._time])
        return {**self._used(self._rows, self.gathered), "counts": counts}

    def load_state_dict(self, tensors: dict[str, Tensor]) -> None:
        """Goes on from what `state_dict` of a table made with the same arguments returned.

        Raises:
            InputError: naming the tensor that is missing, unknown or of another shape or type.
        """
        names = {*self._tensors, "counts"}
        if set(tensors) != names:
            name = sorted(set(tensors) ^ names)[0]
            raise InputError(f"replay: tensor {name!r} is {'missing' if name in names else 'unknown'}")
        counts = tensors["counts"]
        if counts.shape != (4,) or counts.dtype != torch.int64 or bool((counts < 0).any()):
            raise InputError("replay: tensor 'counts': expected 4 whole numbers from 0 up")
        gathered, size, rows, time = counts.tolist()
        if size > min(gathered, self.capacity):
            raise InputError(f"replay: tensor 'counts': {size} of {gathered} transitions stored")
        used = self._used(rows, gathered)
        for name, old in used.items():
            new = tensors[name]
            if new.shape != old.shape or new.dtype != old.dtype:
                raise InputError(
                    f"replay: tensor {name!r} is {tuple(new.shape)} {new.dtype}, "
                    f"expected {tuple(old.shape)} {old.dtype}"
                )
        for name, old in used.items():
            old.copy_(tensors[name])
        self.gathered, self._size, self._rows, self._time = gathered, size, rows, time
