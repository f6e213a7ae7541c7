"""Checkpoints of QR-SAC from any environment: weights and a card in one safetensors file.

The file is read as `nathlon.policies.weights` tells, the card stands there under `nathlon.general`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from nathlon.policies.general.outputs import Outputs
from nathlon.policies.general.policy import GeneralPolicy, Memoryless
from nathlon.policies.mlp import Mlp
from nathlon.policies.policy import Batch
from nathlon.policies.policy_file import content_id, opening, read_policy_file
from nathlon.policies.vision import Memory, memory_shapes
from nathlon.policies.weights import (
    Count,
    Text,
    Versions,
    WeightsCard,
    Width,
    mean_network,
    parse_weights,
    save_weights,
)


class GeneralCard(WeightsCard):
    """What a checkpoint is and where it comes from.

    Attributes:
        format: version of the checkpoint format: 2 where there is a memory, which readers of 1 do not know.
        algorithm: what trained it.
        hidden: units of each hidden layer.
        observation_size: numbers of an observation.
        action_size: numbers of an action, each in [-1, 1] between the bounds of a Box.
        memory: units of the gated recurrent unit that comes first; 0 for none.
        step: gradient updates so far.
        seed: of the training run.
        created_by: versions of the programs that made it, by name.
    """

    key: ClassVar[str] = "nathlon.general"

    format: Literal[1, 2] = 1
    algorithm: Text
    hidden: Annotated[tuple[Width, ...], Field(min_length=1, max_length=8)]
    observation_size: Annotated[int, Field(ge=1, le=1 << 20)]
    action_size: Width
    memory: Annotated[int, Field(ge=0, le=4096, exclude_if=lambda units: not units)] = 0
    step: Count
    seed: Count
    created_by: Versions

    @property
    def widths(self) -> tuple[int, ...]:
        """The last layer gives the means of the actions, then the logarithms of their deviations."""
        return (self.memory or self.observation_size, *self.hidden, 2 * self.action_size)

    @property
    def shapes(self) -> dict[str, tuple[int, ...]]:
        return memory_shapes(self.observation_size, self.memory) | super().shapes

    @model_validator(mode="after")
    def _remembers_as_it_says(self) -> GeneralCard:
        if self.format != (2 if self.memory else 1):
            raise ValueError(f"format is {self.format}, expected 2 with a memory and 1 without")
        return self


@dataclass(frozen=True)
class Remembering:
    """A gated recurrent unit, and what follows it.

    Attributes:
        memory: of what is seen.
        head: gives the numbers.
    """

    memory: Memory
    head: Mlp

    def initial_memory(self, n: int) -> Batch:
        """Zeros (n, m)."""
        return np.zeros((n, self.memory.units), np.float32)

    def act(self, observations: Batch, memory: Batch) -> tuple[Batch, Batch]:
        """Numbers (n, k) for observations (n, size), and memory (n, m)."""
        known = self.memory(observations, memory)
        return self.head.alike(known), known


def save_general(path: Path, tensors: Mapping[str, NDArray[np.float32]], card: GeneralCard) -> None:
    """Writes a checkpoint; the same tensors and card give the same bytes.

    Args:
        path: the file, replaced whole if it exists.
        tensors: as described by `card.shapes`.
        card: what the policy is.

    Raises:
        InputError: if a tensor is missing, unknown, of another shape or not finite as float16.
    """
    save_weights(path, tensors, card)


def load_general_checkpoint(path: Path) -> GeneralPolicy:
    """The policy of a checkpoint: the squashed mean of its actions.

    Raises:
        InputError: if the file is no checkpoint with a `GeneralCard`.
    """
    with opening(path):
        content = read_policy_file(path)
        card, tensors = parse_weights(path, content, GeneralCard)
        head = mean_network(tensors, card.action_size)
        return GeneralPolicy(
            source=str(path),
            id=content_id(content),
            algorithm=card.algorithm,
            step=card.step,
            seed=card.seed,
            observation_size=card.observation_size,
            network=Remembering(Memory.of(tensors), head) if card.memory else Memoryless(head),
            outputs=Outputs("unscale", None, card.action_size),
        )
