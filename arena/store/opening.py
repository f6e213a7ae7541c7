"""What is done to a database before it is used: recognised, laid out if new, brought up to date if older.

The schema's version is the alembic revision in the table `nathlon_version`; the first version, one run in a
SQLite file, had its number in the file's header only, where older programs still look for it.
"""

from __future__ import annotations

import threading

import sqlalchemy as sa
from sqlalchemy.schema import CreateColumn

from nathlon.arena.store import schema
from nathlon.arena.store.database import APPLICATION_ID, Database, StoreFault
from nathlon.sim.errors import InputError

VERSIONS = tuple(f"{number:04}" for number in range(1, 9))  # the revisions in arena/migrations
FIRST, NEWEST = VERSIONS[0], VERSIONS[-1]
EMPTY = ""
VERSION_TABLE = "nathlon_version"


class NoStoreError(InputError):
    """There is no store yet where one must be."""


_one_at_a_time = threading.Lock()  # alembic keeps what it works on in its modules


def prepare(database: Database, must_exist: bool) -> None:
    """Make a store of the database if it is empty, or of the newest version if it is an older store.

    Raises InputError where it is another program's or of a version not known here, and NoStoreError where it
    is empty although it must exist already.
    """
    version = EMPTY
    if not must_exist:
        database.make_folder()
    if not must_exist or database.exists():
        with database.reading() as connection:
            version = _version(connection)
            if version == NEWEST and not _missing(connection):
                return
    if version == EMPTY and must_exist:
        raise NoStoreError(f"{database.name}: no such store; expected one that an earlier run has written")
    if database.read_only:
        raise InputError(
            f"{database.name}: a store of an older version, which cannot be brought up to date here; "
            "expected a folder and a file that can be written"
        )
    with database.restructuring() as connection:
        version = _version(connection)
        if version not in (EMPTY, NEWEST) and database.path:
            database.back_up(database.path.with_name(f"{database.path.name}.v{int(version)}.bak"))
        if version == EMPTY:
            _lay_out(connection)
            return
        if version != NEWEST:
            _migrate(connection, version)
        for statement in _missing(connection):
            connection.execute(statement)


def _version(connection: sa.Connection) -> str:
    """The schema version of a store; EMPTY where there is nothing yet; a fault for anything else."""
    tables = sa.inspect(connection).get_table_names()
    if connection.dialect.name == "sqlite":
        application = connection.exec_driver_sql("PRAGMA application_id").scalar_one()
        foreign = application != APPLICATION_ID and (application or tables)
        number = connection.exec_driver_sql("PRAGMA user_version").scalar_one()
    else:
        foreign = tables and VERSION_TABLE not in tables
        number = 0
    if foreign:
        raise StoreFault("a database of another program; expected a store of nathlon")
    if VERSION_TABLE in tables:
        version = connection.scalar(sa.text(f"SELECT version_num FROM {VERSION_TABLE}"))
    else:
        version = f"{number:04}" if tables else EMPTY
    if version not in (EMPTY, *VERSIONS):
        raise StoreFault(f"a store with schema version {version}; expected at most {NEWEST}")
    return version


def _lay_out(connection: sa.Connection) -> None:
    """Make a store where there is nothing, as all migrations would, which take a second to load and run."""
    schema.metadata.create_all(connection, checkfirst=False)
    versions = sa.Table(
        VERSION_TABLE, sa.MetaData(), sa.Column("version_num", sa.String(32), primary_key=True)
    )
    versions.create(connection)
    connection.execute(versions.insert().values(version_num=NEWEST))
    _mark(connection)


def _migrate(connection: sa.Connection, version: str) -> None:
    # Loaded only here: it takes long, and most stores are up to date.
    from alembic import command
    from alembic.config import Config

    config = Config(attributes={"connection": connection, "version_table": VERSION_TABLE})
    config.set_main_option("script_location", "nathlon.arena:migrations")
    with _one_at_a_time:
        if version == FIRST:
            command.stamp(config, FIRST)
        command.upgrade(config, NEWEST)
    _mark(connection)


def _mark(connection: sa.Connection) -> None:
    """Have the header of a SQLite file say what it is."""
    if connection.dialect.name == "sqlite":
        connection.exec_driver_sql(f"PRAGMA application_id = {APPLICATION_ID}")
        connection.exec_driver_sql(f"PRAGMA user_version = {int(NEWEST)}")


def _missing(connection: sa.Connection) -> list[sa.Executable]:
    """What lays out the stage tables, or their columns, that are not there yet."""
    inspector = sa.inspect(connection)
    there = set(inspector.get_table_names())
    statements: list[sa.Executable] = []
    for name, table in schema.stage_tables.items():
        if name not in there:
            statements.append(sa.schema.CreateTable(table))
            continue
        columns = {column["name"] for column in inspector.get_columns(name)}
        statements += [
            sa.text(
                f'ALTER TABLE "{name}" ADD COLUMN {CreateColumn(column).compile(dialect=connection.dialect)}'
            )
            for column in table.c
            if column.name not in columns
        ]
    return statements


def file_faults(connection: sa.Connection) -> list[str]:
    """What SQLite finds wrong with its file; nothing for PostgreSQL, which checks its own."""
    if connection.dialect.name != "sqlite":
        return []
    found = connection.exec_driver_sql("PRAGMA integrity_check").scalars().all()
    return [f"file: {' '.join(fault.split())}" for fault in found if fault != "ok"]
