"""Processes that share a store: each match is claimed by one, run by one and stored once."""

from __future__ import annotations

import sqlite3
import subprocess
import sys
import time
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from pathlib import Path

import polars as pl
import sqlalchemy as sa

from nathlon.arena.store import Store
from tests.support.stored import filled, match_of

pytest_plugins = ["tests.support.databases"]

WORKER = """
import random, sys, time
from nathlon.arena.store import Store
from tests.support.stored import match_of

target, name, count = sys.argv[1], sys.argv[2], int(sys.argv[3])
keys = [f"m{number}" for number in range(count)]
random.Random(name).shuffle(keys)
with Store(target) as store:
    store.begin_run("night", {})
    while left := [key for key in keys if key not in store.stored(keys)]:
        granted = store.claim(left[:3], name, 60)
        for key in granted:
            print(key, flush=True)
            assert store.add_match(key, "pareto", {"by": name}, match_of(key))
        if not granted:
            time.sleep(0.01)
    store.use("night", sorted(keys))
    store.append("done", {}, "night")
"""


def test_processes_share_the_work_and_do_nothing_twice(target: str) -> None:
    """They find no store, make it, and go for the same matches in different orders."""
    workers = [
        subprocess.Popen(
            [sys.executable, "-c", WORKER, target, f"worker {number}", "40"],
            stdout=subprocess.PIPE,
            text=True,
        )
        for number in range(3)
    ]
    done = [worker.communicate(timeout=300)[0].split() for worker in workers]
    assert [worker.returncode for worker in workers] == [0, 0, 0]
    assert Counter(key for keys in done for key in keys) == {f"m{number}": 1 for number in range(40)}
    with Store.open(target) as store:
        assert store.verify() == []
        assert store.results_of_run("night").equals(
            pl.concat([match_of(key) for key in sorted(f"m{number}" for number in range(40))])
        )
        assert len(store.runs()) == 1
        assert len(store.log("done", "night")) == 3
        assert store.owners() == []


def test_of_many_who_ask_at_once_one_is_granted_each_match(target: str) -> None:
    keys = [f"m{number}" for number in range(30)]
    with Store(target) as store, ThreadPoolExecutor(8) as threads:
        orders = [keys[shift:] + keys[:shift] for shift in range(8)]
        answers = list(threads.map(lambda i: store.claim(orders[i], f"owner {i}", 60), range(8)))
        assert sorted(key for answer in answers for key in answer) == sorted(keys)


def test_of_many_who_store_the_same_match_one_does(target: str) -> None:
    with Store(target) as store, ThreadPoolExecutor(8) as threads:
        stored = list(
            threads.map(lambda i: store.add_match("k", "pareto", {"by": i}, match_of("k")), range(8))
        )
        assert sorted(stored) == [False] * 7 + [True]
        assert store.spec("k") == {"by": stored.index(True)}
        assert store.verify() == []


def test_many_who_write_to_the_same_run_do_not_disturb_each_other(target: str) -> None:
    keys = [f"m{number}" for number in range(8)]
    with Store(target) as store, ThreadPoolExecutor(8) as threads:
        for key in keys:
            store.add_match(key, "pareto", {}, match_of(key))

        def write(number: int) -> None:
            store.begin_run("night", {})
            store.put_table("night", "pareto", filled("pareto").head(1 + number % 2))
            store.put_fact("night", "last", number)
            store.use("night", [keys[number], keys[0]])

        list(threads.map(write, range(8)))
        assert store.table("night", "pareto").height in (1, 2)
        assert store.facts("night")["last"] in range(8)
        assert sorted(store.results_of_run("night")["match"].unique()) == keys


def test_a_claim_excludes_others_until_it_is_released(target: str) -> None:
    with Store(target) as store:
        assert store.claim(["a", "b", "a"], "one", 60) == ["a", "b"]
        assert store.claim(["c", "b"], "two", 60) == ["c"]
        assert store.owners() == ["one", "two"]
        store.release("one")
        assert store.owners() == ["two"]
        assert store.claim(["b", "c", "a"], "three", 60) == ["b", "a"]


def test_an_owner_renews_its_claims_and_learns_which_are_lost(target: str) -> None:
    with Store(target) as store:
        assert store.claim(["a", "b"], "one", 0.05) == ["a", "b"]
        assert store.claim(["a"], "one", 60) == ["a"]
        time.sleep(0.1)
        assert store.claim(["a", "b"], "two", 60) == ["b"]
        assert store.claim(["a", "b"], "one", 60) == ["a"]


def test_a_stored_match_is_never_granted_and_has_no_claim(target: str) -> None:
    with Store(target) as store:
        store.claim(["a", "b"], "one", 60)
        store.add_match("a", "pareto", {}, match_of("a"))
        assert store.claim(["a", "b"], "one", 60) == ["b"]
        assert store.claim(["a"], "two", 60) == []
        store.add_match("b", "pareto", {}, match_of("b"))
        assert store.owners() == []


def test_readers_do_not_wait_for_a_writer(tmp_path: Path) -> None:
    path = tmp_path / "store.sqlite"
    with Store(path) as store:
        store.add_match("k", "pareto", {}, match_of("k"))
        writer = sa.create_engine(f"sqlite:///{path}").connect()
        writer.connection.driver_connection.execute("BEGIN IMMEDIATE")  # type: ignore[union-attr]
        assert store.has("k")
        assert store.results().height == 6
        with Store.open(path) as other:
            assert other.verify() == []
        writer.close()


def test_a_new_store_opens_while_another_process_reads_it(tmp_path: Path) -> None:
    """As long as somebody reads, SQLite cannot go over to its write-ahead log."""
    path = tmp_path / "store.sqlite"
    Store(path).close()
    with closing(sqlite3.connect(path, isolation_level=None)) as reader:
        assert reader.execute("PRAGMA journal_mode = DELETE").fetchone() == ("delete",)
        reader.execute("BEGIN")
        assert reader.execute("SELECT count(*) FROM match").fetchone() == (0,)
        with Store.open(path) as store:
            assert store.results().is_empty()
        reader.execute("ROLLBACK")
    with Store.open(path) as store:
        assert store.add_match("k", "pareto", {}, match_of("k"))
