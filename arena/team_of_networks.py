"""Networks that drive few cars each, asked in one call: calls, not products, would take most of the time."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from nathlon.arena.team import Team
from nathlon.arena.watch import Watch
from nathlon.policies.checkpoint import NetworkPolicy
from nathlon.policies.mlp import FEW, Mlp, MlpStack
from nathlon.policies.policy import Batch
from nathlon.policies.sb3_racer import Sb3Policy
from nathlon.sim.world import World

LARGE = 1_000_000
"""Weights from which on a network is asked by itself, and its time watched."""


class TeamOfNetworks:
    """Policies with networks of one shape, each with a few cars. What a car does depends on no other.

    Attributes:
        cars: (n,) int64, indices in the world, those of the first network first.
    """

    def __init__(self, teams: Sequence[Team], networks: Sequence[Mlp]) -> None:
        """The cars of some teams, and the network of each."""
        self.cars = np.concatenate([team.cars for team in teams])
        self._network_of = np.repeat(np.arange(len(teams)), [len(team.cars) for team in teams])
        self._networks, self._count = MlpStack(networks), len(networks)
        self._find_starts()

    def _find_starts(self) -> None:
        self._starts = np.searchsorted(self._network_of, np.arange(self._count + 1))

    def keep(self, driving: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """As of `Team`."""
        kept = driving[self.cars]
        self.cars, self._network_of = self.cars[kept], self._network_of[kept]
        self._find_starts()
        return kept

    def act(self, world: World, seen: Batch, due: NDArray[np.bool_], watch: Watch) -> tuple[Batch, str]:
        """As of `Team`."""
        watch.work()
        return self._networks(seen, self._starts), ""


def join_networks(teams: Iterable[Team]) -> list[Team | TeamOfNetworks]:
    """Teams in which small networks of few cars are asked together; all observe by the same spec."""
    others: list[Team | TeamOfNetworks] = []
    alike: dict[object, list[tuple[Team, Mlp]]] = defaultdict(list)
    for team in teams:
        network = team.policy.network if isinstance(team.policy, (NetworkPolicy, Sb3Policy)) else None
        if isinstance(network, Mlp) and network.size < LARGE and len(team.cars) <= FEW:
            alike[network.shape].append((team, network))
        else:
            others.append(team)
    return [*others, *(TeamOfNetworks(*zip(*those, strict=True)) for those in alike.values())]
