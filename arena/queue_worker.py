"""A worker: runs matches from the queue of a store, on any machine that reaches it, until there are none."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Collection
from contextlib import closing
from dataclasses import dataclass
from itertools import chain

from nathlon.arena.claimant import LEASE_S, Claimant
from nathlon.arena.engine import POLL_S, race_into
from nathlon.arena.entrance import check_world
from nathlon.arena.kernels import compile_kernels
from nathlon.arena.pool import Pool
from nathlon.arena.queue import Taker, difference
from nathlon.arena.queue_entry import DamagedError, check_surroundings
from nathlon.arena.store import Store
from nathlon.arena.world_finding import RACING
from nathlon.sim.errors import InputError

log = logging.getLogger(__name__)

WAIT_S = 60.0
"""For which a worker waits for matches before it ends."""


@dataclass(frozen=True)
class Shift:
    """What a worker has done.

    Attributes:
        matches: that it ran.
        refused: matches that it could not run, and left to others.
        set_aside: entries of the queue, and surroundings, that were of no match, and are out of it.
    """

    matches: int
    refused: int
    set_aside: int = 0


def work(
    store: Store,
    pool: Pool,
    worlds: Collection[str] = (),
    wait_s: float = WAIT_S,
    lease_s: float = LEASE_S,
    on_match: Callable[[int], None] = lambda _: None,
) -> Shift:
    """Run matches that wait in a store until none has waited for a while.

    Args:
        store: that has the queue.
        pool: runs them.
        worlds: names of simulators that may be loaded, beside our own: they are code.
        wait_s: how long, s.
        lease_s: as of `Claimant`.
        on_match: told how many it has run, whenever one ends.

    Raises:
        InputError: if matches waited and none of them could be run here.
    """
    abilities, refused, ran = Abilities(store, pool, worlds), dict[str, InputError](), 0
    with Claimant(store, pool, lease_s) as claimant:
        taker = Taker(store, claimant, abilities.known, {}, refused)
        until = time.monotonic() + wait_s
        while True:
            abilities.look()
            with closing(race_into(store, pool, taker)) as rounds:
                for key, error in chain.from_iterable(ended.items() for ended in rounds):
                    if error:
                        log.warning("%s", error)
                        refused[key] = error
                        store.drop([key], claimant.owner)
                    else:
                        ran += 1
                        claimant.ran = ran
                        on_match(ran)
                    until = time.monotonic() + wait_s
            if abilities.look() > len(refused):
                until = time.monotonic() + wait_s
            elif time.monotonic() > until:
                break
            time.sleep(POLL_S)
    if abilities.lacking and not ran:
        raise InputError(abilities.lacking[0])
    for lack in abilities.lacking:
        log.warning("%s", lack)
    return Shift(ran, len(refused), taker.set_aside + abilities.set_aside)


class Abilities:
    """Which of the waiting matches this machine can run, by their surroundings.

    Attributes:
        lacking: a sentence for each of those that cannot be run here.
        set_aside: how many of them were of no match.
    """

    def __init__(self, store: Store, pool: Pool, worlds: Collection[str]) -> None:
        self.lacking: list[str] = []
        self.set_aside = 0
        self._able, self._seen = set[str](), set[str]()
        self._store, self._pool, self._worlds = store, pool, {RACING, *worlds}

    def known(self, digest: str) -> bool:
        """Whether matches of these surroundings can be run, as far as it was looked at."""
        return digest in self._able

    def look(self) -> int:
        """See what waits, make ready for what is new, and count the matches that can be run."""
        waiting = self._store.waiting()
        for digest in waiting.keys() - self._seen:
            self._seen.add(digest)
            try:
                self._prepare(digest)
                self._able.add(digest)
            except KeyError:
                self._seen.discard(digest)  # another worker has just set them aside
            except DamagedError as error:
                log.warning("%s", error)
                self.set_aside += 1
                self._store.withdraw_surroundings(digest)
                self._seen.discard(digest)
            except InputError as error:
                self.lacking.append(str(error))
        return sum(count for digest, count in waiting.items() if digest in self._able)

    def _prepare(self, digest: str) -> None:
        """Make ready for matches of some surroundings, or raise an InputError: they cannot be run here."""
        facts = self._store.surroundings(digest)
        check_surroundings(facts, digest, self._store.name)
        world, where = facts["world"], f"{self._store.name}: scenario {facts['scenario']!r}"
        if world not in self._worlds:
            raise InputError(
                f"{where}: the world is {world!r}, which is code, expected one named with --world"
            )
        check_world(self._pool, world)
        if lack := difference(facts):
            raise InputError(
                f"{where}: this machine has {lack}; expected the nathlon and packages of the run"
            )
        compile_kernels(self._pool, world, facts["circuit"], facts["car"], lambda done, total: None)
