"""The queue of a store: putting wanted matches into it, and taking whole batches that can share a world."""

from __future__ import annotations

import json
import logging
import time
from collections.abc import Callable, Collection, Mapping
from dataclasses import asdict
from typing import Any

from nathlon.arena.claimant import Claimant, release_the_dead
from nathlon.arena.control import control
from nathlon.arena.engine import FULL, POLL_S, plenty, share
from nathlon.arena.grouping import fill, group, longest_first
from nathlon.arena.match import Match
from nathlon.arena.payload import Arrivals, labels, send
from nathlon.arena.queue_entry import DamagedError, check_entry, digest_of
from nathlon.arena.store import Queued, Store
from nathlon.arena.world_registry import load_world
from nathlon.sim.errors import InputError

log = logging.getLogger(__name__)

OWN = ("stage", "test", "entrants", "races")
"""What a match's spec says that its surroundings do not."""
Where = tuple[str, str, str, str]
"""World, circuit, car and scenario."""

AT_ONCE = 500
"""Matches that are put into the queue with their files before the next ones: others begin with them."""


def post(store: Store, matches: Collection[Match]) -> set[str]:
    """Put matches into the queue, and what goes with them into the store.

    Args:
        store: that has the queue.
        matches: whose policies can all leave this machine, see `nathlon.arena.payload.labels`.

    Returns:
        the digests of their surroundings.
    """
    ordered = longest_first(matches)
    shared = {where: facts_of(*where) for where in {where_of(match) for match in ordered}}
    digests = {where: digest_of(facts) for where, facts in shared.items()}
    for begin in range(0, len(ordered), AT_ONCE):
        some = ordered[begin : begin + AT_ONCE]
        if store.shared:
            send(store, some)
        entries = [
            Queued(match.key, digests[where_of(match)], _own(match), labels(match, store.shared) or [])
            for match in some
        ]
        store.enqueue(entries, {digests[where]: shared[where] for where in {where_of(each) for each in some}})
    return set(digests.values())


def where_of(match: Match) -> Where:
    """What is the same for all matches that can share a world."""
    return match.world, match.circuit, match.car, match.scenario


def facts_of(world: str, circuit: str, car: str, scenario: str) -> dict[str, Any]:
    """What a match's spec says beside `OWN`."""
    named = {"world": world, "circuit": circuit, "car": car, "scenario": scenario}
    return named | load_world(world, circuit, car).facts(scenario)


def _own(match: Match) -> dict[str, Any]:
    told = asdict(match)
    return {name: told[name] for name in OWN}


def difference(facts: Mapping[str, Any]) -> str | None:
    """Why this machine cannot run matches of some surroundings, in a clause; None where it can.

    Raises:
        InputError: if what they name is not here.
    """
    world = load_world(facts["world"], facts["circuit"], facts["car"])
    here = json.loads(json.dumps(world.facts(facts["scenario"])))
    for name, value in here.items():
        if facts.get(name) != value:
            plain = isinstance(value, str) and name in ("numpy", "numba", "onnxruntime")
            return f"{name} {value}, expected {facts.get(name)}" if plain else f"another state of {name!r}"
    return None


class Taker:
    """A feed of a pool: claims matches from the queue for processes that are idle.

    Attributes:
        set_aside: how many entries of the queue were no matches.
    """

    def __init__(
        self,
        store: Store,
        claimant: Claimant,
        accepts: Callable[[str], bool],
        known: Mapping[str, Match],
        refused: dict[str, InputError],
    ) -> None:
        """A taker.

        Args:
            store: that has the queue.
            claimant: who takes.
            accepts: whether matches of these surroundings can be run, by their digest.
            known: matches that need not be read from the queue, by key.
            refused: why matches cannot be run here, by key; they are left to others.
        """
        self.set_aside = 0
        self._refused = refused
        self._store, self._claimant, self._accepts, self._known = store, claimant, accepts, known
        self._arrivals = Arrivals(store)
        self._full: dict[str, int] = {}
        self._surroundings: dict[str, dict[str, Any]] = {}
        self._next, self._paused = 0.0, False

    def __call__(self, idle: int) -> list[list[Match]]:
        """See `nathlon.arena.executor.Feed`."""
        if time.monotonic() < self._next:
            return []
        said = control(self._store)
        if said.paused != self._paused:
            self._paused = said.paused
            log.warning("%s: %s by %s", self._store.name, "paused" if said.paused else "resumed", said.by)
        if said.paused:
            self._next = time.monotonic() + POLL_S
            return []
        at_work = sum(self._store.at_work().values())
        enough = plenty(at_work + idle, max(self._full.values(), default=FULL))
        waiting = self._store.waiting(enough, unclaimed=True)
        for digest, left in sorted(waiting.items(), key=lambda one: one[0] != said.first):
            if self._accepts(digest):
                most = share(left, idle, at_work, self._full.get(digest, FULL))
                owner, lease_s = self._claimant.owner, self._claimant.lease_s
                taken = self._store.take(digest, owner, most, lease_s, self._refused)
                matches = [match for one in taken if (match := self._match(one)) is not None]
                if matches:
                    self._full[digest] = fill(matches[0])
                    return group(matches, idle, rounds=1)
        release_the_dead(self._store)
        self._next = time.monotonic() + POLL_S
        return []

    def _facts(self, digest: str) -> dict[str, Any]:
        if digest not in self._surroundings:
            self._surroundings[digest] = self._store.surroundings(digest)
        return self._surroundings[digest]

    def _match(self, taken: Queued) -> Match | None:
        """A match from the queue; None, and its claim is dropped, where it cannot be run here.

        What is no match is taken out of the queue as well: whoever wants it puts it there again.
        """
        if taken.match in self._known:
            return self._known[taken.match]
        try:
            facts = self._facts(taken.surroundings)
            check_entry(taken, facts, self._store.name)
            sources = {
                entrant: self._arrivals.source(entrant, label)
                for entrant, label in zip(taken.spec["entrants"], taken.sources, strict=True)
            }
            return Match.from_spec(facts | taken.spec, sources)
        except KeyError:
            return None  # a worker has just set them aside, and this entry with them
        except InputError as error:
            log.warning("%s", error)
            if isinstance(error, DamagedError):
                self.set_aside += 1
                self._store.withdraw([taken.match])
            else:
                self._refused[taken.match] = error
            self._store.drop([taken.match], self._claimant.owner)
            return None
