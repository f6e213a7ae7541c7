"""The log in a store: entries are appended; the database refuses to change or delete them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import sqlalchemy as sa

from nathlon.arena.store import runs, schema
from nathlon.arena.store.database import clock, stamp


@dataclass(frozen=True)
class LogEntry:
    """An entry of the log.

    Attributes:
        at: UTC, ISO 8601.
        kind: what it is: a ballot, a decision, an exclusion, a fault.
        run: name of the run that it belongs to; None where to none.
        entry: plain JSON values.
    """

    id: int
    at: str
    kind: str
    run: str | None
    entry: dict[str, Any]


def append(connection: sa.Connection, kind: str, entry: dict[str, Any], run: str | None) -> LogEntry:
    """Append an entry."""
    at, text = stamp(clock(connection)), schema.to_json(entry)
    belongs_to = None if run is None else runs.find(connection, run)
    row = {"at": at, "kind": kind, "run": belongs_to, "entry": text}
    number = connection.execute(schema.log.insert().returning(schema.log.c.id), row).scalar_one()
    return LogEntry(number, at, kind, run, schema.from_json(text))


def last(connection: sa.Connection, kind: str) -> LogEntry | None:
    """The last entry of a kind."""
    log = schema.log.c
    query = sa.select(log.id, log.at, log.kind, schema.run.c.name, log.entry)
    query = query.select_from(schema.log.outerjoin(schema.run)).where(log.kind == kind)
    row = connection.execute(query.order_by(log.id.desc()).limit(1)).one_or_none()
    return None if row is None else LogEntry(*row[:4], schema.from_json(row[4]))


def entries(connection: sa.Connection, kind: str | None, run: str | None) -> list[LogEntry]:
    """All entries, or those of a kind, of a run, or both, in the order in which they were appended."""
    log = schema.log.c
    query = sa.select(log.id, log.at, log.kind, schema.run.c.name, log.entry).order_by(log.id)
    query = query.select_from(schema.log.outerjoin(schema.run))
    if kind is not None:
        query = query.where(log.kind == kind)
    if run is not None:
        query = query.where(log.run == runs.find(connection, run))
    return [
        LogEntry(number, at, kind, name, schema.from_json(text))
        for number, at, kind, name, text in connection.execute(query)
    ]
