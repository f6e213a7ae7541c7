"""Claims in a store: leases on matches, so that processes that share it share the work."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import timedelta

import sqlalchemy as sa

from nathlon.arena.store import matches, schema
from nathlon.arena.store.database import APPLICATION_ID, clock, lock_exclusively, stamp

CLAIMS_LOCK = APPLICATION_ID + 1
LONGEST_S = 600.0
"""Of a lease. One that lasts longer from now was given by a clock that has been put back since."""


def grant(connection: sa.Connection, keys: Sequence[str], owner: str, for_s: float) -> list[str]:
    """Those of the keys, in their order, on which the owner now has a lease."""
    lock_exclusively(connection, CLAIMS_LOCK)
    table, now = schema.claim, clock(connection)
    latest = stamp(now + timedelta(seconds=LONGEST_S))
    connection.execute(table.update().where(table.c.until > latest).values(until=latest))
    held: set[str] = set()
    for chunk in schema.chunks(keys):
        alive = sa.select(table.c.match).where(
            table.c.match.in_(chunk), table.c.owner != owner, table.c.until > stamp(now)
        )
        held.update(connection.scalars(alive))
    # After the claims, not before: storing a match drops its claim, and may come in between.
    refused = held | matches.stored(connection, keys)
    granted = [key for key in dict.fromkeys(keys) if key not in refused]
    for chunk in schema.chunks(granted):
        connection.execute(table.delete().where(table.c.match.in_(chunk)))
        until = stamp(now + timedelta(seconds=min(for_s, LONGEST_S)))
        connection.execute(table.insert(), [{"match": key, "owner": owner, "until": until} for key in chunk])
    return granted


def release(connection: sa.Connection, owner: str) -> None:
    """Drop all claims of an owner."""
    lock_exclusively(connection, CLAIMS_LOCK)
    connection.execute(schema.claim.delete().where(schema.claim.c.owner == owner))


def owners(connection: sa.Connection) -> list[str]:
    """All who hold a claim or have let one expire."""
    return list(connection.scalars(sa.select(schema.claim.c.owner).distinct().order_by(schema.claim.c.owner)))
