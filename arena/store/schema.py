"""The tables of a store, and the way of frames and JSON values into and out of them.

What may change with a migration only (`arena/migrations`) is spelt out; the stage tables follow
`nathlon.arena.results.TABLES`, and what an existing store lacks of them is added when it is opened.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from typing import Any

import polars as pl
import sqlalchemy as sa

from nathlon.arena.results import RESULTS, TABLES
from nathlon.arena.store.database import StoreFault

JsonValue = str | int | float | bool | None | list[Any] | dict[str, Any]

CHUNK = 1000  # values in one IN (...): far below the limits of both databases

_COLUMN_TYPES: dict[pl.DataType, type[sa.types.TypeEngine]] = {
    pl.String(): sa.Text,
    pl.Int64(): sa.BigInteger,
    pl.Float64(): sa.Double,
    pl.Boolean(): sa.Boolean,
}
_RUNNING_NUMBER = sa.BigInteger().with_variant(sa.Integer, "sqlite")  # SQLite counts INTEGER keys only


def _columns(schema: pl.Schema) -> list[sa.Column]:
    return [sa.Column(name, _COLUMN_TYPES[dtype]) for name, dtype in schema.items()]


metadata = sa.MetaData()
match = sa.Table(
    "match",
    metadata,
    sa.Column("key", sa.Text, primary_key=True),
    sa.Column("stage", sa.Text, nullable=False, index=True),
    sa.Column("spec", sa.Text, nullable=False),  # JSON
    sa.Column("rows", sa.BigInteger, nullable=False),
    sa.Column("digest", sa.Text, nullable=False),
    sa.Column("processor", sa.Text),
)
result = sa.Table(
    "result",
    metadata,
    *_columns(RESULTS),
    sa.PrimaryKeyConstraint("match", "race", "car"),
    sa.ForeignKeyConstraint(["match"], ["match.key"]),
)
run = sa.Table(
    "run",
    metadata,
    sa.Column("id", _RUNNING_NUMBER, primary_key=True),
    sa.Column("name", sa.Text, nullable=False, unique=True),
    sa.Column("began_at", sa.Text, nullable=False),
    sa.Column("ended_at", sa.Text),
    sa.Column("status", sa.Text, nullable=False),
    sa.Column("config", sa.Text, nullable=False),  # JSON
)
run_match = sa.Table(
    "run_match",
    metadata,
    sa.Column("run", sa.ForeignKey("run.id"), primary_key=True),
    sa.Column("match", sa.ForeignKey("match.key"), primary_key=True),
    sa.Column("position", sa.BigInteger, nullable=False),
)
fact = sa.Table(
    "fact",
    metadata,
    sa.Column("run", sa.ForeignKey("run.id"), primary_key=True),
    sa.Column("key", sa.Text, primary_key=True),
    sa.Column("value", sa.Text, nullable=False),  # JSON
)
claim = sa.Table(
    "claim",
    metadata,
    sa.Column("match", sa.Text, primary_key=True),
    sa.Column("owner", sa.Text, nullable=False),
    sa.Column("until", sa.Text, nullable=False),
)
worker = sa.Table(
    "worker",
    metadata,
    sa.Column("owner", sa.Text, primary_key=True),
    sa.Column("processes", sa.BigInteger, nullable=False),
    sa.Column("until", sa.Text, nullable=False),
    sa.Column("began_at", sa.Text),
    sa.Column("seen_at", sa.Text),
    sa.Column("ran", sa.BigInteger),  # matches since it began
)
surroundings = sa.Table(
    "surroundings",
    metadata,
    sa.Column("digest", sa.Text, primary_key=True),
    sa.Column("facts", sa.Text, nullable=False),  # JSON
)
queue = sa.Table(
    "queue",
    metadata,
    sa.Column("id", _RUNNING_NUMBER, primary_key=True),
    sa.Column("match", sa.Text, nullable=False, unique=True),
    sa.Column("surroundings", sa.ForeignKey("surroundings.digest"), nullable=False),
    sa.Column("spec", sa.Text, nullable=False),  # JSON
    sa.Column("sources", sa.Text, nullable=False),  # JSON
    sa.Index("ix_queue_surroundings_id", "surroundings", "id"),
)
file = sa.Table(
    "file",
    metadata,
    sa.Column("digest", sa.Text, primary_key=True),
    sa.Column("content", sa.LargeBinary, nullable=False),
    sa.Column("used_at", sa.Text),  # when it was last put or asked for
)
log = sa.Table(
    "log",
    metadata,
    sa.Column("id", _RUNNING_NUMBER, primary_key=True),
    sa.Column("at", sa.Text, nullable=False),
    sa.Column("kind", sa.Text, nullable=False, index=True),
    sa.Column("run", sa.ForeignKey("run.id")),
    sa.Column("entry", sa.Text, nullable=False),  # JSON
)
LOG_TRIGGERS = {
    "sqlite": (
        """CREATE TRIGGER log_update BEFORE UPDATE ON log
        BEGIN SELECT RAISE(ABORT, 'the log is append-only'); END""",
        """CREATE TRIGGER log_delete BEFORE DELETE ON log
        BEGIN SELECT RAISE(ABORT, 'the log is append-only'); END""",
        # INSERT OR REPLACE deletes without asking the trigger above.
        """CREATE TRIGGER log_replace BEFORE INSERT ON log WHEN EXISTS (SELECT 1 FROM log WHERE id = new.id)
        BEGIN SELECT RAISE(ABORT, 'the log is append-only'); END""",
    ),
    "postgresql": (
        """CREATE FUNCTION refuse_change_of_log() RETURNS trigger LANGUAGE plpgsql
        AS $$ BEGIN RAISE EXCEPTION 'the log is append-only'; END $$""",
        """CREATE TRIGGER log_change BEFORE UPDATE OR DELETE OR TRUNCATE ON log
        FOR EACH STATEMENT EXECUTE FUNCTION refuse_change_of_log()""",
    ),
}
for _dialect, _statements in LOG_TRIGGERS.items():
    for _statement in _statements:
        _trigger = sa.DDL(_statement).execute_if(dialect=_dialect)  # type: ignore[no-untyped-call]
        sa.event.listen(log, "after_create", _trigger)
stage_tables = {
    name: sa.Table(
        name,
        metadata,
        sa.Column("run", sa.ForeignKey("run.id"), primary_key=True),
        sa.Column("position", sa.BigInteger, primary_key=True, autoincrement=False),
        *_columns(schema),
    )
    for name, schema in TABLES.items()
}


def check(name: str, frame: pl.DataFrame, schema: pl.Schema) -> None:
    """Raise ValueError where a frame does not have the table's schema."""
    if frame.schema != schema:
        raise ValueError(f"table {name}: expected the columns {dict(schema)}, not {dict(frame.schema)}")


def insert_frame(connection: sa.Connection, table: sa.Table, frame: pl.DataFrame) -> None:
    """Append a frame's rows, NaN as null."""
    if frame.height:  # without rows, insert() would add one of defaults
        connection.execute(table.insert(), frame.with_columns(pl.col(pl.Float64).fill_nan(None)).to_dicts())


def read_frame(connection: sa.Connection, query: sa.Select, schema: pl.Schema) -> pl.DataFrame:
    """The rows of a query of the schema's columns, in its order."""
    rows = connection.execute(query).all()
    try:
        return pl.DataFrame([tuple(row) for row in rows], schema=schema, orient="row")
    except (TypeError, OverflowError, pl.exceptions.PolarsError) as error:
        raise StoreFault(f"damaged: a column holds what is not of its type ({error})") from None


def to_json(value: JsonValue) -> str:
    return json.dumps(value, sort_keys=True)


def from_json(text: str) -> Any:
    try:
        return json.loads(text)
    except (TypeError, ValueError, RecursionError):
        raise StoreFault(f"damaged: expected JSON, not {str(text)[:40]!r}") from None


def chunks(keys: Iterable[str]) -> Iterator[list[str]]:
    """The keys, each once and in their order, by the thousand."""
    once = list(dict.fromkeys(keys))
    for start in range(0, len(once), CHUNK):
        yield once[start : start + CHUNK]
