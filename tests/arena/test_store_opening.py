"""What a store is opened on: nothing, an older store, a newer one, something else, an absent server."""

from __future__ import annotations

import sqlite3
import subprocess
import sys
from contextlib import closing
from pathlib import Path

import polars as pl
import pytest
import sqlalchemy as sa
from alembic.autogenerate import compare_metadata
from alembic.config import Config
from alembic.migration import MigrationContext
from alembic.script import ScriptDirectory
from polars.testing import assert_frame_equal

from nathlon.arena.results import TABLES
from nathlon.arena.store import Store, database, opening, schema
from nathlon.sim.errors import InputError
from tests.support.stored import filled, match_of

pytest_plugins = ["tests.support.databases"]

FIRST_VERSION = Path(__file__).parent.parent / "data" / "store_v1.sql"


def engine(target: str | Path) -> sa.Engine:
    return sa.create_engine(str(target) if "://" in str(target) else f"sqlite:///{target}")


def change(target: str | Path, *statements: str) -> None:
    with engine(target).begin() as connection:
        for statement in statements:
            connection.execute(sa.text(statement))


@pytest.fixture
def first(tmp_path: Path) -> Path:
    """A store of the first version: three matches, three tables and two facts."""
    path = tmp_path / "store.sqlite"
    with closing(sqlite3.connect(path)) as connection:
        connection.execute("PRAGMA journal_mode = WAL")
        connection.executescript(FIRST_VERSION.read_text("utf-8"))
    return path


def test_a_store_of_the_first_version_becomes_the_run_1(first: Path) -> None:
    frames = [match_of("a"), match_of("z"), match_of("b", "tournament")]
    with Store(first) as store:
        assert_frame_equal(store.results(), pl.concat(frames), check_exact=True)
        assert store.spec("b") == {"stage": "tournament", "races": [1, 2], "track": "ä"}
        assert store.verify() == []
        [run] = store.runs()
        assert (run.name, run.status, run.config) == ("1", "finished", {})
        assert_frame_equal(store.results_of_run("1"), pl.concat(frames))
        for name in TABLES:
            then = store.table("1", name)
            known = then.drop([column for column in then.columns if then[column].null_count() == then.height])
            if name in ("entrants", "pareto", "ranking"):
                assert_frame_equal(known, filled(name).select(known.columns))
                assert known.width > 5
            else:
                assert then.is_empty()
        assert store.facts("1") == {"summary": {"seed": 5, "stages": []}, "version": "0.1.0"}
        assert not store.add_match("a", "pareto", {}, match_of("a"))
        assert store.add_match("new", "pareto", {}, match_of("new"))
        assert store.begin_run("2", {}).id == 2


def test_the_first_version_is_copied_before_it_is_changed(first: Path) -> None:
    copy = first.with_name("store.sqlite.v1.bak")
    Store(first).close()
    with closing(sqlite3.connect(first)) as now, closing(sqlite3.connect(copy)) as then:
        assert now.execute("PRAGMA user_version").fetchone() == (int(opening.NEWEST),)
        dump = "\n".join(then.iterdump())
        assert dump in FIRST_VERSION.read_text("utf-8")
    copied = copy.stat().st_mtime_ns
    Store(first).close()
    assert copy.stat().st_mtime_ns == copied
    assert sorted(path.name for path in first.parent.glob("*")) == ["store.sqlite", "store.sqlite.v1.bak"]


def test_a_migration_that_fails_changes_nothing(first: Path) -> None:
    change(first, "CREATE TABLE log (something TEXT)")
    with pytest.raises(InputError, match=r"store\.sqlite.*log already exists"):
        Store(first)
    change(first, "DROP TABLE log")
    with closing(sqlite3.connect(first)) as connection:
        assert "\n".join(connection.iterdump()) in FIRST_VERSION.read_text("utf-8")
    with Store(first) as store:
        assert store.verify() == []


def test_processes_that_migrate_at_once_do_it_once(first: Path) -> None:
    code = (
        f"from nathlon.arena.store import Store; s = Store({str(first)!r}); "
        "print(s.runs()[0].began_at, s.verify())"
    )
    command = [sys.executable, "-c", code]
    processes = [subprocess.Popen(command, stdout=subprocess.PIPE, text=True) for _ in range(3)]
    answers = {process.communicate(timeout=300)[0] for process in processes}
    assert [process.returncode for process in processes] == [0, 0, 0]
    assert len(answers) == 1
    assert answers.pop().endswith("[]\n")


def differences(target: str | Path) -> list[object]:
    with engine(target).connect() as connection:
        context = MigrationContext.configure(connection, opts={"version_table": opening.VERSION_TABLE})
        return list(compare_metadata(context, schema.metadata))


def triggers(target: str | Path) -> set[tuple[object, ...]]:
    """Which tables have them, when, and what they do."""
    told = "SELECT tbl_name, name, sql FROM sqlite_master WHERE type = 'trigger'"
    if str(target).startswith("postgresql"):
        told = (
            "SELECT event_object_table, event_manipulation, action_statement FROM information_schema.triggers"
        )
    with engine(target).connect() as connection:
        return {tuple(row) for row in connection.execute(sa.text(told))}


def test_migrations_lead_to_the_tables_that_the_store_uses(target: str, first: Path) -> None:
    """And so does what lays out a new store."""
    Store(target).close()
    assert differences(target) == []
    laid_out = triggers(target)
    change(target, *(f'DROP TABLE "{table.name}"' for table in reversed(schema.metadata.sorted_tables)))
    change(target, f"DROP TABLE {opening.VERSION_TABLE}")
    if target.startswith("postgresql"):
        change(target, "DROP FUNCTION refuse_change_of_log")
    with engine(target).begin() as connection:
        opening._migrate(connection, opening.EMPTY)
    for store in (target, first):
        Store(store).close()
        assert differences(store) == []
    assert triggers(target) == laid_out
    assert laid_out


def test_the_versions_are_those_of_the_migrations() -> None:
    script = ScriptDirectory.from_config(Config(config_args={"script_location": "nathlon.arena:migrations"}))
    assert [revision.revision for revision in script.walk_revisions()][::-1] == list(opening.VERSIONS)


def test_a_stage_table_or_column_that_is_new_is_added(target: str) -> None:
    """As if `TABLES` had been shorter when the store was made."""
    with Store(target) as store:
        store.begin_run("night", {})
        store.put_table("night", "pareto", filled("pareto"))
    change(target, "DROP TABLE skills", "ALTER TABLE pareto DROP COLUMN races")
    with Store(target) as store:
        expected = filled("pareto").with_columns(races=pl.lit(None, pl.Int64))
        assert_frame_equal(store.table("night", "pareto"), expected)
        assert store.table("night", "skills").is_empty()
        store.put_table("night", "pareto", filled("pareto"))
        assert_frame_equal(store.table("night", "pareto"), filled("pareto"))
    assert differences(target) == []


def test_a_newer_store_is_refused(target: str) -> None:
    Store(target).close()
    change(target, f"UPDATE {opening.VERSION_TABLE} SET version_num = '0099'")
    with pytest.raises(InputError, match=rf"version 0099; expected at most {opening.NEWEST}$"):
        Store(target)


def test_a_database_of_another_program_is_refused_and_left_as_it_was(tmp_path: Path, postgres: str) -> None:
    path = tmp_path / "music.db"
    for target in (path, postgres):
        change(target, "CREATE TABLE song (title TEXT)")
        before = path.read_bytes()
        with pytest.raises(InputError, match="a database of another program; expected a store of nathlon"):
            Store(target)
        assert sa.inspect(engine(target)).get_table_names() == ["song"]
        assert path.read_bytes() == before


def test_a_file_that_is_no_database_is_refused_and_left_as_it_was(tmp_path: Path) -> None:
    path = tmp_path / "notes.txt"
    path.write_text("not a database, only a few words. " * 100)
    before = path.read_bytes()
    with pytest.raises(InputError, match=r"notes\.txt.*not a database"):
        Store(path)
    assert path.read_bytes() == before


def test_only_an_existing_store_is_opened_where_one_must_exist(tmp_path: Path, postgres: str) -> None:
    (tmp_path / "empty").touch()
    for target in (tmp_path / "missing" / "store.sqlite", tmp_path / "empty", postgres):
        with pytest.raises(InputError, match="no such store"):
            Store.open(target)
    assert [path.name for path in tmp_path.iterdir()] == ["empty"]
    assert sa.inspect(engine(postgres)).get_table_names() == []


def test_paths_that_cannot_hold_a_store_are_refused(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match="folder for the store"):
        Store(tmp_path / "file" / "run.db")
    with pytest.raises(InputError, match=str(tmp_path)):
        Store(tmp_path)


def test_a_store_that_another_program_holds_is_refused_in_time(
    target: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(database, "BUSY_TIMEOUT_S", 0.1)
    Store(target).close()
    with Store(target) as store, engine(target).connect() as holder:
        if "://" in target:
            holder.execute(sa.text("LOCK TABLE match"))
        else:
            holder.connection.driver_connection.execute("BEGIN IMMEDIATE")  # type: ignore[union-attr]
        with pytest.raises(InputError, match=r"the store cannot be used: .*lock"):
            store.add_match("k", "pareto", {}, match_of("k"))
        holder.rollback()
        if "://" not in target:
            holder.connection.driver_connection.execute("ROLLBACK")  # type: ignore[union-attr]
        assert store.add_match("k", "pareto", {}, match_of("k"))


@pytest.mark.parametrize(
    ("url", "reason"),
    [
        ("postgresql+psycopg://me:hush@/there?host=/nowhere", "the store cannot be used: "),
        ("postgresql://me:hush@localhost:1/there", "the store cannot be used: "),
        ("postgresql://me:hush@localhost:port/there", "no store; expected the path of a file or postgresql"),
        ("mysql://me:hush@localhost/there", "no store; expected"),
        ("http://[", "no store; expected"),
    ],
)
def test_a_server_that_cannot_be_reached_is_named_without_its_password(url: str, reason: str) -> None:
    with pytest.raises(InputError) as caught:
        Store(url)
    assert reason in str(caught.value)
    assert "hush" not in str(caught.value)
    assert "\n" not in str(caught.value)


def test_postgresql_without_its_driver(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "psycopg", None)
    with pytest.raises(InputError, match=r"PostgreSQL needs psycopg, .* pip install -e '\.\[postgres\]'"):
        Store("postgresql+psycopg://me@localhost/there")
