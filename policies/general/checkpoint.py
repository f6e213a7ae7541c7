"""Checkpoints of QR-SAC from any environment: weights and a card in one safetensors file.

The file is read as `nathlon.policies.weights` tells, the card stands there under `nathlon.general`.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from nathlon.policies.general.outputs import Outputs
from nathlon.policies.general.policy import GeneralPolicy, Memoryless
from nathlon.policies.policy_file import content_id, opening, read_policy_file
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
        format: version of the checkpoint format.
        algorithm: what trained it.
        hidden: units of each hidden layer.
        observation_size: numbers of an observation.
        action_size: numbers of an action, each in [-1, 1] between the bounds of a Box.
        step: gradient updates so far.
        seed: of the training run.
        created_by: versions of the programs that made it, by name.
    """

    key: ClassVar[str] = "nathlon.general"

    format: Literal[1] = 1
    algorithm: Text
    hidden: Annotated[tuple[Width, ...], Field(min_length=1, max_length=8)]
    observation_size: Annotated[int, Field(ge=1, le=1 << 20)]
    action_size: Width
    step: Count
    seed: Count
    created_by: Versions

    @property
    def widths(self) -> tuple[int, ...]:
        """The last layer gives the means of the actions, then the logarithms of their deviations."""
        return (self.observation_size, *self.hidden, 2 * self.action_size)


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
        return GeneralPolicy(
            source=str(path),
            id=content_id(content),
            algorithm=card.algorithm,
            step=card.step,
            seed=card.seed,
            observation_size=card.observation_size,
            network=Memoryless(mean_network(tensors, card.action_size)),
            outputs=Outputs("unscale", None, card.action_size),
        )
