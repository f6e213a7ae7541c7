"""Policies that somebody's loader makes of files, as our races ask policies: many cars at once."""

from __future__ import annotations

import logging
from typing import Any

import numpy as np
from numpy.typing import NDArray

from nathlon.arena.world import Loader
from nathlon.arena.worlds.loaded import LoadedPolicy, Seated
from nathlon.arena.worlds.memory_rows import MemoryRows
from nathlon.policies.general.outputs import IllegalActionError
from nathlon.policies.policy import Batch, Observations, Policy
from nathlon.sim.episode import action_space, in_space, observation_space
from nathlon.sim.errors import InputError
from nathlon.sim.observation import ObservationSpec

log = logging.getLogger(__name__)


def load_racer(source: str, load: Loader) -> Policy:
    """The policy of a file that a loader reads, tried on two observations.

    The loader is shown the spaces of the environments as they are by default. What it makes may say with an
    `observation_spec` that it sees otherwise.

    Raises:
        InputError: if there is no such file, or what the loader gives cannot drive.
    """
    loaded = LoadedPolicy.of(source, load, observation_space(ObservationSpec()), action_space())
    made = loaded.make()
    spec = getattr(made, "observation_spec", ObservationSpec())
    if not isinstance(spec, ObservationSpec):
        raise InputError(f"{source}: observation_spec is {type(spec).__name__}, expected an ObservationSpec")
    if callable(getattr(made, "initial_memory", None)):
        if not hasattr(made, "observation_spec"):
            raise InputError(f"{source}: has initial_memory and no observation_spec, expected both or none")
        policy: Policy = made
        return policy
    if callable(getattr(made, "reset", None)):
        raise InputError(
            f"{source}: keeps its state itself, between reset and reset; expected act(observation, memory), "
            "as one policy drives many cars at once"
        )
    return LoadedRacer(source, made, spec)


class LoadedRacer:
    """What a loader has made, asked for one car after the other; a module without memory for all at once.

    Attributes:
        observation_spec: layout of the observations that it sees.
        reverse: whether its cars have a reverse gear.
    """

    def __init__(self, source: str, made: Any, spec: ObservationSpec) -> None:
        """Of a policy that acts in the environments' spaces.

        Raises:
            InputError: if it does not act when it is shown an observation.
        """
        self.observation_spec = spec
        self.reverse = bool(getattr(made, "reverse", False))
        self._source, self._seated = source, Seated(source, made)
        self._space, self._rng = action_space(), np.random.default_rng(0)
        try:
            self._rows = self._tried()
        except MemoryError:
            raise
        # It is the user's own code: whatever it raises, they want to know where.
        except (Exception, SystemExit) as error:
            said = str(error) if isinstance(error, IllegalActionError) else f"raised {error!r}"
            raise InputError(f"{source}: shown an observation of {spec.size} numbers, {said}") from error

    def _tried(self) -> MemoryRows:
        """How its memory is made, after two steps that it is asked for."""
        _, memory = self._decided(self.observation_spec.blank(1), None)
        rows = MemoryRows(memory)
        _, memory = self._decided(self.observation_spec.blank(1), memory)
        rows.row(memory)
        return rows

    def initial_memory(self, n: int) -> Batch:
        """As of `nathlon.policies.policy.Policy`."""
        return self._rows.blank(n)

    def act(self, observations: Observations, memory: Batch) -> tuple[Batch, Batch]:
        """As of `nathlon.policies.policy.Policy`; not finite for a car with no legal action."""
        if self._seated.batches:
            return self._legal(observations, None)[0], memory
        answers = [
            self._legal(observations[row : row + 1], self._rows.memory(memory[row]))
            for row in range(len(observations))
        ]
        return (
            np.concatenate([actions for actions, _ in answers]),
            np.stack([self._rows.row(after) for _, after in answers]),
        )

    def _legal(self, observations: Observations, memory: Any) -> tuple[Batch, Any]:
        try:
            return self._decided(observations, memory)
        except IllegalActionError as error:
            log.warning("%s %s", self._source, error)
            return np.full((len(observations), 2), np.nan, np.float32), memory

    def _decided(self, observations: Observations, memory: Any) -> tuple[NDArray[np.float32], Any]:
        """Actions (n, 2) for observations of n cars, of one where there is a memory, and the memory after."""
        seen = in_space(observations)
        if self._seated.batches:
            return self._seated.act_together(seen, self._space, self._rng), None
        one = {name: part[0] for name, part in seen.items()} if isinstance(seen, dict) else seen[0]
        self._seated.memory = memory
        action = self._seated.act(one, self._space, self._rng)
        return action[None], self._seated.memory
