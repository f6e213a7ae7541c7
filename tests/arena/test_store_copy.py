"""A store that is copied into another database."""

from __future__ import annotations

import sqlite3
from contextlib import closing
from pathlib import Path

import pytest

from nathlon.arena.results import TABLES
from nathlon.arena.store import Store
from tests.support.command_line import nathlon, refused
from tests.support.stored import filled, match_of

pytest_plugins = ["tests.support.databases"]


def fill(target: Path | str) -> None:
    with Store(target) as store:
        for number in range(5):
            store.add_match(f"m{number}", "pareto", {"n": number}, match_of(f"m{number}"))
        for run in ("first", "second"):
            store.begin_run(run, {"of": run})
            store.use(run, ["m3", "m1"])
            store.put_fact(run, "seen", [run])
            for name in TABLES:
                store.put_table(run, name, filled(name))
            store.append("said", {"by": run}, run)
        store.end_run("first", "done")
        store.claim(["m9"], "somebody", 60)


def held(target: Path | str) -> list[object]:
    """All that a copy must have, in a form that compares."""
    with Store.open(target) as store:
        runs = [record.name for record in store.runs()]
        return [
            store.runs(),
            store.log(),
            store.results().to_dicts(),
            [store.facts(run) for run in runs],
            [store.results_of_run(run).to_dicts() for run in runs],
            [store.table(run, name).to_dicts() for run in runs for name in TABLES],
            store.verify(),
        ]


def test_a_store_goes_into_a_database_and_back(tmp_path: Path, postgres: str) -> None:
    first, back = tmp_path / "first.sqlite", tmp_path / "back.sqlite"
    fill(first)
    there = nathlon("store", "copy", first, postgres, "--json", cwd=tmp_path)
    assert there.returncode == 0, there.stderr
    assert nathlon("store", "copy", postgres, back, cwd=tmp_path).returncode == 0
    assert held(postgres) == held(back) == held(first)
    for target in (postgres, back):
        with Store.open(target) as store:
            assert store.owners() == [], "claims stay where they are"
            # The database goes on counting after those that were copied.
            store.begin_run("third", {})
            assert store.append("said", {}, "third").id == 3
            assert [record.id for record in store.runs()] == [1, 2, 3]


def test_a_copy_that_was_stopped_goes_on(tmp_path: Path) -> None:
    first, second = tmp_path / "first.sqlite", tmp_path / "second.sqlite"
    fill(first)
    with Store(second) as store:
        store.add_match("m2", "pareto", {"n": 2}, match_of("m2"))
    assert nathlon("store", "copy", first, second, cwd=tmp_path).returncode == 0
    assert held(second) == held(first)


def test_a_store_with_runs_of_its_own_is_left_as_it_is(tmp_path: Path) -> None:
    first, second = tmp_path / "first.sqlite", tmp_path / "second.sqlite"
    for path in (first, second):
        fill(path)
    before = held(second)
    refused(nathlon("store", "copy", first, second, cwd=tmp_path), "second.sqlite", "holds runs")
    assert held(second) == before


def test_a_match_that_has_changed_is_not_copied(tmp_path: Path) -> None:
    first = tmp_path / "first.sqlite"
    fill(first)
    with closing(sqlite3.connect(first)) as connection, connection:
        connection.execute("UPDATE result SET place = 9 WHERE match = 'm2' AND car = 1 AND race = 0")
    done = nathlon("store", "copy", first, tmp_path / "second.sqlite", cwd=tmp_path)
    assert done.returncode == 2
    assert "match m2 would not be what was stored" in done.stderr
    with pytest.raises(KeyError), Store.open(tmp_path / "second.sqlite") as store:
        store.results_of(["m2"])
