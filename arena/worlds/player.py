"""Who takes a seat in another world's episode: asks its policy, and idles once that has failed."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from copy import deepcopy
from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from nathlon.arena.team import Absent
from nathlon.arena.watch import Watch
from nathlon.arena.world import Space, WorldError
from nathlon.arena.worlds.loaded import LoadedPolicy, Seated
from nathlon.policies.general.outputs import IllegalActionError
from nathlon.policies.isolation import Apart

log = logging.getLogger(__name__)


class Asking:
    """One policy in one seat.

    Attributes:
        fault: how the policy has let its seat down, one of `nathlon.arena.results.POLICY_FAULTS`, or ''.
    """

    def __init__(
        self,
        policy: Any,
        seat: str,
        seen: Space,
        done: Space,
        rng: np.random.Generator,
        seed: int,
        step_limit_s: float,
        before: int = 0,
    ) -> None:
        """A seat that is taken.

        Args:
            policy: a `nathlon.policies.general.GeneralPolicy`, a `LoadedPolicy`, or `Absent`.
            seat: its name, for errors.
            seen, done: spaces of its observations and actions.
            rng: for a policy that draws its actions.
            seed: of the global generators that a policy finds which is code.
            step_limit_s: what the world may take until it asks somebody again.
            before: seats of the episode that the policy has taken before this one.
        """
        self.fault = policy.ending if isinstance(policy, Absent) else ""
        self._policy, self._seat, self._seen, self._done, self._rng = policy, seat, seen, done, rng
        self._step_limit_s, self._seed, self._before = step_limit_s, seed, before
        self._memory: Any = None
        self._seated: Seated | None = None
        self._asked = False
        self._apart = Apart(seed)
        self._who: tuple[Watch, int, int] | None = None

    def watched(self, watch: Watch, match: int, entrant: int) -> Asking:
        """Itself, with whom to tell that it is asked."""
        self._who = watch, match, entrant
        return self

    def act(self, observation: Any, mask: Any = None) -> Any:
        """An action of the seat's space; see `nathlon.arena.world.Player`.

        Raises:
            WorldError: if the observation is none of the seat's space: that is the world's fault.
        """
        allowed = _allowed(observation, mask)
        if self.fault:
            return idle(self._done, allowed)
        if _has_nan(observation):
            raise WorldError(f"seat {self._seat!r}: observation with NaN, expected numbers")
        seen = deepcopy(observation) if isinstance(self._policy, LoadedPolicy) else self._flat(observation)
        assert self._who is not None
        watch, match, entrant = self._who
        watch.ask(match, entrant, not self._asked)
        self._asked = True
        if watch.used_up(match, entrant):
            self.fault = "timed_out"
            return idle(self._done, allowed)
        action: Any = None
        try:
            action = self._decide(seen, allowed)
        except MemoryError:
            # Another one may have taken the memory: who pays for it is decided outside of this process.
            raise
        except IllegalActionError as error:
            log.warning("the policy of seat %r %s: it idles", self._seat, error)
            self.fault = "illegal_action"
        # Whatever a policy raises, an exit too, is its own fault and must not stop the others.
        except (Exception, SystemExit) as error:
            log.warning("the policy of seat %r raised %r: it idles", self._seat, error)
            self.fault = "policy_raised"
        # Not after what ends this process: the watch must say then who was asked.
        watch.work(self._step_limit_s)
        if self.fault:
            return idle(self._done, allowed)
        if not (_finite(action) and self._done.contains(action)):
            log.warning(
                "the policy of seat %r gave %r, expected one of %s: it idles", self._seat, action, self._done
            )
            self.fault = "illegal_action"
            return idle(self._done, allowed)
        return action

    def _flat(self, observation: Any) -> NDArray[Any]:
        """(1, size), a copy, for the policy may write into it; float32 unless the policy is precise."""
        dtype = np.float64 if self._policy.precise else np.float32
        try:
            seen = np.array(spaces.flatten(self._seen, observation), dtype).reshape(1, -1)
        except Exception as error:
            raise WorldError(f"seat {self._seat!r}: observation is none of {self._seen}: {error}") from None
        if seen.shape[1] != spaces.flatdim(self._seen):
            size = spaces.flatdim(self._seen)
            raise WorldError(f"seat {self._seat!r}: observation of {seen.shape[1]} numbers, expected {size}")
        return seen

    def _decide(self, seen: Any, mask: NDArray[np.bool_] | None) -> Any:
        with self._apart.entered():
            if isinstance(self._policy, LoadedPolicy):
                if self._seated is None:
                    self._seated = self._policy.of_seat(self._before)
                    self._seated.reset(self._seed)
                return self._seated.act(seen, self._done, self._rng)
            if self._memory is None:
                self._memory = self._policy.initial_memory(1)
            outputs, self._memory = self._policy.act(seen, self._memory)
            return self._policy.decode(outputs[0], self._done, self._rng, mask)


def _allowed(observation: Any, mask: Any) -> NDArray[np.bool_] | None:
    """Which choices are allowed, if that is told: beside an observation or in it."""
    if mask is None and isinstance(observation, Mapping):
        mask = observation.get("action_mask")
    if mask is None:
        return None
    parts = mask if isinstance(mask, tuple) else (mask,)  # of a MultiDiscrete there may be several
    return np.concatenate([np.asarray(part).ravel() != 0 for part in parts])


def idle(space: Space, allowed: NDArray[np.bool_] | None = None) -> Any:
    """What a seat does whose policy has failed: 0, or what is nearest to it in the space and allowed."""
    match space:
        case spaces.Discrete() if allowed is not None and allowed.size == space.n and allowed.any():
            return int(space.start) + int(allowed.argmax())
        case spaces.Box():
            return np.clip(np.zeros(space.shape, space.dtype), space.low, space.high)
        case spaces.Discrete():
            return int(space.start)
        case spaces.MultiDiscrete():
            return np.array(space.start, space.dtype)
        case spaces.Tuple():
            return tuple(map(idle, space.spaces))
        case spaces.Dict():
            return {name: idle(one) for name, one in space.spaces.items()}
    raise ValueError(f"action space {space}, expected Box, Discrete or MultiDiscrete, or a Tuple of them")


def _has_nan(observation: Any) -> bool:
    """Whether an observation has a NaN among its numbers, whatever its space."""
    if isinstance(observation, Mapping):
        return any(map(_has_nan, observation.values()))
    if isinstance(observation, tuple):
        return any(map(_has_nan, observation))
    try:
        return bool(np.isnan(np.asarray(observation)).any())
    except (TypeError, ValueError):
        return False  # holds no numbers


def _finite(action: Any) -> bool:
    if isinstance(action, Mapping):
        return all(map(_finite, action.values()))
    if isinstance(action, tuple):
        return all(map(_finite, action))
    return bool(np.isfinite(np.asarray(action, np.float64)).all())
