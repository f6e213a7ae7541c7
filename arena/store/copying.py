"""Copying a store into another: from a file into a database, or the other way."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import sqlalchemy as sa

from nathlon.arena.store import matches, schema
from nathlon.arena.store.database import Database, StoreFault, insert_new

AT_ONCE = 200
"""Matches in a transaction."""
NUMBERED = (schema.run, schema.log)
"""Tables whose rows the database numbers."""
REST = (schema.run, schema.run_match, schema.fact, *schema.stage_tables.values(), schema.log)
"""What is copied after the matches, all at once."""

Rows = list[dict[str, Any]]


def copy(source: Database, target: Database, on_match: Callable[[int, int], None]) -> int:
    """Copy matches, runs and the log, and count the matches; a copy that was stopped goes on.

    Args:
        source: that is read.
        target: without runs and log.
        on_match: told how many matches are there, and how many there are in all.
    """
    target.read(_require_new)
    rest = source.read(_rest)
    # After the rest, not before: what that refers to is there by now, and stays.
    keys = source.read(_keys)
    missing = sorted(keys - target.read(_keys))
    on_match(len(keys) - len(missing), len(keys))
    for begin in range(0, len(missing), AT_ONCE):
        some = missing[begin : begin + AT_ONCE]
        target.write(_put_matches, *source.read(_matches, some))
        on_match(len(keys) - len(missing) + begin + len(some), len(keys))
    target.write(_put_rest, rest)
    return len(keys)


def _require_new(connection: sa.Connection) -> None:
    for table in NUMBERED:
        if connection.execute(sa.select(table).limit(1)).first():
            raise StoreFault("holds runs or a log already; expected a store that is new, or half copied")


def _keys(connection: sa.Connection) -> set[str]:
    return set(connection.scalars(sa.select(schema.match.c.key)))


def _rest(connection: sa.Connection) -> list[Rows]:
    return [_rows(connection, sa.select(table)) for table in REST]


def _rows(connection: sa.Connection, query: sa.Select) -> Rows:
    return [dict(row) for row in connection.execute(query).mappings()]


def _matches(connection: sa.Connection, keys: Sequence[str]) -> tuple[Rows, Rows]:
    match, result = schema.match, schema.result
    return (
        _rows(connection, sa.select(match).where(match.c.key.in_(keys))),
        _rows(connection, sa.select(result).where(result.c.match.in_(keys))),
    )


def _put_matches(connection: sa.Connection, found: Rows, results: Rows) -> None:
    connection.execute(insert_new(connection, schema.match), found)
    if results:
        connection.execute(insert_new(connection, schema.result), results)
    for fault in _otherwise(connection, [row["key"] for row in found]):
        raise StoreFault(fault)


def _otherwise(connection: sa.Connection, keys: Sequence[str]) -> Iterator[str]:
    """A sentence for each match that is not here as it was stored there."""
    for row in connection.execute(sa.select(schema.match).where(schema.match.c.key.in_(keys))):
        if matches.stored_digest(connection, row) != (row.rows, row.digest):
            yield f"match {row.key} would not be what was stored; expected an undamaged store to copy"


def _put_rest(connection: sa.Connection, rest: list[Rows]) -> None:
    for table, rows in zip(REST, rest, strict=True):
        if rows:
            connection.execute(insert_new(connection, table), rows)
    if connection.dialect.name == "postgresql":  # which goes on counting where it has counted itself
        for table in NUMBERED:
            last = sa.select(sa.func.max(table.c.id)).scalar_subquery()
            number = sa.func.pg_get_serial_sequence(table.name, "id")
            connection.execute(sa.select(sa.func.setval(number, last)).where(last.is_not(None)))
