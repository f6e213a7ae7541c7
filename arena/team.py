"""A policy and all cars for which it is asked in one call.

A policy gets memory of its own, so that whatever it writes to reaches nobody else; one that is code also
gets random generators of its own.
"""

from __future__ import annotations

import logging
from collections.abc import Mapping
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from nathlon.arena.watch import Watch
from nathlon.policies.checkpoint import NetworkPolicy, SeeingPolicy
from nathlon.policies.driver import Driver
from nathlon.policies.driver.early_braker import EarlyBraker
from nathlon.policies.isolation import Apart
from nathlon.policies.patience import TimedOutError
from nathlon.policies.planning import Mppi, RolloutDriver, decide
from nathlon.policies.policy import Batch, Policy
from nathlon.policies.sb3_racer import Sb3Policy
from nathlon.policies.sources.human import Person
from nathlon.policies.sources.onnx import OnnxPolicy
from nathlon.sim.world import World

log = logging.getLogger(__name__)

ROW_WISE = (Driver, EarlyBraker, Person)
"""Policies whose answer for a car does not depend, to the last bit, on the cars beside it in the batch. All
others round differently with the number of rows: matrix products do."""

OWN = (*ROW_WISE, Mppi, RolloutDriver, NetworkPolicy, OnnxPolicy, Sb3Policy, SeeingPolicy)
"""Policies whose code is this program's, whatever file their weights come from."""
HERE = nullcontext()


@dataclass(frozen=True)
class Absent:
    """Instead of a policy that is not asked: its cars are out from the start.

    Attributes:
        ending: how their runs end, one of `nathlon.arena.results.POLICY_FAULTS`.
    """

    ending: str


class Team:
    """One policy and cars that it drives.

    Attributes:
        policy: the policy.
        cars: (n,) int64, indices in the world, race by race.
    """

    def __init__(
        self, policy: Policy, cars: NDArray[np.int64], match: int, entrant: int, seed: int = 0
    ) -> None:
        """Cars that have not been driven yet.

        Args:
            policy: drives them.
            cars: see above.
            match, entrant: whose policy it is, for the watch.
            seed: of the random generators that it finds.
        """
        self.policy, self.cars = policy, cars
        self._match, self._entrant = match, entrant
        self._memory: Batch | None = None
        self._row_wise = isinstance(policy, ROW_WISE)
        self._apart = None if isinstance(policy, OWN) else Apart(seed)

    def keep(self, driving: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Forget cars that are out, if the answers for the others do not depend on them or there are none.

        Args:
            driving: (cars of the world,) who still drives.

        Returns:
            (n,) which of the cars are left.
        """
        kept = driving[self.cars]
        if not self._row_wise:
            kept[:] = kept.any()
        self.cars = self.cars[kept]
        if self._memory is not None:
            self._memory = self._memory[kept]
        return kept

    @property
    def memory(self) -> dict[int, Batch]:
        """What the policy remembers of each car, by the car's index; empty before it was asked."""
        return {} if self._memory is None else dict(zip(self.cars.tolist(), self._memory, strict=True))

    def recall(self, memory: Mapping[int, Batch]) -> None:
        """Go on from a memory as of `memory`; cars that it lacks are out, and asked no more."""
        known = [memory[car] for car in self.cars.tolist() if car in memory]
        if known:
            blank = np.zeros_like(known[0])
            self._memory = np.stack([memory.get(car, blank) for car in self.cars.tolist()])

    def act(self, world: World, seen: Batch, due: NDArray[np.bool_], watch: Watch) -> tuple[Batch, str]:
        """Ask the policy.

        Cars whose turn it is not are asked for as well, so that the batch keeps its shape, and the
        answers thrown away.

        Args:
            world: the world.
            seen: (n, size) float32, what the cars see.
            due: (n,) whose turn it is.
            watch: told before the policy is asked.

        Returns:
            actions (n, 2) float32, not finite where they are illegal, and the fault of the policy or ''.
        """
        n, grid = len(self.cars), world.state.shape[1]
        if self._row_wise:
            watch.work()
        else:
            watch.ask(self._match, self._entrant, self._memory is None)
        if self._apart is not None:
            seen = np.array(seen)
        if watch.used_up(self._match, self._entrant):
            log.warning("a policy has used up its time for a match: its cars are out")
            return np.full((n, 2), np.nan, np.float32), "timed_out"
        try:
            with self._entered():
                if self._memory is None:
                    self._memory = _initial_memory(self.policy, n)
                answer = decide(self.policy, world, self.cars // grid, self.cars % grid, seen, self._memory)
        except _IllegalError as error:
            return self._refused(str(error))
        except TimedOutError as error:
            log.warning("%s: its cars are out", error)
            return np.full((n, 2), np.nan, np.float32), "timed_out"
        except MemoryError:
            # Another one may have taken the memory: who pays for it is decided outside of this process.
            raise
        # Whatever a policy raises, an exit too, is its own fault and must not stop the others.
        except (Exception, SystemExit) as error:
            log.warning("a policy raised %r: its cars are out", error)
            return np.full((n, 2), np.nan, np.float32), "policy_raised"
        if not (isinstance(answer, tuple) and len(answer) == 2):
            return self._refused(f"a {type(answer).__name__} instead of actions and memory")
        actions, memory = answer
        if not _is_batch(actions, (n, 2)):
            return self._refused(f"actions {_describe(actions)}, expected ({n}, 2) float32")
        if not _is_batch(memory, self._memory.shape):
            return self._refused(f"memory {_describe(memory)}, expected {self._memory.shape} float32")
        if memory.size:
            self._memory = np.where(due[:, None], memory, self._memory).astype(np.float32, copy=False)
        if actions.dtype != np.float32:
            # What is finite as given must stay so.
            actions = np.where(np.isfinite(actions), np.clip(actions, -1.0, 1.0), np.nan)
        return actions.astype(np.float32, copy=False), ""

    def _entered(self) -> AbstractContextManager[None]:
        return HERE if self._apart is None else self._apart.entered()

    def _refused(self, what: str) -> tuple[Batch, str]:
        log.warning("a policy gave %s: its cars are out", what)
        return np.full((len(self.cars), 2), np.nan, np.float32), "illegal_action"


class _IllegalError(Exception):
    """A policy gave what the contract does not allow."""


def _initial_memory(policy: Policy, n: int) -> Batch:
    memory: Any = policy.initial_memory(n)
    width = memory.shape[1] if isinstance(memory, np.ndarray) and memory.ndim == 2 else 0
    if not _is_batch(memory, (n, width)):
        raise _IllegalError(f"initial memory {_describe(memory)}, expected ({n}, m) float32")
    return memory.astype(np.float32, copy=False)


def _is_batch(value: Any, shape: tuple[int, ...]) -> bool:
    return isinstance(value, np.ndarray) and value.shape == shape and value.dtype.kind == "f"


def _describe(value: Any) -> str:
    return f"{value.shape} {value.dtype}" if isinstance(value, np.ndarray) else f"of {type(value).__name__}"
