"""Claims in a store: leases on matches, so that processes that share it share the work."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta

import sqlalchemy as sa

from nathlon.arena.store import matches, schema
from nathlon.arena.store.database import APPLICATION_ID, clock, lock_exclusively, stamp

CLAIMS_LOCK = APPLICATION_ID + 1
LONGEST_S = 600.0
"""Of a lease. One that lasts longer from now was given by a clock that has been put back since."""


@dataclass(frozen=True)
class WorkerRecord:
    """Who runs matches, or has not said that it has ended.

    Attributes:
        processes: of its machine that run matches for it.
        until: it is taken to be at work, as the next two UTC, ISO 8601.
        began_at, seen_at: None where a worker of an older version does not say, as is `ran`.
        ran: matches since it began.
        at_work: whether it has been heard of in time.
    """

    owner: str
    processes: int
    until: str
    began_at: str | None
    seen_at: str | None
    ran: int | None
    at_work: bool


def grant(connection: sa.Connection, keys: Sequence[str], owner: str, for_s: float) -> list[str]:
    """Those of the keys, in their order, on which the owner now has a lease."""
    lock_exclusively(connection, CLAIMS_LOCK)
    cap(connection)
    table, now = schema.claim, clock(connection)
    held: set[str] = set()
    for chunk in schema.chunks(keys):
        alive = sa.select(table.c.match).where(
            table.c.match.in_(chunk), table.c.owner != owner, table.c.until > stamp(now)
        )
        held.update(connection.scalars(alive))
    # After the claims, not before: storing a match drops its claim, and may come in between.
    refused = held | matches.stored(connection, keys)
    granted = [key for key in dict.fromkeys(keys) if key not in refused]
    give(connection, granted, owner, now + timedelta(seconds=for_s))
    return granted


def cap(connection: sa.Connection) -> None:
    """Cut leases that last too long, see `LONGEST_S`."""
    latest = stamp(clock(connection) + timedelta(seconds=LONGEST_S))
    for table in (schema.claim, schema.worker):
        connection.execute(table.update().where(table.c.until > latest).values(until=latest))


def give(connection: sa.Connection, keys: Sequence[str], owner: str, until: datetime) -> None:
    """Lease matches to an owner, whoever had a lease on them."""
    table, latest = schema.claim, clock(connection) + timedelta(seconds=LONGEST_S)
    for chunk in schema.chunks(keys):
        connection.execute(table.delete().where(table.c.match.in_(chunk)))
        rows = [{"match": key, "owner": owner, "until": stamp(min(until, latest))} for key in chunk]
        connection.execute(table.insert(), rows)


def attend(connection: sa.Connection, owner: str, processes: int, for_s: float, ran: int) -> None:
    """Note that an owner is at work, and have all its leases last for this long from now."""
    lock_exclusively(connection, CLAIMS_LOCK)
    now = clock(connection)
    until = stamp(now + timedelta(seconds=min(for_s, LONGEST_S)))
    worker, claim = schema.worker, schema.claim
    row = {"processes": processes, "until": until, "seen_at": stamp(now), "ran": ran}
    known = connection.execute(worker.update().where(worker.c.owner == owner).values(row))
    if not known.rowcount:
        connection.execute(worker.insert(), {"owner": owner, "began_at": stamp(now), **row})
    connection.execute(claim.update().where(claim.c.owner == owner).values(until=until))


def at_work(connection: sa.Connection) -> dict[str, int]:
    """Who is at work, and with how many processes."""
    table = schema.worker.c
    query = sa.select(table.owner, table.processes).where(table.until > stamp(clock(connection)))
    return {row.owner: row.processes for row in connection.execute(query.order_by(table.owner))}


def workers(connection: sa.Connection) -> list[WorkerRecord]:
    """All who are at work, or have not said that they have ended."""
    table, now = schema.worker.c, stamp(clock(connection))
    columns = (table.owner, table.processes, table.until, table.began_at, table.seen_at, table.ran)
    rows = connection.execute(sa.select(*columns).order_by(table.owner))
    return [WorkerRecord(*row, at_work=row.until > now) for row in rows]


def release(connection: sa.Connection, owner: str) -> None:
    """Drop all claims of an owner, who is no longer at work."""
    lock_exclusively(connection, CLAIMS_LOCK)
    for table in (schema.claim, schema.worker):
        connection.execute(table.delete().where(table.c.owner == owner))


def drop(connection: sa.Connection, keys: Sequence[str], owner: str) -> None:
    """Drop an owner's claims on some matches."""
    table = schema.claim
    for chunk in schema.chunks(keys):
        connection.execute(table.delete().where(table.c.match.in_(chunk), table.c.owner == owner))


def owners(connection: sa.Connection) -> list[str]:
    """All who hold a claim or are at work, or have let that expire."""
    found = sa.union(*(sa.select(table.c.owner) for table in (schema.claim, schema.worker)))
    return sorted(connection.scalars(found))
