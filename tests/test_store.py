"""The store: what goes in comes out, whole or not at all, and nothing foreign is touched."""

import math
import sqlite3
from pathlib import Path

import numpy as np
import polars as pl
import pytest
import sqlalchemy as sa
from polars.testing import assert_frame_equal

import arena.store
from arena.results import RESULTS, TABLES
from arena.store import SCHEMA_VERSION, Store
from sim.errors import InputError
from tests.race_results import rows


def match_of(key: str, stage: str = "pareto", races: int = 2) -> pl.DataFrame:
    race, car = (index.ravel() for index in np.indices((races, 3)))
    columns = {"match": key, "stage": stage, "race": race, "car": car, "distance_m": 1000 / (1 + race + car)}
    return rows(columns, races * 3).with_columns(
        best_lap_s=pl.when(pl.col("car") == 1).then(None).otherwise("best_lap_s")
    )


def filled(name: str) -> pl.DataFrame:
    """Two rows of a stage table, the second all null."""
    samples = {pl.String: "ä, \"b\"\n'c'", pl.Int64: -(2**62), pl.Float64: 0.1 + 0.2, pl.Boolean: True}
    return pl.DataFrame(
        {column: [samples[type(dtype)], None] for column, dtype in TABLES[name].items()}, schema=TABLES[name]
    )


def test_a_match_comes_back_as_it_went_in(tmp_path: Path) -> None:
    path = tmp_path / "new" / "folders" / "run.db"
    spec = {"seed": 2**62, "entrants": ["a", "b"], "scenario": {"laps": 3}}
    with Store(path) as store:
        assert not store.has("k")
        assert store.add_match("k", "pareto", spec, match_of("k"))
        assert store.has("k")
    with Store.open(path) as store:
        assert_frame_equal(store.results(), match_of("k"), check_exact=True)
        assert store.spec("k") == spec
        with pytest.raises(KeyError):
            store.spec("other")


def test_a_match_that_is_there_is_left_alone(tmp_path: Path) -> None:
    with Store(tmp_path / "run.db") as store:
        assert store.add_match("k", "pareto", {"v": 1}, match_of("k"))
        assert not store.add_match("k", "pareto", {"v": 2}, match_of("k", races=4))
        assert_frame_equal(store.results(), match_of("k"))
        assert store.spec("k") == {"v": 1}


def test_results_are_ordered_and_chosen_by_stage_or_by_keys(tmp_path: Path) -> None:
    frames = {key: match_of(key, stage) for key, stage in (("z", "pareto"), ("b", "race"), ("a", "pareto"))}
    with Store(tmp_path / "run.db") as store:
        for key, frame in frames.items():
            store.add_match(key, frame["stage"][0], {}, frame.sample(fraction=1.0, shuffle=True, seed=1))
        assert_frame_equal(store.results(), pl.concat([frames[key] for key in "azb"]))
        assert_frame_equal(store.results("pareto"), pl.concat([frames["a"], frames["z"]]))
        assert_frame_equal(store.results("battery"), pl.DataFrame(schema=RESULTS))
        assert_frame_equal(store.results_of(["z", "b", "z"]), pl.concat([frames["z"], frames["b"]]))
        assert_frame_equal(store.results_of([]), pl.DataFrame(schema=RESULTS))
        with pytest.raises(KeyError, match="missing"):
            store.results_of(["a", "missing"])


def test_an_error_in_the_middle_of_a_match_leaves_nothing(tmp_path: Path) -> None:
    """The last row repeats a car: it fails after the match and its other rows are written."""
    frame = match_of("k")
    with Store(tmp_path / "run.db") as store:
        with pytest.raises(sa.exc.IntegrityError):
            store.add_match("k", "pareto", {}, pl.concat([frame, frame.tail(1)]))
        assert not store.has("k")
        assert store.results().is_empty()
        assert store.add_match("k", "pareto", {}, frame)


def test_an_error_in_the_middle_of_a_table_keeps_the_old_one(tmp_path: Path) -> None:
    path = tmp_path / "run.db"
    with Store(path) as store:
        store.put_table("pareto", filled("pareto"))
        with sqlite3.connect(path) as other:
            other.execute(
                "CREATE TRIGGER refuse BEFORE INSERT ON pareto WHEN new.races = 13 "
                "BEGIN SELECT RAISE(ABORT, 'refused'); END"
            )
        bad = filled("pareto").with_columns(races=pl.Series([12, 13]))
        with pytest.raises(sa.exc.IntegrityError, match="refused"):
            store.put_table("pareto", bad)
        assert_frame_equal(store.table("pareto"), filled("pareto"))


@pytest.mark.parametrize("name", TABLES)
def test_every_stage_table_round_trips_and_is_replaced_whole(name: str, tmp_path: Path) -> None:
    with Store(tmp_path / "run.db") as store:
        assert_frame_equal(store.table(name), pl.DataFrame(schema=TABLES[name]))
        store.put_table(name, filled(name).reverse())
        assert_frame_equal(store.table(name), filled(name).reverse(), check_exact=True)
        store.put_table(name, filled(name).head(1))
        assert_frame_equal(store.table(name), filled(name).head(1), check_exact=True)
        store.put_table(name, filled(name).clear())
        assert store.table(name).is_empty()


def test_infinities_stay_and_not_a_number_becomes_null(tmp_path: Path) -> None:
    frame = filled("pareto").with_columns(lap_s=pl.Series([math.inf, math.nan]))
    with Store(tmp_path / "run.db") as store:
        store.put_table("pareto", frame)
        assert store.table("pareto")["lap_s"].to_list() == [math.inf, None]


def test_facts(tmp_path: Path) -> None:
    with Store(tmp_path / "run.db") as store:
        store.put_fact("version", "1")
        store.put_fact("races", {"run": 12, "void": [1, 2.5, None]})
        store.put_fact("version", "2")
        assert store.facts() == {"races": {"run": 12, "void": [1, 2.5, None]}, "version": "2"}


def test_frames_of_another_shape_are_refused(tmp_path: Path) -> None:
    with Store(tmp_path / "run.db") as store:
        with pytest.raises(ValueError, match="result"):
            store.add_match("k", "pareto", {}, match_of("k").drop("laps"))
        with pytest.raises(ValueError, match="pareto"):
            store.put_table("pareto", filled("pareto").cast({"races": pl.Float64}))
        with pytest.raises(ValueError, match="must name this match"):
            store.add_match("k", "pareto", {}, match_of("other"))
        with pytest.raises(ValueError, match="must name this match"):
            store.add_match("k", "race", {}, match_of("k"))
        assert store.results().is_empty()


def test_a_second_connection_sees_what_the_first_stored(tmp_path: Path) -> None:
    with Store(tmp_path / "run.db") as first, Store(tmp_path / "run.db") as second:
        assert first.add_match("k", "pareto", {}, match_of("k"))
        assert not second.add_match("k", "pareto", {}, match_of("k"))
        assert_frame_equal(second.results(), match_of("k"))


def test_other_programs_can_read_it(tmp_path: Path) -> None:
    path = tmp_path / "run.db"
    with Store(path) as store:
        store.add_match("k", "pareto", {}, match_of("k"))
    connection = sqlite3.connect(path)
    assert connection.execute("PRAGMA journal_mode").fetchone() == ("wal",)
    assert connection.execute("PRAGMA user_version").fetchone() == (SCHEMA_VERSION,)
    assert connection.execute("SELECT count(*), sum(car), count(best_lap_s) FROM result").fetchone() == (
        6,
        6,
        4,
    )
    connection.close()


def test_a_file_that_is_no_database_is_refused_and_left_as_it_was(tmp_path: Path) -> None:
    path = tmp_path / "notes.txt"
    path.write_text("not a database, only a few words. " * 100)
    before = path.read_bytes()
    with pytest.raises(InputError, match=r"notes\.txt.*not a database"):
        Store(path)
    assert path.read_bytes() == before


def test_a_foreign_database_is_refused_and_left_as_it_was(tmp_path: Path) -> None:
    path = tmp_path / "music.db"
    connection = sqlite3.connect(path)
    connection.execute("CREATE TABLE song (title TEXT)")
    connection.commit()
    connection.close()
    before = path.read_bytes()
    with pytest.raises(InputError, match=r"music\.db.*another program"):
        Store(path)
    assert path.read_bytes() == before


def test_another_schema_version_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "run.db"
    Store(path).close()
    connection = sqlite3.connect(path)
    connection.execute(f"PRAGMA user_version = {SCHEMA_VERSION + 1}")
    connection.close()
    with pytest.raises(InputError, match=rf"run\.db.*version {SCHEMA_VERSION + 1}; expected"):
        Store(path)


def test_paths_that_cannot_hold_a_store_are_refused(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="folder for the store"):
        Store(tmp_path / "file" / "run.db")
    with pytest.raises(InputError, match=str(tmp_path)):
        Store(tmp_path)
    with pytest.raises(InputError, match="no such store"):
        Store.open(tmp_path / "missing.db")
    assert not (tmp_path / "missing.db").exists()


def test_a_store_that_another_program_holds_is_refused_in_time(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "run.db"
    Store(path).close()
    monkeypatch.setattr(arena.store, "BUSY_TIMEOUT_S", 0.1)
    holder = sqlite3.connect(path, isolation_level=None)
    holder.execute("BEGIN EXCLUSIVE")
    with pytest.raises(InputError, match=r"run\.db.*locked"):
        Store(path)
    holder.execute("ROLLBACK")
    holder.close()
    Store(path).close()
