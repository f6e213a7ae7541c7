"""A trained policy as a distribution of actions."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from nathlon.policies.checkpoint import ACTION_SIZE, Card, encoded
from nathlon.policies.mlp import Mlp
from nathlon.policies.policy import Batch
from nathlon.policies.weights import layers_of

LEAST, MOST = 0.02, 0.5
"""Of deviations: less would hold the car to the policy, more tells nothing."""


class Actions(NamedTuple):
    """What the policy would do, each (n, 2) float32.

    Attributes:
        mean: squashed, in [-1, 1].
        deviation: of the noise that it was trained with, before squashing: behind it, at full throttle, any
            other action would be as good as impossible.
    """

    mean: Batch
    deviation: Batch


class Prior:
    """The policy of a checkpoint, with the deviations of its actions.

    Attributes:
        card: what the policy is.
    """

    def __init__(self, card: Card, tensors: Mapping[str, NDArray[np.float32]]) -> None:
        """A policy of tensors as described by `card.shapes`."""
        self.card = card
        self._network = encoded(card, tensors, Mlp(tuple(layers_of(tensors)), "relu", "linear"))

    def __call__(self, observations: Batch) -> Actions:
        """For observations (n, size)."""
        outputs = self._network(observations)
        mean, log_deviation = outputs[:, :ACTION_SIZE], outputs[:, ACTION_SIZE:]
        deviation = np.clip(np.exp(np.clip(log_deviation, -20.0, 2.0)), LEAST, MOST)
        return Actions(np.tanh(mean), deviation)
