"""The store: one SQLite file with the finished matches of a run and the tables made from them."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import TracebackType
from typing import Any

import polars as pl
import sqlalchemy as sa
from sqlalchemy.engine.interfaces import DBAPIConnection
from sqlalchemy.pool import ConnectionPoolEntry

from arena.results import RESULTS, TABLES
from sim.errors import InputError

APPLICATION_ID = 0x6E41544C  # "nATL", in the file's header: tells a store from any other database
SCHEMA_VERSION = 1
BUSY_TIMEOUT_S = 30.0

JsonValue = str | int | float | bool | None | list[Any] | dict[str, Any]

_COLUMN_TYPES: dict[pl.DataType, type[sa.types.TypeEngine]] = {
    pl.String(): sa.Text,
    pl.Int64(): sa.BigInteger,
    pl.Float64(): sa.Double,
    pl.Boolean(): sa.Boolean,
}

_metadata = sa.MetaData()
_match = sa.Table(
    "match",
    _metadata,
    sa.Column("key", sa.Text, primary_key=True),
    sa.Column("stage", sa.Text, nullable=False, index=True),
    sa.Column("spec", sa.Text, nullable=False),
)
_result = sa.Table(
    "result",
    _metadata,
    *(sa.Column(name, _COLUMN_TYPES[dtype]) for name, dtype in RESULTS.items()),
    sa.PrimaryKeyConstraint("match", "race", "car"),
    sa.ForeignKeyConstraint(["match"], ["match.key"]),
)
_tables = {
    name: sa.Table(
        name,
        _metadata,
        sa.Column("position", sa.BigInteger, primary_key=True, autoincrement=False),
        *(sa.Column(column, _COLUMN_TYPES[dtype]) for column, dtype in schema.items()),
    )
    for name, schema in TABLES.items()
}
_fact = sa.Table(
    "fact",
    _metadata,
    sa.Column("key", sa.Text, primary_key=True),
    sa.Column("value", sa.Text, nullable=False),
)


class Store:
    """Matches with their results, the stage tables, and facts about the run.

    Every method is one transaction: it happens whole or not at all, also beside other processes.
    NaN is kept as null. A frame that does not have the table's schema raises ValueError; a file that
    cannot be used raises InputError.
    """

    def __init__(self, path: Path) -> None:
        """Use the store at `path`; a missing one is made, with its folder.

        Raises InputError where the file is no store, is of another schema version, or cannot be
        written, or another process holds it for longer than 30 s.
        """
        self.path = path
        self._engine = sa.create_engine(
            sa.URL.create("sqlite", database=str(path)), connect_args={"timeout": BUSY_TIMEOUT_S}
        )
        sa.event.listen(self._engine, "connect", _configure)
        sa.event.listen(self._engine, "begin", _begin)
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InputError(f"{path}: the folder for the store cannot be made ({error.strerror})") from error
        try:
            with self._transaction() as connection:
                self._prepare(connection)
            self._engine.dispose()  # a new file's next connections find a store, and use WAL
        except BaseException:
            self.close()
            raise

    @classmethod
    def open(cls, path: Path) -> Store:
        """Use an existing store; InputError where there is none."""
        if not path.is_file():
            raise InputError(f"{path}: no such store; expected the file that an earlier run has written")
        return cls(path)

    def __enter__(self) -> Store:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        self._engine.dispose()

    def has(self, key: str) -> bool:
        """Whether the match with this key is stored."""
        with self._transaction() as connection:
            return _has(connection, key)

    def add_match(self, key: str, stage: str, spec: dict[str, Any], results: pl.DataFrame) -> bool:
        """Store a finished match whole; False, and no change, where its key is there already."""
        _check("result", results, RESULTS)
        if not results.select((pl.col("match") == key).all() & (pl.col("stage") == stage).all()).item():
            raise ValueError(f"results of match {key}: every row must name this match and stage {stage}")
        with self._transaction() as connection:
            if _has(connection, key):
                return False
            text = json.dumps(spec, sort_keys=True)
            connection.execute(_match.insert(), {"key": key, "stage": stage, "spec": text})
            _insert(connection, _result, results)
            return True

    def spec(self, key: str) -> dict[str, Any]:
        """What decides the outcome of a stored match; KeyError where it is not stored."""
        with self._transaction() as connection:
            text = connection.scalar(sa.select(_match.c.spec).where(_match.c.key == key))
        if text is None:
            raise KeyError(key)
        return json.loads(text)

    def results(self, stage: str | None = None) -> pl.DataFrame:
        """RESULTS of all matches, or of one stage's, ordered by stage, match, race and car."""
        columns = _result.c
        query = sa.select(_result).order_by(columns.stage, columns.match, columns.race, columns.car)
        if stage is not None:
            query = query.where(columns.stage == stage)
        with self._transaction() as connection:
            return _frame(connection.execute(query), RESULTS)

    def results_of(self, keys: Iterable[str]) -> pl.DataFrame:
        """RESULTS of these matches, in their order, each once; KeyError where one is not stored."""
        columns = _result.c
        query = (
            sa.select(_result).where(columns.match == sa.bindparam("key")).order_by(columns.race, columns.car)
        )
        rows: list[sa.Row] = []
        with self._transaction() as connection:
            for key in dict.fromkeys(keys):
                if not _has(connection, key):
                    raise KeyError(key)
                rows += connection.execute(query, {"key": key})
        return _frame(rows, RESULTS)

    def put_table(self, name: str, frame: pl.DataFrame) -> None:
        """Replace a stage table, one of `arena.results.TABLES`."""
        _check(name, frame, TABLES[name])
        with self._transaction() as connection:
            connection.execute(_tables[name].delete())
            _insert(connection, _tables[name], frame.with_row_index("position"))

    def table(self, name: str) -> pl.DataFrame:
        """A stage table as it was put; empty where it never was."""
        table = _tables[name]
        query = sa.select(*table.c[1:]).order_by(table.c.position)
        with self._transaction() as connection:
            return _frame(connection.execute(query), TABLES[name])

    def put_fact(self, key: str, value: JsonValue) -> None:
        """Keep a fact about the run, in place of the one that had this key."""
        with self._transaction() as connection:
            connection.execute(_fact.delete().where(_fact.c.key == key))
            connection.execute(_fact.insert(), {"key": key, "value": json.dumps(value, sort_keys=True)})

    def facts(self) -> dict[str, JsonValue]:
        """All facts, ordered by key."""
        with self._transaction() as connection:
            rows = connection.execute(sa.select(_fact).order_by(_fact.c.key)).all()
        return {row.key: json.loads(row.value) for row in rows}

    @contextmanager
    def _transaction(self) -> Iterator[sa.Connection]:
        """A transaction whose failures, where the file is to blame, name the file."""
        try:
            with self._engine.begin() as connection:
                yield connection
        except sa.exc.IntegrityError:
            raise
        except sa.exc.DatabaseError as error:
            raise InputError(f"{self.path}: the store cannot be used: {error.orig}") from error

    def _prepare(self, connection: sa.Connection) -> None:
        """Lay out a new file, recognise a store, refuse anything else."""
        application = connection.exec_driver_sql("PRAGMA application_id").scalar_one()
        version = connection.exec_driver_sql("PRAGMA user_version").scalar_one()
        objects = connection.exec_driver_sql("SELECT count(*) FROM sqlite_schema").scalar_one()
        if (application, version, objects) == (0, 0, 0):
            _metadata.create_all(connection)
            connection.exec_driver_sql(f"PRAGMA application_id = {APPLICATION_ID}")
            connection.exec_driver_sql(f"PRAGMA user_version = {SCHEMA_VERSION}")
        elif application != APPLICATION_ID:
            raise InputError(f"{self.path}: a database of another program; expected a store of nathlon")
        elif version != SCHEMA_VERSION:
            raise InputError(
                f"{self.path}: a store with schema version {version}; expected version {SCHEMA_VERSION}"
            )


def _configure(connection: DBAPIConnection, _: ConnectionPoolEntry) -> None:
    connection.isolation_level = None  # transactions begin in _begin: sqlite3 itself begins none for DDL
    connection.execute("PRAGMA foreign_keys = ON")
    if connection.execute("PRAGMA application_id").fetchone()[0] == APPLICATION_ID:
        connection.execute("PRAGMA journal_mode = WAL")  # rewrites the file's header: never a foreign file's


def _begin(connection: sa.Connection) -> None:
    """Take the write lock at once: a transaction that reads first could not wait for it later."""
    connection.exec_driver_sql("BEGIN IMMEDIATE")


def _has(connection: sa.Connection, key: str) -> bool:
    return connection.scalar(sa.select(sa.exists().where(_match.c.key == key))) is True


def _insert(connection: sa.Connection, table: sa.Table, frame: pl.DataFrame) -> None:
    if frame.height:  # without rows, insert() would add one of defaults
        connection.execute(table.insert(), frame.with_columns(pl.col(pl.Float64).fill_nan(None)).to_dicts())


def _frame(rows: Iterable[sa.Row], schema: pl.Schema) -> pl.DataFrame:
    return pl.DataFrame([tuple(row) for row in rows], schema=schema, orient="row")


def _check(name: str, frame: pl.DataFrame, schema: pl.Schema) -> None:
    if frame.schema != schema:
        raise ValueError(f"table {name}: expected the columns {dict(schema)}, not {dict(frame.schema)}")
