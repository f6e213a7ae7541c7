"""Lessons: a policy learns what a teacher would do where cars are lost, and stays as it was elsewhere.

Both are imitated (DAgger, Ross et al., AISTATS 2011): the policy drives, and at each step its target is the
teacher's action where it is lost, or else its own before it was taught. Neither target moves while it learns,
so that many rounds change no more elsewhere than one.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch
from torch.nn.functional import smooth_l1_loss

from nathlon.policies.policy import Policy
from nathlon.policies.training.actor import Actor
from nathlon.policies.training.seeing_actor import SeeingActor
from nathlon.policies.training.trial import Driven

PASSES = 6
"""How often what was driven in a round is gone through."""
HELD = 8
"""Rows without a lesson for each with one."""
NEAR = 0.01
"""Error of an action up to which it counts by its square, and beyond which in proportion."""


def study(
    actor: Actor | SeeingActor,
    origin: Policy,
    driven: Sequence[Driven],
    rate: float,
    batch: int,
    rng: np.random.Generator,
) -> int:
    """Learn the lessons of a round.

    Args:
        actor: has driven, and is taught.
        origin: the policy before it was.
        driven: with lessons, which are nan where the actor is to stay.
        rate: of Adam.
        batch: rows of a minibatch.
        rng: draws the order, and where it is seen to that the actor stays.

    Returns:
        how many updates that made.
    """
    seen, memory = (np.concatenate([each[part] for each in driven]) for part in range(2))
    lessons = np.concatenate([each.lesson for each in driven])
    taught = np.isfinite(lessons).all(axis=1)
    told, others = np.flatnonzero(taught), np.flatnonzero(~taught)
    if not len(told):
        return 0
    held = rng.choice(others, min(HELD * len(told), len(others)), replace=False)
    lessons[held], _ = origin.act(seen[held], memory[held])
    rows = np.concatenate([told, held])
    inputs, targets = actor.inputs(seen[rows], memory[rows]), torch.from_numpy(lessons[rows])
    updates = 0
    for _ in range(PASSES):
        for chosen in torch.split(torch.from_numpy(rng.permutation(len(rows))), batch):
            actor.step(
                smooth_l1_loss(actor.means(*(each[chosen] for each in inputs)), targets[chosen], beta=NEAR),
                rate,
            )
            updates += 1
    return updates
