"""Files in a store, by the SHA-256 of their contents in hexadecimal.

Who wants matches sees that their files are there, and then puts them into the queue. So a file stays while a
match in the queue names it, and for a while after it was put or asked for.
"""

from __future__ import annotations

from collections.abc import Iterable
from datetime import timedelta

import sqlalchemy as sa

from nathlon.arena.store import schema
from nathlon.arena.store.database import clock, insert_new, stamp


def held(connection: sa.Connection, digests: Iterable[str]) -> set[str]:
    """Those of the digests whose files are there; they count as used now."""
    table = schema.file
    now = stamp(clock(connection))
    return {
        found
        # In one order, or two who ask at once wait for each other for ever.
        for chunk in schema.chunks(sorted(digests))
        for found in connection.scalars(
            table.update().where(table.c.digest.in_(chunk)).values(used_at=now).returning(table.c.digest)
        )
    }


def put(connection: sa.Connection, digest: str, content: bytes) -> None:
    """Keep a file, unless it is there."""
    used_at = stamp(clock(connection))
    row = {"digest": digest, "content": content, "used_at": used_at}
    connection.execute(insert_new(connection, schema.file), row)


def get(connection: sa.Connection, digest: str) -> bytes:
    """A file as it was kept; KeyError where it is not there."""
    content = connection.scalar(sa.select(schema.file.c.content).where(schema.file.c.digest == digest))
    if content is None:
        raise KeyError(digest)
    return content


def unused(connection: sa.Connection, age_s: float) -> tuple[set[str], str]:
    """Digests of files that no match in the queue names and nobody has used for so long; and since when."""
    table = schema.file.c
    until = stamp(clock(connection) - timedelta(seconds=age_s))
    old = set(connection.scalars(sa.select(table.digest).where(table.used_at <= until)))
    for spec in connection.scalars(sa.select(schema.queue.c.spec)):
        old.difference_update(schema.from_json(spec).get("entrants", ()))
    return old, until


def remove_unused(connection: sa.Connection, age_s: float) -> tuple[int, int]:
    """Remove what is `unused`: how many files, and their bytes.

    One that is asked for meanwhile stays, and a match that names it is put into the queue only after that.
    """
    digests, until = unused(connection, age_s)
    table, size = schema.file, 0
    removed = 0
    for chunk in schema.chunks(sorted(digests)):
        gone = table.delete().where(table.c.digest.in_(chunk), table.c.used_at <= until)
        sizes = list(connection.scalars(gone.returning(sa.func.length(table.c.content))))
        removed, size = removed + len(sizes), size + sum(sizes)
    return removed, size
