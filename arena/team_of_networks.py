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
from nathlon.policies.sources.sb3 import Sb3Policy
from nathlon.sim.world import World

LARGE = 1_000_000
"""Weights from which on a network is asked by itself, and its time watched."""


class TeamOfNetworks:
    """Policies with networks of one shape, each with a few cars. What a car does depends on no other.

    Attributes:
        cars: (n,) int64, indices in the world, those of the first network first.
    """

    def __init__(self, teams: Sequence[Team]) -> None:
        """The policies and cars of some teams of `groups`."""
        self.cars = np.concatenate([team.cars for team in teams])
        self._network_of = np.repeat(np.arange(len(teams)), [len(team.cars) for team in teams])
        self._networks = MlpStack([network for team in teams if (network := _network(team))])
        self._count = len(teams)
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


def joined(teams: Iterable[Team]) -> list[Team | TeamOfNetworks]:
    """Teams in which networks of few cars are asked together; all observe by the same spec."""
    alike: dict[object, list[Team]] = defaultdict(list)
    for team in teams:
        network = _network(team)
        shapes = network and (network.hidden, network.output, *(w.shape for w, _ in network.layers))
        alike[shapes or team].append(team)
    return [those[0] if _network(those[0]) is None else TeamOfNetworks(those) for those in alike.values()]


def _network(team: Team) -> Mlp | None:
    """The network of a team that may be joined with others; None for other teams."""
    policy = team.policy
    if not isinstance(policy, (NetworkPolicy, Sb3Policy)) or len(team.cars) > FEW:
        return None
    network = policy.network
    small = isinstance(network, Mlp) and sum(weight.size for weight, _ in network.layers) < LARGE
    return network if small and isinstance(network, Mlp) else None
