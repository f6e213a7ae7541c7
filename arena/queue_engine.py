"""The queue of a store as an engine: whoever takes matches from it, on any machine, works for it."""

from __future__ import annotations

import math
import time
from collections.abc import Generator, Sequence

from nathlon.arena.claimant import Claimant
from nathlon.arena.engine import Ended, LocalEngine, Work
from nathlon.arena.job import Wanted
from nathlon.arena.match import Match
from nathlon.arena.payload import labels
from nathlon.arena.pool import Pool
from nathlon.arena.queue import Taker, post
from nathlon.arena.recorder import Recorded
from nathlon.arena.store import Store
from nathlon.sim.errors import InputError

POST_AGAIN_S = 10.0
"""Between two looks whether all that is wanted is still in the queue."""


class QueueEngine:
    """Puts matches into the queue of a store, and takes part in running them with the processes of a pool.

    A match with a policy that cannot leave this machine is run here.
    """

    def __init__(self, store: Store, pool: Pool) -> None:
        """An engine for a store."""
        self._store, self._pool = store, pool
        self._local = LocalEngine(store, pool)

    @property
    def workers(self) -> int:
        """As of `MatchEngine`."""
        return self._pool.workers

    def run(self, matches: Sequence[Match]) -> Generator[Ended, None, None]:
        """As of `MatchEngine`."""
        leaving = [match for match in matches if labels(match, self._store.shared) is not None]
        staying = {match.key: match for match in matches} | dict.fromkeys(match.key for match in leaving)
        if here := [match for match in staying.values() if match is not None]:
            yield from self._local.run(here)
        if leaving:
            yield from self._share(leaving)

    def record(self, wanted: Sequence[Wanted]) -> Generator[tuple[Match, Recorded | InputError], None, None]:
        """As of `MatchEngine`: here."""
        return self._local.record(wanted)

    def _share(self, matches: Sequence[Match]) -> Generator[Ended, None, None]:
        known, posted = {match.key: match for match in matches}, set[str]()
        with Claimant(self._store, self._pool) as claimant:
            work = Work(self._store, self._pool, claimant, matches)
            taker = Taker(self._store, claimant, posted.__contains__, known, work.refused)
            next_post = -math.inf

            def prepare() -> None:
                # Again now and then: another selection that wanted the same matches may have withdrawn them.
                nonlocal next_post
                if time.monotonic() > next_post:
                    posted.update(post(self._store, work.left.values()))
                    next_post = time.monotonic() + POST_AGAIN_S

            try:
                yield from work.done(taker, prepare)
            except BaseException:
                self._store.withdraw(known)
                raise
