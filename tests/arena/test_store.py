"""The store: what goes in comes out, whole or not at all, from a SQLite file and from PostgreSQL."""

from __future__ import annotations

import hashlib
import json
import math
import sqlite3
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
import polars as pl
import pytest
import sqlalchemy as sa
from polars.testing import assert_frame_equal

from nathlon.arena.results import RESULTS, TABLES
from nathlon.arena.store import Store, schema
from nathlon.sim.errors import InputError
from tests.support.stored import filled, match_of

pytest_plugins = ["tests.support.databases"]


def raw(target: str) -> sa.Engine:
    """The database as another program sees it."""
    return sa.create_engine(target if "://" in target else f"sqlite:///{target}")


def test_a_match_comes_back_as_it_went_in(target: str) -> None:
    spec = {"seed": 2**62, "entrants": ["a", "ä"], "scenario": {"laps": 3}}
    with Store(target) as store:
        assert not store.has("k")
        assert store.add_match("k", "pareto", spec, match_of("k"))
        assert store.has("k")
    with Store.open(target) as store:
        assert_frame_equal(store.results(), match_of("k"), check_exact=True)
        assert store.spec("k") == spec
        with pytest.raises(KeyError):
            store.spec("other")


def test_a_match_that_is_there_is_left_alone(target: str) -> None:
    with Store(target) as store:
        assert store.add_match("k", "pareto", {"v": 1}, match_of("k"))
        assert not store.add_match("k", "pareto", {"v": 2}, match_of("k", races=4))
        assert_frame_equal(store.results(), match_of("k"))
        assert store.spec("k") == {"v": 1}
        assert store.verify() == []


def test_results_are_ordered_and_chosen_by_stage_or_by_keys(target: str) -> None:
    frames = {key: match_of(key, stage) for key, stage in (("z", "pareto"), ("B", "race"), ("a", "pareto"))}
    with Store(target) as store:
        for key, frame in frames.items():
            store.add_match(key, frame["stage"][0], {}, frame.sample(fraction=1.0, shuffle=True, seed=1))
        assert_frame_equal(store.results(), pl.concat([frames[key] for key in "azB"]))
        assert_frame_equal(store.results("pareto"), pl.concat([frames["a"], frames["z"]]))
        assert_frame_equal(store.results("battery"), pl.DataFrame(schema=RESULTS))
        assert_frame_equal(store.results_of(["z", "B", "z"]), pl.concat([frames["z"], frames["B"]]))
        assert_frame_equal(store.results_of([]), pl.DataFrame(schema=RESULTS))
        with pytest.raises(KeyError, match="missing"):
            store.results_of(["a", "missing"])


def test_more_keys_than_go_into_one_statement(target: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(schema, "CHUNK", 7)
    keys = [f"k{number}" for number in np.random.default_rng(0).permutation(40)]
    with Store(target) as store:
        for key in keys[:25]:
            store.add_match(key, "pareto", {}, match_of(key).head(1))
        assert store.stored(keys) == set(keys[:25])
        assert store.results_of(keys[24::-1])["match"].to_list() == keys[24::-1]
        assert store.claim(keys, "me", 60) == keys[25:]


def test_an_error_in_the_middle_of_a_match_leaves_nothing(target: str) -> None:
    """It fails after the match and its other rows are written."""
    frame = match_of("k")
    with Store(target) as store:
        with pytest.raises(InputError, match="the store cannot be used"):
            store.add_match("k", "pareto", {}, frame.with_columns(car=frame["car"].replace({2: None})))
        assert not store.has("k")
        assert store.results().is_empty()
        assert store.add_match("k", "pareto", {}, frame)


def test_frames_of_another_shape_are_refused(target: str) -> None:
    with Store(target) as store:
        store.begin_run("night", {})
        with pytest.raises(ValueError, match="result"):
            store.add_match("k", "pareto", {}, match_of("k").drop("laps"))
        with pytest.raises(ValueError, match="pareto"):
            store.put_table("night", "pareto", filled("pareto").cast({"races": pl.Float64}))
        with pytest.raises(ValueError, match="must name this match"):
            store.add_match("k", "pareto", {}, match_of("other"))
        with pytest.raises(ValueError, match="must name this match"):
            store.add_match("k", "race", {}, match_of("k"))
        with pytest.raises(ValueError, match="more than one row"):
            store.add_match("k", "pareto", {}, pl.concat([match_of("k"), match_of("k").tail(1)]))
        assert store.results().is_empty()


def test_the_digest_can_be_made_anew_by_anyone_who_reads_the_tables(target: str) -> None:
    frame = match_of("k").with_columns(wall_s=-0.0, off_course_s=math.inf)
    with Store(target) as store:
        store.add_match("k", "pareto", {"b": 1, "a": "ä"}, frame)
    with raw(target).connect() as connection:
        [(rows, digest)] = connection.execute(sa.text("SELECT rows, digest FROM match"))
    columns = {name: frame[name].to_list() for name in sorted(frame.columns) if frame[name].count()}
    columns["wall_s"] = [0.0] * 6
    text = json.dumps(["k", "pareto", '{"a": "\\u00e4", "b": 1}', columns], separators=(",", ":"))
    assert rows == 6
    assert digest == hashlib.sha256(text.encode("ascii")).hexdigest()


def test_verify_names_what_has_changed(target: str) -> None:
    keys = ["untouched", "changed", "shortened", "respecified", "nullified"]
    with Store(target) as store:
        for key in keys:
            store.add_match(key, "pareto", {"key": key}, match_of(key))
        assert store.verify() == []
        with raw(target).begin() as connection:
            for statement in (
                "UPDATE result SET points = points + 1e-9 WHERE match = 'changed' AND race = 1 AND car = 2",
                "DELETE FROM result WHERE match = 'shortened' AND race = 1 AND car = 2",
                "UPDATE match SET spec = '{}' WHERE key = 'respecified'",
                "UPDATE result SET laps = NULL WHERE match = 'nullified'",
            ):
                connection.execute(sa.text(statement))
        found = store.verify()
        assert [line.split(":")[0] for line in found] == [f"match {key}" for key in sorted(keys)[:-1]]
        assert found[3] == "match shortened: 5 result rows; expected the 6 that were stored"


def test_a_run_begins_goes_on_and_ends(target: str) -> None:
    config = {"seed": 1, "entrants": ["a", "b"]}
    with Store(target) as store:
        began = store.begin_run("monday", config)
        assert (began.name, began.status, began.ended_at, began.config) == ("monday", "running", None, config)
        assert datetime.fromisoformat(began.began_at).utcoffset() == timedelta(0)
        store.end_run("monday", "interrupted")
        tuesday = store.begin_run("tuesday", {})
        assert store.begin_run("monday", dict(reversed(config.items()))) == began
        store.end_run("monday", "finished")
        monday = store.runs()[0]
        assert monday.status == "finished"
        assert monday.ended_at is not None
        assert monday.ended_at > tuesday.began_at > monday.began_at
        assert [run.name for run in store.runs()] == ["monday", "tuesday"]
        with pytest.raises(InputError, match=r"run monday was begun with another configuration"):
            store.begin_run("monday", {"seed": 2})
        assert store.runs()[0] == monday
        with pytest.raises(KeyError, match="sunday"):
            store.end_run("sunday", "finished")


def test_runs_share_matches_and_each_knows_which_it_used(target: str) -> None:
    frames = {key: match_of(key, stage) for key, stage in (("a", "pareto"), ("b", "race"), ("c", "pareto"))}
    with Store(target) as store:
        for name in ("monday", "tuesday"):
            store.begin_run(name, {})
        for key, frame in frames.items():
            store.add_match(key, frame["stage"][0], {}, frame)
        store.use("monday", ["c"])
        store.use("monday", ["c", "b"])
        store.use("monday", ["b", "a", "a"])
        store.use("tuesday", ["b"])
        assert_frame_equal(store.results_of_run("monday"), pl.concat([frames[key] for key in "cba"]))
        assert_frame_equal(store.results_of_run("monday", "pareto"), pl.concat([frames["c"], frames["a"]]))
        assert_frame_equal(store.results_of_run("tuesday"), frames["b"])
        assert_frame_equal(store.results_of_run("tuesday", "pareto"), pl.DataFrame(schema=RESULTS))
        with pytest.raises(KeyError, match="absent"):
            store.use("tuesday", ["a", "absent"])
        with pytest.raises(KeyError, match="sunday"):
            store.results_of_run("sunday")
        assert_frame_equal(store.results_of_run("tuesday"), frames["b"])


def test_every_stage_table_round_trips_and_is_replaced_whole(target: str) -> None:
    with Store(target) as store:
        for run in ("monday", "tuesday"):
            store.begin_run(run, {})
        for name, columns in TABLES.items():
            assert_frame_equal(store.table("monday", name), pl.DataFrame(schema=columns))
            store.put_table("monday", name, filled(name).reverse())
            store.put_table("tuesday", name, filled(name))
            assert_frame_equal(store.table("monday", name), filled(name).reverse(), check_exact=True)
            store.put_table("monday", name, filled(name).head(1))
            assert_frame_equal(store.table("monday", name), filled(name).head(1), check_exact=True)
            store.put_table("monday", name, filled(name).clear())
            assert store.table("monday", name).is_empty()
            assert_frame_equal(store.table("tuesday", name), filled(name), check_exact=True)
        with pytest.raises(KeyError, match="sunday"):
            store.put_table("sunday", "pareto", filled("pareto"))
        with pytest.raises(KeyError, match="sunday"):
            store.table("sunday", "pareto")


def test_an_error_in_the_middle_of_a_table_keeps_the_old_one(tmp_path: Path) -> None:
    path = tmp_path / "store.sqlite"
    with Store(path) as store:
        store.begin_run("night", {})
        store.put_table("night", "pareto", filled("pareto"))
        with sqlite3.connect(path) as other:
            other.execute(
                "CREATE TRIGGER refuse BEFORE INSERT ON pareto WHEN new.races = 13 "
                "BEGIN SELECT RAISE(ABORT, 'refused'); END"
            )
        bad = filled("pareto").with_columns(races=pl.Series([12, 13]))
        with pytest.raises(InputError, match="refused"):
            store.put_table("night", "pareto", bad)
        assert_frame_equal(store.table("night", "pareto"), filled("pareto"))


def test_infinities_stay_and_not_a_number_becomes_null(target: str) -> None:
    with Store(target) as store:
        store.begin_run("night", {})
        frame = filled("pareto").with_columns(lap_s=pl.Series([math.inf, math.nan]))
        store.put_table("night", "pareto", frame)
        assert store.table("night", "pareto")["lap_s"].to_list() == [math.inf, None]
        match = match_of("k").with_columns(wall_s=math.nan, best_lap_s=-math.inf)
        store.add_match("k", "pareto", {}, match)
        assert store.results()["wall_s"].is_null().all()
        assert (store.results()["best_lap_s"] == -math.inf).all()
        assert store.verify() == []


def test_facts_belong_to_a_run(target: str) -> None:
    with Store(target) as store:
        for run in ("monday", "tuesday"):
            store.begin_run(run, {})
            store.put_fact(run, "version", "1")
        store.put_fact("monday", "races", {"run": 12, "void": [1, 2.5, None]})
        store.put_fact("monday", "version", "2")
        assert store.facts("monday") == {"races": {"run": 12, "void": [1, 2.5, None]}, "version": "2"}
        assert store.facts("tuesday") == {"version": "1"}
        with pytest.raises(KeyError, match="sunday"):
            store.facts("sunday")


def test_the_log_keeps_entries_in_order_by_kind_and_by_run(target: str) -> None:
    with Store(target) as store:
        store.begin_run("monday", {})
        store.begin_run("tuesday", {})
        ballot = store.append("ballot", {"member": "ä", "for": ["x", None]}, "monday")
        fault = store.append("fault", {"match": "k"})
        later = store.append("ballot", {}, "tuesday")
        assert store.log() == [ballot, fault, later]
        assert store.log("ballot") == [ballot, later]
        assert store.log(run="monday") == [ballot]
        assert store.log("fault", "monday") == []
        assert (ballot.kind, ballot.run, ballot.entry) == (
            "ballot",
            "monday",
            {"member": "ä", "for": ["x", None]},
        )
        assert fault.run is None
        assert datetime.fromisoformat(ballot.at).utcoffset() == timedelta(0)
        assert ballot.at <= fault.at <= later.at
        with pytest.raises(KeyError, match="sunday"):
            store.append("ballot", {}, "sunday")


@pytest.mark.parametrize(
    "statement",
    [
        "UPDATE log SET entry = '{}'",
        "UPDATE log SET kind = 'ballot' WHERE kind = 'fault'",
        "DELETE FROM log",
        "DELETE FROM log WHERE id = 1",
    ],
)
def test_the_database_refuses_to_change_the_log(statement: str, target: str) -> None:
    with Store(target) as store:
        entry = store.append("fault", {"match": "k"})
        with pytest.raises(sa.exc.DBAPIError, match="append-only"), raw(target).begin() as connection:
            connection.execute(sa.text(statement))
        assert store.log() == [entry]


def test_the_log_can_be_neither_replaced_nor_emptied_at_once(tmp_path: Path, postgres: str) -> None:
    path = str(tmp_path / "store.sqlite")
    replace = "INSERT OR REPLACE INTO log VALUES (1, '', 'fault', NULL, '{}')"
    for target, statement in ((path, replace), (postgres, "TRUNCATE log")):
        with Store(target) as store:
            entry = store.append("fault", {"match": "k"})
            with pytest.raises(sa.exc.DBAPIError, match="append-only"), raw(target).begin() as connection:
                connection.execute(sa.text(statement))
            assert store.log() == [entry]


def test_other_programs_can_read_the_file(tmp_path: Path) -> None:
    path = tmp_path / "store.sqlite"
    with Store(path) as store:
        store.add_match("k", "pareto", {}, match_of("k"))
    connection = sqlite3.connect(path)
    assert connection.execute("PRAGMA journal_mode").fetchone() == ("wal",)
    query = "SELECT count(*), sum(car), count(best_lap_s) FROM result"
    assert connection.execute(query).fetchone() == (6, 6, 4)
    connection.close()
