"""Who claims matches: a process, by a name that says where it runs and that no other has ever had."""

from __future__ import annotations

import logging
import os
import threading
from dataclasses import dataclass
from datetime import datetime
from itertools import count
from types import TracebackType
from typing import NamedTuple

from nathlon.arena.executor import Executor
from nathlon.arena.store import Store, WorkerRecord
from nathlon.sim.errors import InputError
from nathlon.sim.process import PLACE, has_ended, start_of

log = logging.getLogger(__name__)

LEASE_S = 120.0
"""For which a process has a match to itself, and is taken to be at work."""
RENEWALS = 4
"""Of a lease, before it would end."""
FAREWELL_S = 1.0
"""For the thread that renews to end."""


_numbers = count()


def owner_name(process: int | None = None) -> str:
    """A new name for a process of this machine, this one by default."""
    process = os.getpid() if process is None else process
    return f"{PLACE}/{process}/{start_of(process)}/{next(_numbers)}"


@dataclass(frozen=True)
class AtWork:
    """Who runs matches of a store.

    Attributes:
        host: name of the machine.
        process: its number there.
        processes: that run matches for it.
        matches_per_minute: since it began; None where that is not known.
        seen_at: when it was last heard of, UTC, ISO 8601; None where that is not known.
    """

    host: str
    process: int
    processes: int
    matches_per_minute: float | None = None
    seen_at: str | None = None


def at_work(store: Store) -> list[AtWork]:
    """Who runs matches of a store, as far as is known; who has ended on this machine does not."""
    found = [(_read(one.owner), one) for one in store.workers() if one.at_work and not is_gone(one.owner)]
    return [
        AtWork(name.host, name.process, one.processes, _pace(one), one.seen_at) for name, one in found if name
    ]


def _pace(worker: WorkerRecord) -> float | None:
    """Matches a minute."""
    if worker.ran is None or worker.began_at is None or worker.seen_at is None:
        return None
    began, seen = (datetime.fromisoformat(moment) for moment in (worker.began_at, worker.seen_at))
    minutes = (seen - began).total_seconds() / 60
    return round(worker.ran / minutes, 2) if minutes > 0 else None


def is_gone(owner: str) -> bool:
    """Whether an owner was a process on this machine that has ended."""
    name = _read(owner)
    if name is None or name.place != PLACE:
        return False
    return has_ended(name.process) or start_of(name.process) != name.start


def release_the_dead(store: Store) -> None:
    """Give free what processes of this machine had claimed that have ended."""
    for dead in filter(is_gone, store.owners()):
        store.release(dead)


class _Name(NamedTuple):
    place: str
    process: int
    start: int

    @property
    def host(self) -> str:
        return self.place.partition("pid:[")[0]


def _read(owner: str) -> _Name | None:
    """An owner's name in its parts; None for one that `owner_name` has not made."""
    place, *numbers = owner.rsplit("/", 3)
    whole = len(numbers) == 3 and all(number.isdecimal() for number in numbers)
    return _Name(place, int(numbers[0]), int(numbers[1])) if whole else None


class Claimant:
    """This process at work on a store, as long as it is entered; its claims are renewed meanwhile.

    Attributes:
        owner: its name.
        lease_s: how long a claim lasts unless it is renewed, s.
        ran: matches that it has run so far.
    """

    def __init__(self, store: Store, executor: Executor, lease_s: float = LEASE_S) -> None:
        self.owner, self.lease_s = owner_name(), lease_s
        self.ran = 0
        self._store, self._executor = store, executor
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._renew, daemon=True)

    def __enter__(self) -> Claimant:
        self._store.attend(self.owner, self._executor.workers, self.lease_s)
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._over.set()
        self._thread.join(FAREWELL_S)
        self._store.release(self.owner)

    def _renew(self) -> None:
        while not self._over.wait(self.lease_s / RENEWALS):
            try:
                self._store.attend(self.owner, self._executor.workers, self.lease_s, self.ran)
            except InputError as error:
                # What it claimed may be another's by now, which costs time and no result.
                log.warning("%s; claims could not be renewed", error)
