"""A store that is damaged, or on a disk that is full or read-only: it opens, or a sentence says why not."""

from __future__ import annotations

import os
import shutil
import sqlite3
import subprocess
import sys
from contextlib import closing
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from nathlon.arena.results import TABLES
from nathlon.arena.store import Store
from nathlon.sim.errors import InputError
from tests.support.stored import filled, match_of


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A store with something of everything, all of it in one file."""
    path = tmp_path_factory.mktemp("whole") / "store.sqlite"
    with Store(path) as store:
        store.begin_run("night", {"seed": 1})
        for key in ("a", "b", "c"):
            store.add_match(key, "pareto", {"seed": key}, match_of(key))
        store.use("night", ["c", "a"])
        store.put_table("night", "pareto", filled("pareto"))
        store.put_fact("night", "summary", {"seed": 1})
        store.append("fault", {"match": "a"}, "night")
        store.claim(["d"], "one", 60)
    with closing(sqlite3.connect(path)) as connection:
        connection.execute("PRAGMA wal_checkpoint(TRUNCATE)")
    return path


def read_all(path: Path) -> tuple[pl.DataFrame, list[str]]:
    """All results, and what `verify` finds; if that is nothing, everything else is read as well."""
    with Store(path) as store:
        results, faults = store.results(), store.verify()
        if faults:
            return results, faults
        for run in store.runs():
            store.results_of_run(run.name)
            store.facts(run.name)
            for name in TABLES:
                store.table(run.name, name)
        for key in store.stored("abc"):
            store.spec(key)
        store.log()
        store.claim(["d"], "two", 60)
    return results, faults


def test_a_file_cut_at_any_byte_opens_or_says_why(whole: Path, tmp_path: Path) -> None:
    data = whole.read_bytes()
    before, _ = read_all(whole)
    pages = [page + offset for page in range(0, len(data), 4096) for offset in (-1, 0, 1, 100)]
    others = np.random.default_rng(0).integers(len(data), size=20).tolist()
    sentences = []
    for length in sorted({n for n in (*pages, *others, 16, 99, 512) if 0 <= n < len(data)}):
        path = tmp_path / f"{length}.sqlite"
        path.write_bytes(data[:length])
        try:
            results, faults = read_all(path)
        except InputError as error:
            sentences.append(str(error))
        else:
            # SQLite takes a single byte for nothing, too.
            assert faults or results.equals(before) or length <= 1, length
    assert len(sentences) > 20
    assert not any("\n" in sentence for sentence in sentences)


def test_changed_bytes_are_noticed_or_have_changed_no_result(whole: Path, tmp_path: Path) -> None:
    data = np.frombuffer(whole.read_bytes(), np.uint8)
    before, _ = read_all(whole)
    rng = np.random.default_rng(1)
    written = np.flatnonzero(data)
    sentences = []
    for trial in range(60):
        changed = data.copy()
        where = rng.choice(written, size=1 + trial % 3)
        changed[where] ^= rng.integers(1, 256, where.size, dtype=np.uint8)
        path = tmp_path / f"{trial}.sqlite"
        path.write_bytes(changed.tobytes())
        try:
            results, faults = read_all(path)
        except InputError as error:
            sentences.append(str(error))
        else:
            assert faults or results.equals(before), where
            sentences += faults
    assert len(sentences) > 20
    assert not any("\n" in sentence for sentence in sentences)


def test_a_crash_at_any_byte_of_the_latest_writes_leaves_whole_matches(tmp_path: Path) -> None:
    """What a power failure leaves: the file, and its write-ahead log up to some byte."""
    path = tmp_path / "store.sqlite"
    with Store(path) as store:
        for number in range(6):
            store.add_match(f"m{number}", "pareto", {}, match_of(f"m{number}"))
        log = path.with_name("store.sqlite-wal").read_bytes()
        main = path.read_bytes()
    counts = set()
    for length in np.linspace(0, len(log), 25).astype(int):
        folder = tmp_path / str(length)
        folder.mkdir()
        (folder / "store.sqlite").write_bytes(main)
        (folder / "store.sqlite-wal").write_bytes(log[:length])
        with Store(folder / "store.sqlite") as store:
            assert store.verify() == []
            counts.add(len(store.stored(f"m{number}" for number in range(6))))
    assert counts >= {0, 6}
    assert len(counts) > 3


FILLING = """
import resource, sys
from nathlon.arena.store import Store
from nathlon.sim.errors import InputError
from tests.support.stored import match_of

resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[2]),) * 2)
done = 0
try:
    with Store(sys.argv[1]) as store:
        while True:
            store.add_match(f"m{done}", "pareto", {}, match_of(f"m{done}", races=20))
            done += 1
except InputError as error:
    print(done, error)
"""


EMPTY_STORE = 200_704  # bytes: a limit below it leaves no room for a match


@pytest.mark.parametrize("limit", [10_000, EMPTY_STORE + 100_000, EMPTY_STORE + 400_000])
def test_a_full_disk_stops_with_a_sentence_and_keeps_what_was_stored(limit: int, tmp_path: Path) -> None:
    path = tmp_path / "store.sqlite"
    command = [sys.executable, "-c", FILLING, str(path), str(limit)]
    answer = subprocess.run(command, capture_output=True, text=True, timeout=300)
    assert answer.stderr == ""
    done, sentence = answer.stdout.strip().split(" ", 1)
    assert sentence.startswith(f"{path}: the store cannot be used: ")
    assert (int(done) > 0) == (limit > EMPTY_STORE)
    with Store(path) as store:
        assert store.verify() == []
        assert store.results().height == int(done) * 60
        assert store.add_match("later", "pareto", {}, match_of("later"))


READ_ONLY = """
import os, sys
import alembic.command, alembic.config
from nathlon.arena.store import Store
from nathlon.sim.errors import InputError
from tests.support.stored import match_of

if os.geteuid() == 0:
    os.setuid(65534)
for name in sys.argv[1:]:
    try:
        with Store(name) as store:
            print("opened", store.results().height)
            store.add_match("new", "pareto", {}, match_of("new"))
    except InputError as error:
        print(error)
"""


def test_a_folder_that_cannot_be_written(whole: Path, tmp_path: Path) -> None:
    # A folder that anyone may reach, for root may write anywhere and becomes somebody else.
    folder = Path(shutil.copytree(whole.parent, f"/tmp/{tmp_path.name}-{os.getpid()}"))
    try:
        folder.chmod(0o555)
        (folder / "store.sqlite").chmod(0o444)
        command = [sys.executable, "-c", READ_ONLY, str(folder / "store.sqlite"), str(folder / "new.sqlite")]
        answer = subprocess.run(command, capture_output=True, text=True, timeout=300)
    finally:
        folder.chmod(0o755)
        shutil.rmtree(folder)
    assert answer.stderr == ""
    lines = answer.stdout.splitlines()
    assert all("the store cannot be used: " in line or line == "opened 18" for line in lines), lines
    assert len([line for line in lines if "cannot be used" in line]) == 2
