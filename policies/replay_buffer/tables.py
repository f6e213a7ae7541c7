"""Replay in several tables, one a scenario, with a fixed share of every minibatch each."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import torch
from numpy.typing import DTypeLike
from torch import Tensor

from nathlon.policies.replay_buffer.table import Batch, NStepReplay, table_bytes
from nathlon.sim.errors import InputError


def apportion(total: int, shares: Sequence[float]) -> list[int]:
    """`total` in whole parts as near to the shares as can be, by largest remainders; ties to the first.

    Args:
        total: what the parts sum to.
        shares: positive weights.
    """
    quotas = total * np.asarray(shares, np.float64) / np.sum(shares)
    parts = np.floor(quotas).astype(np.int64)
    largest = np.argsort(parts - quotas, kind="stable")[: total - parts.sum()]
    parts[largest] += 1
    return [int(part) for part in parts]


def available_memory() -> int:
    """Bytes that this process can still take without swapping: the system's, or its control group's limit."""
    try:
        lines = Path("/proc/meminfo").read_text().splitlines()
        (available,) = (int(line.split()[1]) * 1024 for line in lines if line.startswith("MemAvailable:"))
    except (OSError, ValueError):
        available = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    try:
        return min(available, int(Path("/sys/fs/cgroup/memory.max").read_text()))
    except (OSError, ValueError):  # no control group, or one without a limit ("max")
        return available


class ReplayTables:
    """Tables of N-step transitions, and minibatches stratified over them in exact proportions.

    Attributes:
        tables: one a scenario, to be added to.
        counts: rows of each table in a minibatch.
    """

    def __init__(
        self,
        capacity: int,
        slots: Sequence[int],
        shares: Sequence[float],
        batch: int,
        observation_size: int,
        action_size: int,
        n_step: int,
        gamma: float,
        dtype: DTypeLike = np.float16,
    ) -> None:
        """Empty tables.

        Args:
            capacity: transitions of all tables together, which have their shares of it.
            slots: cars side by side, for each table.
            shares: positive weights of the tables.
            batch: transitions of a minibatch.
            observation_size, action_size, n_step, gamma, dtype: of every table; see NStepReplay.

        Raises:
            InputError: if the full tables need more memory than there is, a table is too small for
                its slots, or its share comes to no row of a minibatch.
        """
        self.counts = apportion(batch, shares)
        if not all(self.counts):
            raise InputError(
                f"replay: the shares {tuple(shares)} of a batch of {batch} are {tuple(self.counts)} "
                "transitions, expected at least 1 of each table"
            )
        capacities = apportion(capacity, shares)
        sizes = (observation_size, action_size, n_step)
        self.nbytes = sum(
            table_bytes(part, cars, *sizes, dtype) for part, cars in zip(capacities, slots, strict=True)
        )
        """Bytes of memory that the full tables take."""
        available = available_memory()
        if self.nbytes > available:
            raise InputError(
                f"replay: {capacity} transitions need {self.nbytes:,} bytes of memory, "
                f"expected at most the {available:,} available"
            )
        self.tables = tuple(
            NStepReplay(part, cars, *sizes, gamma, dtype)
            for part, cars in zip(capacities, slots, strict=True)
        )
        self._shares = np.asarray(shares, np.float64) / np.sum(shares)
        self._batch = Batch.empty(batch, observation_size, action_size)
        cuts = [torch.split(tensor, self.counts) for tensor in self._batch]
        self._parts = [Batch(*part) for part in zip(*cuts, strict=True)]

    def __len__(self) -> int:
        """Transitions stored in all tables."""
        return sum(map(len, self.tables))

    def ready(self, warm_up: int) -> bool:
        """Whether every table has a transition, and has gathered its share of `warm_up` of them."""
        needs = np.floor(warm_up * self._shares)
        return all(
            len(table) > 0 and table.gathered >= need for table, need in zip(self.tables, needs, strict=True)
        )

    def sample(self, rng: np.random.Generator) -> Batch:
        """A minibatch: the `counts` of each table, in the order of the tables.

        Within a table all stored transitions have equal chances, drawn with replacement. A table without
        any is an error, so that the proportions hold for every minibatch ever learnt from.

        Returns:
            the same tensors every time: the next call overwrites them.

        Raises:
            ValueError: if a table is empty; see `ready`.
        """
        for table, part in zip(self.tables, self._parts, strict=True):
            table.sample_into(part, rng)
        return self._batch

    def state_dict(self) -> dict[str, Tensor]:
        """All that the tables hold, by names as `table.0.reward`: views, to be saved before the next step."""
        return {
            f"table.{number}.{name}": tensor
            for number, table in enumerate(self.tables)
            for name, tensor in table.state_dict().items()
        }

    def load_state_dict(self, tensors: dict[str, Tensor]) -> None:
        """Goes on from what `state_dict` of tables made with the same arguments returned.

        Raises:
            InputError: if a tensor is missing, unknown or of another shape or type.
        """
        parts: list[dict[str, Tensor]] = [{} for _ in self.tables]
        prefixes = {f"table.{number}": part for number, part in enumerate(parts)}
        for full_name, tensor in tensors.items():
            prefix, _, name = full_name.rpartition(".")
            if prefix not in prefixes:
                raise InputError(f"replay: tensor {full_name!r} is unknown")
            prefixes[prefix][name] = tensor
        for number, (table, part) in enumerate(zip(self.tables, parts, strict=True)):
            try:
                table.load_state_dict(part)
            except InputError as error:
                raise InputError(f"table {number}: {error}") from None
