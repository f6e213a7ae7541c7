"""Policies that look ahead: they are shown the world itself, and not only what their cars see."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from nathlon.policies.driver import Follower
from nathlon.policies.planning.mppi import Mppi
from nathlon.policies.planning.scene import Scene
from nathlon.policies.policy import Batch, Policy
from nathlon.policies.sources.composite import Composite
from nathlon.sim.blue_flags import NOBODY
from nathlon.sim.world import World

__all__ = ["Mppi", "Scene", "decide"]


def decide(
    policy: Policy,
    world: World,
    races: NDArray[np.int64],
    cars: NDArray[np.int64],
    observations: Batch,
    memory: Batch,
) -> tuple[Batch, Batch]:
    """What a policy does in a world; see `Policy.act`.

    Only nathlon's own planner is shown the world: a policy that is anybody's code could change it. The
    built-in driver feels the grip where there is weather, sees blue flags where any are shown, and is told
    its pace, as a part of a composite too.

    Args:
        policy: drives the cars.
        world: as it is now.
        races, cars: (n,) indices of the cars.
        observations, memory: as of `Policy.act`.
    """
    if isinstance(policy, Mppi):
        return policy.plan(Scene(world, races, cars), observations, memory)
    if isinstance(policy, Composite):

        def ask(part: Policy, seen: Batch, own: Batch) -> tuple[Batch, Batch]:
            return decide(part, world, races, cars, seen, own)

        return policy.act_by(ask, observations, memory)
    if isinstance(policy, Follower):
        flagged, own = world.state["flagged_for"][races, cars] != NOBODY, np.ones(len(cars))
        pace = world.state["pace"][races, cars]
        if world.conditions.weather or flagged.any() or (pace != 1.0).any():
            felt = grips(world, races, cars) if world.conditions.weather else (own, own)
            return policy.act_when_told(observations, memory, *felt, flagged, pace)
    return policy.act(observations, memory)


def grips(
    world: World, races: NDArray[np.int64], cars: NDArray[np.int64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Grip of some cars and slip at its peak, as multiples of those on dry road at the start, each (n,)."""
    state = world.state[races, cars]
    return state["tyre_grip"] * state["wet_grip"], state["wet_peak"]
