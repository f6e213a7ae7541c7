"""The database under a store: a SQLite file or a PostgreSQL database, and its transactions."""

from __future__ import annotations

import logging
import os
import random
import sqlite3
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import Concatenate, ParamSpec, TypeVar
from urllib.parse import quote

import sqlalchemy as sa
from sqlalchemy.dialects import postgresql, sqlite
from sqlalchemy.engine.interfaces import DBAPIConnection
from sqlalchemy.pool import ConnectionPoolEntry

from nathlon.sim.errors import InputError
from nathlon.sim.extras import need
from nathlon.sim.whole_file import whole_file

log = logging.getLogger(__name__)

Arguments = ParamSpec("Arguments")
AnswerT = TypeVar("AnswerT")

APPLICATION_ID = 0x6E41544C  # "nATL", in a file's header: tells a store from any other database
BUSY_TIMEOUT_S = 30.0  # for a lock that another process holds
CONNECT_TIMEOUT_S = 10
POSTGRESQL = "postgresql+psycopg"
CONNECTIONS = 4
"""To a server that a process keeps open."""
MORE_CONNECTIONS = 12
"""That it opens beside them when its threads want them at once, and closes again."""
PATIENCE_S = 300.0
"""For a server that goes away: it restarts, or another takes its place."""
FIRST_WAIT_S, LONGEST_WAIT_S = 0.1, 5.0
"""Between two attempts; each wait is up to twice as long as the one before."""
PASSING = ("08", "40", "53", "57P")
"""How the SQLSTATEs begin of what passes: connections, transactions in each other's way, a server that is
full, or that stops or starts. See https://www.postgresql.org/docs/current/errcodes-appendix.html."""


class StoreFault(Exception):
    """What is wrong with a store, in one clause; its transaction puts the store's name in front."""


class Unreachable(InputError):
    """The server of a store does not answer, or went away; it may come back."""


class Database:
    """Connections and transactions; failures where the database is to blame are an InputError that names it.

    Attributes:
        name: the path, or the URL without its password.
        path: of the SQLite file; None for PostgreSQL.
        read_only: whether it is a SQLite file that cannot be written here, or lies in a folder that cannot.
    """

    def __init__(self, target: Path | str) -> None:
        """Use the SQLite file at a path or the PostgreSQL database at a URL; nothing is opened yet.

        Raises InputError where the URL is not one of PostgreSQL, or its driver is not installed.
        """
        if not str(target):
            raise InputError("the store has no name; expected the path of a file or the URL of a database")
        if isinstance(target, str) and "://" in target:
            url = _postgresql_url(target)
            self.path = None
            self.name = url.render_as_string(hide_password=True).split("?")[0]
        else:
            self.path = Path(target)
            self.name = str(target)
            url = sa.URL.create("sqlite", database=str(target))
        self.read_only = self.path is not None and self.exists() and not _writable(self.path)
        if self.path and self.read_only:
            url = _read_only_url(self.path)
        if self.path:
            self._engine = sa.create_engine(url, max_overflow=-1, connect_args={"timeout": BUSY_TIMEOUT_S})
            sa.event.listen(self._engine, "connect", _configure_sqlite)
            sa.event.listen(self._engine, "begin", _begin_sqlite)
        else:
            need("psycopg", "postgres", f"{self.name}: PostgreSQL")
            self._engine = sa.create_engine(
                url,
                pool_size=CONNECTIONS,
                max_overflow=MORE_CONNECTIONS,
                pool_pre_ping=True,
                connect_args={"prepare_threshold": None},  # statements are lost behind PgBouncer
            )
            sa.event.listen(self._engine, "begin", _begin_postgresql)

    def exists(self) -> bool:
        """Whether there is a SQLite file; True for PostgreSQL."""
        try:
            return self.path is None or self.path.is_file()
        except OSError as error:
            raise InputError(f"{self.name}: the store cannot be used: {error.strerror}") from None

    def close(self) -> None:
        self._engine.dispose()

    def make_folder(self) -> None:
        """Make the folder for a SQLite file."""
        if self.path:
            try:
                self.path.parent.mkdir(parents=True, exist_ok=True)
            except OSError as error:
                raise InputError(
                    f"{self.name}: the folder for the store cannot be made ({error.strerror})"
                ) from None

    def read(
        self,
        function: Callable[Concatenate[sa.Connection, Arguments], AnswerT],
        *arguments: Arguments.args,
        **named: Arguments.kwargs,
    ) -> AnswerT:
        """What a function gives in a transaction that only reads; again where the server went away."""

        def attempt() -> AnswerT:
            with self.reading() as connection:
                return function(connection, *arguments, **named)

        return self._patiently(attempt)

    def write(
        self,
        function: Callable[Concatenate[sa.Connection, Arguments], AnswerT],
        *arguments: Arguments.args,
        **named: Arguments.kwargs,
    ) -> AnswerT:
        """What a function gives in a transaction that writes; again where the server went away meanwhile.

        It may then have been done already: the function must come to the same if it is done twice.
        """

        def attempt() -> AnswerT:
            with self.writing() as connection:
                return function(connection, *arguments, **named)

        return self._patiently(attempt)

    def write_once(
        self,
        function: Callable[Concatenate[sa.Connection, Arguments], AnswerT],
        *arguments: Arguments.args,
        **named: Arguments.kwargs,
    ) -> AnswerT:
        """As `write`, but not again where the server went away as it was told to keep what was written."""

        def attempt() -> AnswerT:
            done = False
            try:
                with self.writing() as connection:
                    answer = function(connection, *arguments, **named)
                    done = True
            except Unreachable as error:
                if done:
                    raise InputError(f"{error}; what was to be written last may have been, or not") from error
                raise
            return answer

        return self._patiently(attempt)

    def _patiently(self, attempt: Callable[[], AnswerT]) -> AnswerT:
        began, wait = time.monotonic(), FIRST_WAIT_S
        while True:
            try:
                return attempt()
            except Unreachable as error:
                if time.monotonic() - began + wait > PATIENCE_S:
                    raise
                if wait == FIRST_WAIT_S:
                    log.warning("%s; trying again for %.0f s", error, PATIENCE_S)
            # Of many who lost the same server not all come back at once.
            time.sleep(wait * random.uniform(0.5, 1.0))
            wait = min(2.0 * wait, LONGEST_WAIT_S)

    @contextmanager
    def reading(self) -> Iterator[sa.Connection]:
        """A transaction that only reads and does not wait for those that write."""
        with self._blamed(), self._engine.begin() as connection:
            yield connection

    @contextmanager
    def writing(self) -> Iterator[sa.Connection]:
        """A transaction that writes whole or not at all; in a SQLite file the only one at its time."""
        with self._blamed(), self._engine.connect() as connection:
            connection = connection.execution_options(writes=True)
            with connection.begin():
                yield connection

    @contextmanager
    def restructuring(self) -> Iterator[sa.Connection]:
        """A transaction that may rebuild tables, the only such one at its time."""
        with self._blamed(), self._engine.connect() as connection:
            connection = connection.execution_options(writes=True)
            if self.path:
                # Rebuilding a table drops it, and with it what refers to it. No transaction can switch this.
                _driver(connection).execute("PRAGMA foreign_keys = OFF")
                connection.detach()
            with connection.begin():
                lock_exclusively(connection, APPLICATION_ID)
                yield connection
                if self.path and connection.exec_driver_sql("PRAGMA foreign_key_check").first():
                    raise StoreFault("damaged: rows refer to others that are not there")
        self._engine.dispose()  # a new file's next connections find a store, and use WAL

    def back_up(self, copy: Path) -> None:
        """Copy the SQLite file as it stands, whole or not at all."""
        try:
            with whole_file(copy) as partial, self._blamed(), self._engine.connect() as connection:
                target = sqlite3.connect(partial)
                try:
                    _driver(connection).backup(target)
                finally:
                    target.close()
        except (OSError, sqlite3.Error) as error:
            raise InputError(f"{copy}: the copy of the older store cannot be written ({error})") from None

    @contextmanager
    def _blamed(self) -> Iterator[None]:
        try:
            yield
        except sa.exc.DBAPIError as error:
            reason = " ".join(str(error.orig).split())
            if self.path and self.read_only and (left := _left_beside(self.path)):
                raise InputError(
                    f"{self.name}: its last writes are in {left.name}, which cannot be read here ({reason}); "
                    "expected a folder that can be written, or a copy of both files in one"
                ) from error
            kind = Unreachable if self.path is None and _passes(error) else InputError
            raise kind(f"{self.name}: the store cannot be used: {reason}") from error
        except sa.exc.TimeoutError as error:
            raise Unreachable(f"{self.name}: the store cannot be used: no connection is free") from error
        except UnicodeDecodeError as error:  # of sqlite3, for names of tables
            raise InputError(f"{self.name}: damaged: a text is not UTF-8 ({error.reason})") from None
        except StoreFault as error:
            raise InputError(f"{self.name}: {error}") from None


def _postgresql_url(text: str) -> sa.URL:
    scheme = text.split("://")[0]
    try:
        url = sa.make_url(text).set(drivername=POSTGRESQL)
    except (sa.exc.ArgumentError, ValueError):
        url = None
    if url is None or scheme not in (POSTGRESQL, "postgresql"):  # says no more of it: there may be a password
        raise InputError(
            f"{scheme}://...: no store; expected the path of a file or {POSTGRESQL}://user@host/database"
        )
    if "connect_timeout" not in url.query:
        url = url.update_query_dict({"connect_timeout": str(CONNECT_TIMEOUT_S)})
    return url


def _writable(path: Path) -> bool:
    """Whether SQLite can write to a file: it makes others beside it."""
    return os.access(path, os.W_OK) and os.access(path.parent, os.W_OK | os.X_OK)


def _left_beside(path: Path) -> Path | None:
    """The file beside a SQLite file that holds writes which are not in it; see https://sqlite.org/tempfiles.html."""
    beside = (path.with_name(path.name + end) for end in ("-wal", "-journal"))
    return next((file for file in beside if file.is_file() and file.stat().st_size), None)


def _read_only_url(path: Path) -> sa.URL:
    """To read a file where SQLite can make none beside it.

    If nobody has it open and all writes are in it, it is taken as one that does not change, for which SQLite
    needs no files beside it; else it uses those that are there. See https://sqlite.org/wal.html#read_only_databases.
    """
    in_use = _left_beside(path) or all(path.with_name(path.name + end).exists() for end in ("-wal", "-shm"))
    return sa.URL.create(
        "sqlite",
        database=f"file:{quote(str(path.absolute()))}",
        query={"uri": "true", "mode": "ro"} | ({} if in_use else {"immutable": "1"}),
    )


def _driver(connection: sa.Connection) -> sqlite3.Connection:
    driver = connection.connection.driver_connection
    assert isinstance(driver, sqlite3.Connection)
    return driver


def _configure_sqlite(connection: DBAPIConnection, _: ConnectionPoolEntry) -> None:
    connection.isolation_level = None  # transactions begin in _begin_sqlite: sqlite3 begins none for DDL
    connection.execute("PRAGMA foreign_keys = ON")
    if connection.execute("PRAGMA application_id").fetchone()[0] == APPLICATION_ID:
        # Rewrites the file's header: never a foreign file's. While others are in a new store it cannot, nor
        # where the file is read-only; not worth waiting for, as a later connection does it.
        connection.execute("PRAGMA busy_timeout = 0")
        with suppress(sqlite3.OperationalError):
            connection.execute("PRAGMA journal_mode = WAL")
        connection.execute(f"PRAGMA busy_timeout = {round(1000 * BUSY_TIMEOUT_S)}")


def _begin_sqlite(connection: sa.Connection) -> None:
    """A transaction that will write takes the lock at once: one that has read first could not wait for it."""
    writes = connection.get_execution_options().get("writes", False)
    connection.exec_driver_sql("BEGIN IMMEDIATE" if writes else "BEGIN")


def _begin_postgresql(connection: sa.Connection) -> None:
    """For this transaction only: behind PgBouncer the next one has another connection."""
    connection.exec_driver_sql(f"SET LOCAL lock_timeout = {round(1000 * BUSY_TIMEOUT_S)}")


def _passes(error: sa.exc.DBAPIError) -> bool:
    """Whether what a PostgreSQL server says may be otherwise in a while."""
    state = getattr(error.orig, "sqlstate", None)
    if state is None:
        return error.connection_invalidated or isinstance(error, sa.exc.OperationalError)
    return error.connection_invalidated or state.startswith(PASSING)


def lock_exclusively(connection: sa.Connection, lock: int) -> None:
    """Wait until no other transaction that writes holds this lock, until the end of this one."""
    if connection.dialect.name == "postgresql":  # SQLite has one such transaction at a time anyway
        connection.execute(sa.select(sa.func.pg_advisory_xact_lock(lock)))


def insert_new(connection: sa.Connection, table: sa.Table) -> postgresql.Insert | sqlite.Insert:
    """An INSERT that does nothing for a row whose key is there already."""
    if connection.dialect.name == "postgresql":
        return postgresql.insert(table).on_conflict_do_nothing()
    return sqlite.insert(table).on_conflict_do_nothing()


def clock(connection: sa.Connection) -> datetime:
    """The time, UTC, by the clock that all who share the database go by."""
    if connection.dialect.name == "postgresql":
        query = sa.select(sa.func.clock_timestamp(type_=sa.DateTime(timezone=True)))
        return connection.execute(query).scalar_one().astimezone(UTC)
    return datetime.now(UTC)


def stamp(time: datetime) -> str:
    """A UTC time as ISO 8601 text of fixed width, which sorts like the time."""
    return time.isoformat(timespec="microseconds")
