"""Policies that look ahead: they are shown the world itself, and not only what their cars see."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from nathlon.policies.driver import Follower
from nathlon.policies.planning.mppi import Mppi
from nathlon.policies.planning.rollout import RolloutDriver
from nathlon.policies.planning.scene import Scene
from nathlon.policies.policy import Batch, Policy
from nathlon.policies.sources.composite import Composite
from nathlon.sim.world import World

__all__ = ["Mppi", "RolloutDriver", "Scene", "decide"]


def decide(
    policy: Policy,
    world: World,
    races: NDArray[np.int64],
    cars: NDArray[np.int64],
    observations: Batch,
    memory: Batch,
) -> tuple[Batch, Batch]:
    """What a policy does in a world; see `Policy.act`.

    Only nathlon's own planners are shown the world: a policy that is anybody's code could change it. The
    built-in driver feels the grip where there is weather, sees blue flags where any are shown, and is told
    its pace, as a part of a composite too.

    Args:
        policy: drives the cars.
        world: as it is now.
        races, cars: (n,) indices of the cars.
        observations, memory: as of `Policy.act`.
    """
    scene = Scene(world, races, cars)
    if isinstance(policy, Mppi | RolloutDriver):
        return policy.plan(scene, observations, memory)
    if isinstance(policy, Composite):

        def ask(part: Policy, seen: Batch, own: Batch) -> tuple[Batch, Batch]:
            return decide(part, world, races, cars, seen, own)

        return policy.act_by(ask, observations, memory)
    if isinstance(policy, Follower):
        flagged, pace = scene.flagged, scene.pace
        if world.conditions.weather or flagged.any() or (pace != 1.0).any():
            return policy.act_when_told(observations, memory, *scene.grips, flagged, pace)
    return policy.act(observations, memory)
