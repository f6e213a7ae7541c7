"""Engines: what has matches run, wherever that may be, and their results stored.

Claims and the store are the truth. An engine only sees to it that somebody works.
"""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Callable, Generator, Sequence
from contextlib import closing
from typing import NamedTuple, Protocol

from nathlon.arena.claimant import LEASE_S, Claimant, release_the_dead
from nathlon.arena.control import control
from nathlon.arena.executor import Executor, Feed
from nathlon.arena.grouping import GROUPS_A_WORKER, fill, group, longest_first
from nathlon.arena.job import Wanted
from nathlon.arena.match import Match
from nathlon.arena.processor import processor
from nathlon.arena.recorder import Recorded
from nathlon.arena.store import Finished, Store
from nathlon.sim.errors import InputError

POLL_S = 0.5
"""Between two looks for work, or at what others do."""
LOOK_S, LOOK_SHARE = 2.0, 20.0
"""Between two looks at what others have stored, at least; and how much longer than such a look takes."""
GATHER_S = 0.25
"""For which results are gathered before they are stored: a transaction costs more than a match."""
FULL = 16
"""Matches that are taken to fill a world as long as none of them has been seen."""


class Ended(NamedTuple):
    """A match whose results are in the store.

    Attributes:
        here: whether this machine has run it.
    """

    key: str
    here: bool


class Records(Protocol):
    """Runs matches once more to look at them: an engine, or an executor by itself."""

    def record(self, wanted: Sequence[Wanted]) -> Generator[tuple[Match, Recorded | InputError], None, None]:
        """As of `Executor`."""
        ...


class MatchEngine(Records, Protocol):
    """Has matches run, where is its affair: results go into the store, and only keys come back.

    Attributes:
        workers: processes that it starts, at most.
    """

    @property
    def workers(self) -> int: ...

    def run(self, matches: Sequence[Match]) -> Generator[Ended, None, None]:
        """Have matches run that the store does not hold, and yield each, once, as soon as it does.

        Raises:
            InputError: when all others have run, if a policy cannot be loaded or is another one by now.
        """
        ...


def race_into(
    store: Store, executor: Executor, feed: Feed
) -> Generator[dict[str, InputError | None], None, None]:
    """Run what a feed gives, and store together what ends within a moment.

    Yields:
        the keys that have ended, each with why it could not be run, if it could not.
    """
    ended: list[tuple[Match, Recorded | InputError]] = []
    due = 0.0
    with closing(executor.race(feed)) as rounds:
        for each in rounds:
            ended += each
            if ended and time.monotonic() >= due:
                yield _stored(store, ended)
                ended, due = [], time.monotonic() + GATHER_S
    yield _stored(store, ended)


def _stored(
    store: Store, ended: Sequence[tuple[Match, Recorded | InputError]]
) -> dict[str, InputError | None]:
    finished = [
        Finished(match.key, match.stage, match.spec(), answer.results, answer.processor or processor())
        for match, answer in ended
        if not isinstance(answer, InputError)
    ]
    if finished:
        store.add_matches(finished)
    return {match.key: answer if isinstance(answer, InputError) else None for match, answer in ended}


class Work:
    """Matches on their way into the store.

    Attributes:
        left: those that are not there yet and have not been refused here, by key.
        refused: why others cannot be run here, by key; some may be wanted by somebody else.
    """

    def __init__(
        self, store: Store, executor: Executor, claimant: Claimant, matches: Sequence[Match]
    ) -> None:
        self.left = {match.key: match for match in matches}
        self._wanted = frozenset(self.left)
        self._store, self._executor, self._claimant = store, executor, claimant
        self.refused: dict[str, InputError] = {}
        self._next_look = 0.0

    def done(self, feed: Feed, prepare: Callable[[], None] = lambda: None) -> Generator[Ended, None, None]:
        """Run what a feed gives until nothing is left; yield what has come into the store, also by others.

        Args:
            feed: claims matches.
            prepare: called before all that can be claimed now is run.

        Raises:
            InputError: at the end, if one was refused.
        """
        while True:
            yield from self._stored_by_others()
            if not self.left:
                break
            prepare()
            release_the_dead(self._store)
            left = len(self.left)
            yield from self._run(feed)
            if len(self.left) == left:
                time.sleep(POLL_S)
        for key, error in self.refused.items():
            if key in self._wanted:
                raise error

    def _run(self, feed: Feed) -> Generator[Ended, None, None]:
        with closing(race_into(self._store, self._executor, feed)) as rounds:
            for ended in rounds:
                ours = [key for key, error in ended.items() if self.left.pop(key, None) and not error]
                for key, error in ended.items():
                    if error:
                        self.refused[key] = error
                        self._store.drop([key], self._claimant.owner)
                self._claimant.ran += len(ours)
                for key in ours:
                    yield Ended(key, here=True)
                if time.monotonic() > self._next_look:
                    yield from self._stored_by_others()
                if not self.left:
                    return

    def _stored_by_others(self) -> Generator[Ended, None, None]:
        began = time.monotonic()
        for key in self._store.stored(self.left):
            del self.left[key]
            yield Ended(key, here=False)
        now = time.monotonic()
        self._next_look = now + max(LOOK_S, LOOK_SHARE * (now - began))


class LocalEngine:
    """An executor's processes, which share matches by claims with others that want the same ones."""

    def __init__(self, store: Store, executor: Executor, lease_s: float = LEASE_S) -> None:
        """An engine for a store; see `Claimant` for the lease."""
        self._store, self._executor, self._lease_s = store, executor, lease_s

    @property
    def workers(self) -> int:
        """As of `MatchEngine`."""
        return self._executor.workers

    def run(self, matches: Sequence[Match]) -> Generator[Ended, None, None]:
        """As of `MatchEngine`."""
        with Claimant(self._store, self._executor, self._lease_s) as claimant:
            work = Work(self._store, self._executor, claimant, matches)
            ordered, ahead = longest_first(matches), deque[Match]()

            def prepare() -> None:
                ahead.clear()
                ahead.extend(match for match in ordered if match.key in work.left)

            def feed(idle: int) -> list[list[Match]]:
                if control(self._store).paused:
                    return []
                while ahead and ahead[0].key not in work.left:
                    ahead.popleft()
                if not ahead:
                    return []
                most = share(len(ahead), idle, sum(self._store.at_work().values()), fill(ahead[0]))
                some = {match.key: match for match in (ahead.popleft() for _ in range(min(most, len(ahead))))}
                keys = self._store.claim(list(some), claimant.owner, self._lease_s)
                return group([some[key] for key in keys], idle, rounds=1)

            yield from work.done(feed, prepare)

    def record(self, wanted: Sequence[Wanted]) -> Generator[tuple[Match, Recorded | InputError], None, None]:
        """As of `MatchEngine`."""
        return self._executor.record(wanted)


def share(left: int, idle: int, at_work: int, full: int) -> int:
    """How many matches to claim at once: fewer and fewer, so that all who are at work end together.

    Args:
        left: matches that nobody has claimed.
        idle: processes that have nothing to do.
        at_work: processes on all machines.
        full: matches that fill a world; more than these gain nothing by running together.
    """
    even = math.ceil(left * idle / (GROUPS_A_WORKER * max(at_work, idle)))
    return min(even, most_at_once(full) * idle)


def most_at_once(full: int) -> int:
    """How many matches a process claims at most, see `share`."""
    return GROUPS_A_WORKER * full


def plenty(at_work: int, full: int) -> int:
    """How many matches must be left for more to make no difference to a share."""
    return GROUPS_A_WORKER * at_work * most_at_once(full)
