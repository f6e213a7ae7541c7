"""An engine that has matches run by the nodes of a Ray cluster."""

from __future__ import annotations

from collections.abc import Generator, Sequence

from nathlon.arena.claimant import LEASE_S
from nathlon.arena.engine import Ended, LocalEngine
from nathlon.arena.job import Wanted
from nathlon.arena.match import Match
from nathlon.arena.on_ray.nodes import Nodes
from nathlon.arena.payload import labels
from nathlon.arena.pool import Pool
from nathlon.arena.recorder import Recorded
from nathlon.arena.store import Store
from nathlon.sim.errors import InputError


class RayEngine:
    """The nodes of a cluster as one engine; claims are made and results stored by this process.

    A match with a policy that cannot leave this machine is run here.
    """

    def __init__(self, store: Store, pool: Pool, nodes: Nodes, lease_s: float = LEASE_S) -> None:
        """An engine for a store; see `Claimant` for the lease."""
        self._here = LocalEngine(store, pool, lease_s)
        self._there = LocalEngine(store, nodes, lease_s)

    @property
    def workers(self) -> int:
        """As of `MatchEngine`."""
        return self._there.workers

    def run(self, matches: Sequence[Match]) -> Generator[Ended, None, None]:
        """As of `MatchEngine`."""
        for engine, some in (
            (self._there, [match for match in matches if _leaves(match)]),
            (self._here, [match for match in matches if not _leaves(match)]),
        ):
            if some:
                yield from engine.run(some)

    def record(self, wanted: Sequence[Wanted]) -> Generator[tuple[Match, Recorded | InputError], None, None]:
        """As of `MatchEngine`."""
        for engine, some in (
            (self._there, [each for each in wanted if _leaves(each.match)]),
            (self._here, [each for each in wanted if not _leaves(each.match)]),
        ):
            if some:
                yield from engine.record(some)


def _leaves(match: Match) -> bool:
    return labels(match, shared=True) is not None
