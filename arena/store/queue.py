"""The queue in a store: matches that somebody wants, with all that is needed to run them elsewhere."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Any

import sqlalchemy as sa

from nathlon.arena.store import claims, matches, schema
from nathlon.arena.store.database import StoreFault, clock, insert_new, lock_exclusively, stamp

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

    Of one that comes from the queue nothing has been checked.
    """

    match: str
    surroundings: str
    spec: dict[str, Any]
    sources: list[str]


def put(connection: sa.Connection, wanted: Sequence[Queued], surroundings: Mapping[str, Any]) -> None:
    """Append matches that are neither stored nor in the queue; what is damaged there is replaced."""
    there = matches.stored(connection, [each.match for each in wanted])
    remove(connection, _damaged(connection, wanted))
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


def _damaged(connection: sa.Connection, wanted: Sequence[Queued]) -> list[str]:
    """Keys of the wanted matches that the queue has otherwise: what decides a match follows from its key."""
    expected = {each.match: (each.surroundings, schema.to_json(each.spec)) for each in wanted}
    table = schema.queue.c
    return [
        row.match
        for chunk in schema.chunks(expected)
        for row in connection.execute(
            sa.select(table.match, table.surroundings, table.spec).where(table.match.in_(chunk))
        )
        if (row.surroundings, row.spec) != expected[row.match]
    ]


def _readable(text: Any) -> Any:
    """A JSON value; None where it is none, which whoever takes the match says."""
    try:
        return schema.from_json(text)
    except StoreFault:
        return None


def waiting(connection: sa.Connection, most: int = COUNTED, unclaimed: bool = False) -> dict[str, int]:
    """How many matches are in the queue, by their surroundings; see `Store.waiting`.

    Of each no more than `most` are counted: all who are at work ask for that again and again.
    """
    table, known = schema.queue.c, schema.surroundings.c
    those = table.surroundings == known.digest
    first = sa.select(sa.func.min(table.id)).where(those).correlate(schema.surroundings).scalar_subquery()
    counted = sa.select(table.id).where(those)
    if unclaimed:
        counted = counted.where(_unclaimed(clock(connection)))
    some = counted.limit(most).correlate(schema.surroundings).subquery()
    count = sa.select(sa.func.count()).select_from(some).scalar_subquery()
    query = sa.select(known.digest, first.label("first"), count.label("matches"))
    rows = connection.execute(query).all()
    return {row.digest: row.matches for row in sorted(rows, key=lambda row: row.first or 0) if row.matches}


def surroundings(connection: sa.Connection, digest: str) -> Any:
    """Facts by their digest, of which nothing has been checked; KeyError where there are none."""
    table = schema.surroundings.c
    text = connection.scalar(sa.select(table.facts).where(table.digest == digest))
    if text is None:
        raise KeyError(digest)
    return _readable(text)


def take(
    connection: sa.Connection, digest: str, owner: str, most: int, for_s: float, but: Iterable[str] = ()
) -> list[Queued]:
    """Lease the first matches of the same surroundings that nobody has a lease on."""
    lock_exclusively(connection, claims.CLAIMS_LOCK)
    claims.cap(connection)
    now = clock(connection)
    table = schema.queue
    query = sa.select(table.c.match, table.c.surroundings, table.c.spec, table.c.sources)
    query = query.where(table.c.surroundings == digest, _unclaimed(now)).order_by(table.c.id)
    if refused := list(but):
        query = query.where(table.c.match.not_in(refused))
    rows = connection.execute(query.limit(most)).all()
    # After the claims, not before: storing a match drops its claim, and may come in between.
    there = matches.stored(connection, [row.match for row in rows])
    remove(connection, there)
    free = [row for row in rows if row.match not in there]
    claims.give(connection, [row.match for row in free], owner, now + timedelta(seconds=for_s))
    return [Queued(row.match, row.surroundings, _readable(row.spec), _readable(row.sources)) for row in free]


def _unclaimed(now: datetime) -> sa.ColumnElement[bool]:
    """Whether nobody has a lease on a match of the queue."""
    claim = schema.claim.c
    held = sa.select(claim.match).where(claim.match == schema.queue.c.match, claim.until > stamp(now))
    return ~held.exists()


def remove_surroundings(connection: sa.Connection, digest: str) -> None:
    """Take surroundings out, and all matches in the queue that have them."""
    connection.execute(schema.queue.delete().where(schema.queue.c.surroundings == digest))
    connection.execute(schema.surroundings.delete().where(schema.surroundings.c.digest == digest))


def remove(connection: sa.Connection, keys: Iterable[str]) -> None:
    """Take matches out of the queue."""
    for chunk in schema.chunks(keys):
        connection.execute(schema.queue.delete().where(schema.queue.c.match.in_(chunk)))
