"""A policy of any environment: numbers in, numbers out, and what they mean as an action."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np
from gymnasium.spaces import Box, Space, flatdim
from numpy.typing import NDArray

from nathlon.policies.general.outputs import Draw, Outputs, in_words
from nathlon.policies.policy import Batch
from nathlon.sim.errors import InputError


class Network(Protocol):
    """What maps observations to numbers; it keeps no state but in the memory that it is handed."""

    def initial_memory(self, n: int) -> Batch:
        """Memory at the start of n episodes, (n, m) float32; m may be 0."""
        ...

    def act(self, observations: Batch, memory: Batch) -> tuple[NDArray[Any], Batch]:
        """Numbers (n, k) for observations (n, size) float32, and memory (n, m) float32 after this step."""
        ...


class Memoryless:
    """A function of observations as a network."""

    def __init__(self, function: Callable[[Batch], NDArray[Any]]) -> None:
        """Of a function from observations (n, size) float32 to numbers (n, k)."""
        self._function = function

    def initial_memory(self, n: int) -> Batch:
        """No memory: (n, 0) float32."""
        return np.zeros((n, 0), np.float32)

    def act(self, observations: Batch, memory: Batch) -> tuple[NDArray[Any], Batch]:
        """Numbers (n, k) for observations (n, size) float32; memory as it was."""
        return self._function(observations), memory


@dataclass(frozen=True)
class GeneralPolicy:
    """A policy of any environment, which acts without noise; one object acts in any number of episodes.

    Attributes:
        source: what the user called it by, for errors.
        id: SHA-256 of the file or of the package's files, or the name of what is neither.
        algorithm: what trained it; None if not known, as are the next two.
        step: gradient updates of its training.
        seed: of its training.
        observation_size: numbers of an observation, in the order of `gymnasium.spaces.flatten`; None for any.
        network: maps observations to numbers.
        outputs: what the numbers mean.
        observation_shape: of an observation in training; None where the file does not tell.
        wrappers: classes that the environment was wrapped in, in training, which policies cannot make up for.
        precise: whether it gets observations in float64, as it normalises them.
        made_with: arguments that the environment was made with, in training.
    """

    source: str
    id: str
    algorithm: str | None
    step: int | None
    seed: int | None
    observation_size: int | None
    network: Network
    outputs: Outputs | Draw
    observation_shape: tuple[int, ...] | None = None
    wrappers: tuple[str, ...] = ()
    precise: bool = False
    made_with: Mapping[str, Any] = field(default_factory=dict)

    def check(self, observation_space: Space[Any], action_space: Space[Any]) -> None:
        """Raise an InputError, which names the source, if the policy cannot act in these spaces."""
        if self.observation_size is not None:
            try:
                size = flatdim(observation_space)
            except (ValueError, NotImplementedError):
                raise InputError(
                    f"{self.source}: the observation space {in_words(observation_space)} cannot be flattened"
                ) from None
            if size != self.observation_size:
                raise InputError(
                    f"{self.source}: takes {self.observation_size} numbers, expected {size} for the "
                    f"observation space {in_words(observation_space)}"
                )
            shape = self.observation_shape or ()
            if isinstance(observation_space, Box) and len(shape) > 1 and shape != observation_space.shape:
                raise InputError(
                    f"{self.source}: was trained on observations of shape {in_words(shape)}, as of stacked "
                    f"frames, expected {observation_space.shape} as in {in_words(observation_space)}"
                )
        self.outputs.check(self.source, action_space)

    def initial_memory(self, n: int) -> Batch:
        """Memory at the start of n episodes, (n, m) float32; m may be 0."""
        return self.network.initial_memory(n)

    def act(self, observations: NDArray[Any], memory: Batch) -> tuple[NDArray[Any], Batch]:
        """What `decode` makes actions of.

        Args:
            observations: (n, observation_size) float32, or float64 where it is `precise`.
            memory: (n, m) float32, as returned by the last call.

        Returns:
            numbers (n, k), float32 or, of graphs and plugins, of any type; memory (n, m) float32.

        Raises:
            IllegalActionError: if a plugin gives anything else.
        """
        return self.network.act(observations, memory)

    def decode(
        self,
        row: NDArray[Any],
        action_space: Space[Any],
        rng: np.random.Generator,
        mask: NDArray[np.bool_] | None = None,
    ) -> Any:
        """The element of an action space that a row (k,) of what `act` gave stands for.

        Args:
            row: the numbers.
            action_space: of the seat.
            rng: of the seat in this episode; only `random` draws from it.
            mask: which choices are allowed, (k,); heeded by policies that were trained with masks.

        Returns:
            an array of the dtype and shape of a Box, an int of a Discrete, an array of the dtype (int64) and
            shape of a MultiDiscrete.

        Raises:
            InputError: if the policy has no actions of this space; it names the source.
            IllegalActionError: if the numbers are no action: not finite, or no choice that there is.
        """
        return self.outputs.decode(self.source, row, action_space, rng, mask)
