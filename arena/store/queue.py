"""The queue in a store: matches that somebody wants, with all that is needed to run them elsewhere."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import timedelta
from typing import Any

import sqlalchemy as sa

from nathlon.arena.store import claims, matches, schema
from nathlon.arena.store.database import clock, insert_new, lock_exclusively, stamp

COUNTED = 10_000
"""Matches that wait: more need no exact number, where nobody says how many matter."""


@dataclass(frozen=True)
class Queued:
    """A match that somebody wants.

    Attributes:
        match: its key.
        surroundings: digest of all that decides its outcome beside it, see `Store.enqueue`.
        spec: the rest of what decides it, plain JSON values.
        sources: where to load its entrants from.
    """

    match: str
    surroundings: str
    spec: dict[str, Any]
    sources: list[str]


def put(connection: sa.Connection, wanted: Sequence[Queued], surroundings: Mapping[str, Any]) -> None:
    """Append matches that are neither stored nor in the queue."""
    there = matches.stored(connection, [each.match for each in wanted])
    new = [
        {
            "match": each.match,
            "surroundings": each.surroundings,
            "spec": schema.to_json(each.spec),
            "sources": schema.to_json(each.sources),
        }
        for each in wanted
        if each.match not in there
    ]
    if new:
        facts = [{"digest": name, "facts": schema.to_json(value)} for name, value in surroundings.items()]
        connection.execute(insert_new(connection, schema.surroundings), facts)
        connection.execute(insert_new(connection, schema.queue), new)


def waiting(connection: sa.Connection, most: int = COUNTED) -> dict[str, int]:
    """How many matches are in the queue, those that are claimed among them, by their surroundings.

    Of each no more than `most` are counted: all who are at work ask for that again and again.
    """
    table, known = schema.queue.c, schema.surroundings.c
    those = table.surroundings == known.digest
    first = sa.select(sa.func.min(table.id)).where(those).correlate(schema.surroundings).scalar_subquery()
    some = sa.select(table.id).where(those).limit(most).correlate(schema.surroundings).subquery()
    count = sa.select(sa.func.count()).select_from(some).scalar_subquery()
    query = sa.select(known.digest, first.label("first"), count.label("matches"))
    rows = connection.execute(query).all()
    return {row.digest: row.matches for row in sorted(rows, key=lambda row: row.first or 0) if row.matches}


def surroundings(connection: sa.Connection, digest: str) -> dict[str, Any]:
    """Facts by their digest; KeyError where there are none."""
    table = schema.surroundings.c
    text = connection.scalar(sa.select(table.facts).where(table.digest == digest))
    if text is None:
        raise KeyError(digest)
    return schema.from_json(text)


def take(
    connection: sa.Connection, digest: str, owner: str, most: int, for_s: float, but: Iterable[str] = ()
) -> list[Queued]:
    """Lease the first matches of the same surroundings that nobody has a lease on."""
    lock_exclusively(connection, claims.CLAIMS_LOCK)
    claims.cap(connection)
    now = clock(connection)
    table, claim = schema.queue, schema.claim.c
    held = sa.select(claim.match).where(claim.match == table.c.match, claim.until > stamp(now))
    query = sa.select(table.c.match, table.c.surroundings, table.c.spec, table.c.sources)
    query = query.where(table.c.surroundings == digest, ~held.exists()).order_by(table.c.id)
    if refused := list(but):
        query = query.where(table.c.match.not_in(refused))
    rows = connection.execute(query.limit(most)).all()
    # After the claims, not before: storing a match drops its claim, and may come in between.
    there = matches.stored(connection, [row.match for row in rows])
    remove(connection, there)
    free = [row for row in rows if row.match not in there]
    claims.give(connection, [row.match for row in free], owner, now + timedelta(seconds=for_s))
    return [
        Queued(row.match, row.surroundings, schema.from_json(row.spec), schema.from_json(row.sources))
        for row in free
    ]


def remove(connection: sa.Connection, keys: Iterable[str]) -> None:
    """Take matches out of the queue."""
    for chunk in schema.chunks(keys):
        connection.execute(schema.queue.delete().where(schema.queue.c.match.in_(chunk)))
