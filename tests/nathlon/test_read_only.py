"""Stores and folders that may be read and not written, or neither."""

from __future__ import annotations

import json
import shutil
import sqlite3
import subprocess
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import polars as pl
import pytest

from nathlon.arena.store import Store
from tests.support.stored import match_of
from tests.support.unprivileged import CommandLine, ordinary, ordinary_nathlon

CONFIG = 'checkpoints = ["."]\nstore = "nathlon.sqlite"\n'


@pytest.fixture(scope="module")
def nathlon() -> Iterator[CommandLine]:
    with ordinary_nathlon() as nathlon:
        yield nathlon


@pytest.fixture
def locked(tmp_path: Path) -> Iterator[Path]:
    """A folder with a configuration and a store of one night and one match, to be locked by `lock`."""
    folder = tmp_path / "locked"
    folder.mkdir()
    (folder / "nathlon.toml").write_text(CONFIG)
    fill(folder / "nathlon.sqlite")
    yield folder
    folder.chmod(0o755)


def fill(path: Path) -> None:
    with Store(path) as store:
        store.begin_run("night-0001", {})
        store.add_match("k", "pareto", {}, match_of("k"))


def lock(folder: Path, mode: int = 0o555) -> dict[str, bytes]:
    """Lock it, and return what is in it."""
    held = {path.name: path.read_bytes() for path in folder.iterdir()}
    folder.chmod(mode)
    return held


def runs(nathlon: CommandLine, folder: Path) -> list[str]:
    done = nathlon("status", "--verify", "--json", cwd=folder)
    assert done.returncode == 0, done.stderr
    said = json.loads(done.stdout)
    assert said["disagreements"] == []
    return [run["name"] for run in said["runs"]]


def refused(nathlon: CommandLine, folder: Path, *command: str | Path) -> str:
    done = nathlon(*command, cwd=folder)
    assert done.returncode == 2, done.stdout + done.stderr
    assert done.stderr.count("\n") == 1, done.stderr
    return done.stderr


def test_permissions_mean_something_here(locked: Path) -> None:
    lock(locked)
    assert subprocess.run(ordinary("touch", "new"), cwd=locked).returncode != 0


@pytest.mark.parametrize("files", [0o644, 0o444])
def test_a_store_in_a_folder_that_cannot_be_written_is_read(
    nathlon: CommandLine, locked: Path, tmp_path: Path, files: int
) -> None:
    for path in locked.iterdir():
        path.chmod(files)
    before = lock(locked)
    assert runs(nathlon, locked) == ["night-0001"]
    report = nathlon("report", "nathlon.sqlite", "--out", tmp_path / "report", cwd=locked)
    assert report.returncode == 0, report.stderr
    results = pl.read_parquet(tmp_path / "report" / "report" / "tables" / "results.parquet")
    assert results.is_empty()
    assert (tmp_path / "report" / "report" / "index.html").exists()
    assert {path.name: path.read_bytes() for path in locked.iterdir()} == before


def test_a_file_alone_that_cannot_be_written_is_read(nathlon: CommandLine, locked: Path) -> None:
    (locked / "nathlon.sqlite").chmod(0o444)
    assert runs(nathlon, locked) == ["night-0001"]


def test_odd_paths_of_read_only_stores(nathlon: CommandLine, locked: Path) -> None:
    name = "a b?mode=rwc&x#%20é.sqlite"
    (locked / "nathlon.sqlite").rename(locked / name)
    (locked / "nathlon.toml").write_text(CONFIG.replace("nathlon.sqlite", name))
    lock(locked)
    assert runs(nathlon, locked) == ["night-0001"]


@pytest.mark.parametrize("left", [("-shm",), ("-wal",), ("-wal", "-shm")])
def test_empty_files_beside_a_read_only_store_are_no_obstacle(
    nathlon: CommandLine, locked: Path, left: tuple[str, ...]
) -> None:
    for end in left:
        (locked / f"nathlon.sqlite{end}").touch()
    lock(locked)
    assert runs(nathlon, locked) == ["night-0001"]


def with_writes_beside(locked: Path, shared_memory: bool) -> None:
    """The store as one leaves it who is killed: a second night is in the file beside it only."""
    source = locked.parent / "open"
    source.mkdir()
    shutil.copy(locked / "nathlon.sqlite", source)
    with (
        Store(source / "nathlon.sqlite") as store,
        closing(sqlite3.connect(source / "nathlon.sqlite")) as other,
    ):
        other.execute("SELECT * FROM run").fetchall()
        store.begin_run("night-0002", {})
        for end in ("", "-wal", *(["-shm"] if shared_memory else [])):
            shutil.copy(source / f"nathlon.sqlite{end}", locked)
    with closing(sqlite3.connect(f"file:{locked / 'nathlon.sqlite'}?immutable=1", uri=True)) as alone:
        assert alone.execute("SELECT name FROM run").fetchall() == [("night-0001",)]


def test_writes_beside_a_read_only_store_are_read_where_they_can_be(
    nathlon: CommandLine, locked: Path
) -> None:
    with_writes_beside(locked, shared_memory=True)
    lock(locked)
    assert runs(nathlon, locked) == ["night-0001", "night-0002"]


def test_writes_beside_a_read_only_store_that_cannot_be_read_are_named(
    nathlon: CommandLine, locked: Path
) -> None:
    with_writes_beside(locked, shared_memory=False)
    before = lock(locked)
    said = refused(nathlon, locked, "status")
    assert "nathlon.sqlite: its last writes are in nathlon.sqlite-wal, which cannot be read here" in said
    assert "expected a folder that can be written" in said
    assert lock(locked) == before
    locked.chmod(0o755)
    assert runs(nathlon, locked) == ["night-0001", "night-0002"]


def test_a_reader_beside_one_who_writes(nathlon: CommandLine, locked: Path) -> None:
    with Store(locked / "nathlon.sqlite") as store:
        store.begin_run("night-0002", {})
        lock(locked)
        assert runs(nathlon, locked) == ["night-0001", "night-0002"]


def test_an_older_store_that_cannot_be_brought_up_to_date(nathlon: CommandLine, locked: Path) -> None:
    with closing(sqlite3.connect(locked / "nathlon.sqlite")) as connection:
        connection.execute("DROP TABLE ranking")
    lock(locked)
    assert "nathlon.sqlite: a store of an older version" in refused(nathlon, locked, "status")


def test_folders_without_permission_are_one_sentence(nathlon: CommandLine, locked: Path) -> None:
    lock(locked)
    assert "output folder cannot be written" in refused(
        nathlon, locked, "report", "nathlon.sqlite", "--out", "out"
    )
    assert "other.toml: cannot be written" in refused(nathlon, locked, "init", "other.toml")
    assert "Permission denied" in refused(nathlon, locked, "track", "show", "lindenring")
    lock(locked, 0)
    for command in (
        ("status", "--config", locked / "nathlon.toml"),
        ("report", locked / "nathlon.sqlite"),
        ("evaluate", locked / "a.safetensors"),
        ("race", locked / "a.safetensors"),
        ("track", "show", locked / "circuit.toml"),
        ("replay", locked / "race.mcap"),
        ("committee", locked / "nathlon.sqlite", "show"),
    ):
        assert "Permission denied" in refused(nathlon, locked.parent, *command), command
