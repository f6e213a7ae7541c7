"""Files in a store, by the SHA-256 of their contents in hexadecimal."""

from __future__ import annotations

from collections.abc import Iterable

import sqlalchemy as sa

from nathlon.arena.store import schema
from nathlon.arena.store.database import insert_new


def held(connection: sa.Connection, digests: Iterable[str]) -> set[str]:
    """Those of the digests whose files are there."""
    digest = schema.file.c.digest
    return {
        found
        for chunk in schema.chunks(digests)
        for found in connection.scalars(sa.select(digest).where(digest.in_(chunk)))
    }


def put(connection: sa.Connection, digest: str, content: bytes) -> None:
    """Keep a file, unless it is there."""
    connection.execute(insert_new(connection, schema.file), {"digest": digest, "content": content})


def get(connection: sa.Connection, digest: str) -> bytes:
    """A file as it was kept; KeyError where it is not there."""
    content = connection.scalar(sa.select(schema.file.c.content).where(schema.file.c.digest == digest))
    if content is None:
        raise KeyError(digest)
    return content
