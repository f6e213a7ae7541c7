"""Proximal policy optimisation (Schulman et al., 2017) of a policy's mean actions."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch
from torch import Tensor

from nathlon.policies.training.actor import Actor
from nathlon.policies.training.seeing_actor import SeeingActor
from nathlon.policies.training.trial import Driven

CLIP = 0.2
"""Of the ratio of probabilities: beyond 1 -+ this an action counts no more."""


def improve(
    actor: Actor | SeeingActor,
    driven: Sequence[Driven],
    deviation: Sequence[float],
    rate: float,
    batch: int,
    rng: np.random.Generator,
) -> int:
    """Go once through all that was driven, in minibatches.

    Args:
        actor: has driven, and is improved.
        driven: what is left over of the last minibatch is not used.
        deviation: of the noise on each action.
        rate: of Adam.
        batch: rows of a minibatch.
        rng: draws the order.

    Returns:
        how many updates that made.
    """
    seen, memory, *told = (np.concatenate(parts) for parts in zip(*driven, strict=True))
    inputs, (means, noise, advantage, _) = actor.inputs(seen, memory), map(torch.from_numpy, told)
    order = torch.from_numpy(rng.permutation(len(seen)))
    batches = max(1, len(order) // batch)
    for rows in order[: batches * batch].chunk(batches):
        moved = (actor.means(*(each[rows] for each in inputs)) - means[rows]) / torch.tensor(deviation)
        actor.step(proximal_loss(moved, noise[rows], advantage[rows]), rate)
    return batches


def proximal_loss(moved: Tensor, noise: Tensor, advantage: Tensor) -> Tensor:
    """The clipped loss, equation 7 of the paper, for normal actions of fixed deviation.

    Args:
        moved: (n, actions) how far the means went since the actions were drawn, in deviations.
        noise: (n, actions) of the actions then, in deviations.
        advantage: (n,).
    """
    ratio = (moved * noise - 0.5 * moved.square()).sum(dim=1).exp()
    clipped = ratio.clamp(1.0 - CLIP, 1.0 + CLIP)
    return -torch.minimum(ratio * advantage, clipped * advantage).mean()
