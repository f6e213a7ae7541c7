"""Races out of the store: which ones are kept, and that they are the races that were run."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest

from nathlon.arena.entrant import enter, entrants_table
from nathlon.arena.match import Match, Race, Seat
from nathlon.arena.match_policies import match_policies
from nathlon.arena.pool import Pool
from nathlon.arena.processor import processor
from nathlon.arena.recording import read_recording, recording_name, write_recording
from nathlon.arena.results import RANKING, RESULTS
from nathlon.arena.runner import run_match
from nathlon.arena.store import Finished, Store
from nathlon.commands.replay import replay
from nathlon.reports.cars import car_index
from nathlon.selection.publish.decider import Notable, notable_races
from nathlon.selection.publish.output import OutputFolder
from nathlon.selection.publish.recordings import record_tournament
from nathlon.selection.publish.replays import record_replays, record_stored_race
from nathlon.sim.errors import InputError
from tests.support.race_logs import oval_race

pytestmark = pytest.mark.takes_long

SCENARIO = """
name = "sprint"
description = ""
cars = 2
rules = "sporting"
time_s = 6.0
start = {kind = "grid"}
"""
DRIVERS = ("driver:pace=0.9", "driver:pace=0.95")


@pytest.fixture(scope="module")
def match(tmp_path_factory: pytest.TempPathFactory) -> Match:
    path = tmp_path_factory.mktemp("scenario") / "sprint.toml"
    path.write_text(SCENARIO)
    races = (Race(1, (Seat(0, 0), Seat(1, 1))), Race(1, (Seat(1, 1), Seat(0, 0)), True))
    return Match("tournament", "4v4", str(path), "lindenring", "gt3", DRIVERS, DRIVERS, races)


@pytest.fixture(scope="module")
def results(match: Match) -> pl.DataFrame:
    return run_match(match, match_policies(match))


@pytest.fixture(scope="module")
def store_path(tmp_path_factory: pytest.TempPathFactory, match: Match, results: pl.DataFrame) -> Path:
    path = tmp_path_factory.mktemp("store") / "store.sqlite"
    with Store(path) as store:
        store.begin_run("night-0001", {})
        store.put_table(
            "night-0001", "entrants", entrants_table([enter(d, "lindenring", "gt3") for d in DRIVERS])
        )
        store.add_match(match.key, "tournament", match.spec(), results)
    return path


def ranking(*entrants: str) -> pl.DataFrame:
    return pl.DataFrame([{**dict.fromkeys(RANKING), "entrant": name} for name in entrants], schema=RANKING)


def race_rows(match: str, race: int, **cars: dict[str, Any]) -> list[dict[str, Any]]:
    """One car of each entrant in a race; `points` and what else is given."""
    filler: dict[str, Any] = {"ending": "finished", "contacts_at_fault": 0, "slot": 1, "place": 1}
    return [
        {"match": match, "race": race, "car": car, "entrant": entrant, **filler, **facts}
        for car, (entrant, facts) in enumerate(cars.items())
    ]


def frame(rows: list[dict[str, Any]]) -> pl.DataFrame:
    return pl.DataFrame([{name: row.get(name) for name in RESULTS} for row in rows], schema=RESULTS)


def test_the_races_that_stand_out_are_found() -> None:
    results = frame(
        race_rows("m", 0, a={"points": 10.0}, b={"points": 8.0})
        + race_rows("m", 1, a={"points": 2.0}, b={"points": 10.0})
        + race_rows("m", 2, a={"points": 6.0}, b={"points": 5.0})
        + race_rows(
            "n", 0, a={"points": 1.0, "contacts_at_fault": 2}, c={"points": 1.0, "contacts_at_fault": 3}
        )
        + race_rows(
            "n", 1, a={"points": 1.0, "slot": 7, "place": 2}, c={"points": 1.0, "contacts_at_fault": 4}
        )
        + race_rows(
            "n", 2, a={"points": 1.0, "slot": 8, "place": 4}, c={"points": 1.0, "contacts_at_fault": 1}
        )
        + race_rows(
            "n", 3, a={"points": 1.0, "contacts_at_fault": 99, "ending": "simulator_fault"}, c={"points": 1.0}
        )
    )
    found = notable_races(results, ranking("a", "b", "c"))
    assert found == [
        Notable("m", 2, "the closest race that the first of the ranking won against the second: 1 point"),
        Notable("m", 1, "the clearest race between the first two of the ranking: 8 points"),
        Notable("n", 0, "the most contacts at somebody's fault: 5"),
        Notable("n", 1, "the furthest way forward: from 7 on the grid to 2"),
    ]


def test_a_race_is_kept_once_and_nothing_is_found_in_nothing() -> None:
    results = frame(
        race_rows("m", 0, a={"points": 1.0, "slot": 2}, b={"points": 8.0, "contacts_at_fault": 1})
    )
    assert [(race.match, race.race) for race in notable_races(results, ranking("a", "b"))] == [("m", 0)]
    assert notable_races(results, ranking("a", "b"))[0].why.startswith(
        "the race that the first of the ranking lost"
    )
    forward = race_rows("m", 0, a={"points": 3.0, "slot": 8}, b={"points": 2.0}) + race_rows(
        "n", 0, a={"points": 1.0, "contacts_at_fault": 1}, c={"points": 8.0}
    )
    found = notable_races(frame(forward), ranking("a", "b"))
    assert [(race.match, race.race) for race in found] == [("m", 0), ("n", 0)]
    assert notable_races(frame([]), ranking("a", "b")) == []
    assert notable_races(frame([]), ranking()) == []


def test_what_is_recorded_is_the_race_that_was_run(
    store_path: Path, match: Match, results: pl.DataFrame, tmp_path: Path
) -> None:
    with Store.open(store_path) as store:
        for address in (f"{match.key}:1", f"{match.key[:6]}:1"):
            path = record_stored_race(store, address, tmp_path / "races")
    log = read_recording(path)
    assert path.name == f"{match.key[:10]}-1.mcap"
    assert (log.match, log.race) == (match.key, 1)
    assert log.names == ("driver:pace=0.95", "driver:pace=0.9")
    raced = results.filter(pl.col("race") == 1).sort("car")
    np.testing.assert_array_equal(log.samples["distance_m"][-1], raced["distance_m"].to_numpy())


@pytest.mark.parametrize(
    ("address", "fault"),
    [
        ("zz:0", "no matches begin with 'zz'"),
        (":0", "no matches begin with ''"),
        ("KEY", "race is '' of match .*, expected KEY:RACE with a race from 0 to 1"),
        ("KEY:2", "race is '2' of match .*, expected KEY:RACE"),
        ("KEY:x", "race is 'x' of match .*, expected KEY:RACE"),
    ],
)
def test_a_race_that_is_not_there_is_refused(
    store_path: Path, match: Match, tmp_path: Path, address: str, fault: str
) -> None:
    with Store.open(store_path) as store, pytest.raises(InputError, match=fault):
        record_stored_race(store, address.replace("KEY", match.key[:10]), tmp_path)
    assert list(tmp_path.iterdir()) == []


@pytest.fixture
def tables(store_path: Path) -> dict[str, pl.DataFrame]:
    with Store.open(store_path) as store:
        entrants = store.table("night-0001", "entrants")
    return {"ranking": ranking("driver:pace=0.95", "driver:pace=0.9"), "entrants": entrants}


def test_a_selection_keeps_its_notable_races(
    store_path: Path, match: Match, results: pl.DataFrame, tables: dict[str, pl.DataFrame], tmp_path: Path
) -> None:
    output = OutputFolder(tmp_path)
    with Store.open(store_path) as store, Pool(1) as pool:
        replays = record_replays(store, results, tables, output, pool)
    assert 1 <= len(replays.races) == len(replays.logs) <= 2
    assert replays.facts["recording"] == replays.races[0].recording == "../races/final.mcap"
    assert replays.facts["replay"] == "../replays/final.rrd"
    for race, log in zip(replays.races, replays.logs, strict=True):
        recorded = read_recording(output.report / str(race.recording))
        assert (log.match, log.race, race.missing) == (match.key, race.race, None)
        assert recorded.samples.tobytes() == log.samples.tobytes()
        assert (output.report / str(race.player)).read_text().startswith("<!doctype html>")


def test_what_is_recorded_is_not_run_again_and_what_cannot_be_run_says_why(
    store_path: Path, results: pl.DataFrame, tables: dict[str, pl.DataFrame], tmp_path: Path
) -> None:
    """Without its policies nothing can be run, but what is there can be shown."""
    output = OutputFolder(tmp_path)
    gone = tables | {"entrants": tables["entrants"].with_columns(source=pl.lit("gone.safetensors"))}
    with Store.open(store_path) as store, Pool(1) as pool:
        before, _ = record_replays(store, results, tables, output, pool)
        for path in output.replays.iterdir():
            path.unlink()
        assert record_replays(store, results, gone, output, pool)[0] == before
        assert (output.replays / "final.rrd").exists()
        (output.races / "final.mcap").write_bytes(b"cut short")
        races, logs = record_replays(store, results, gone, output, pool)
    assert races[0].replay is None
    assert "gone.safetensors" in str(races[0].missing)
    assert len(logs) == len(before) - 1


def test_a_race_that_ends_otherwise_is_not_shown_for_the_one_that_was_run(
    match: Match, results: pl.DataFrame, tables: dict[str, pl.DataFrame], tmp_path: Path
) -> None:
    other = results.with_columns(distance_m=pl.col("distance_m") + 1e-9)
    with Store(tmp_path / "store.sqlite") as store, Pool(1) as pool:
        store.begin_run("night-0001", {})
        store.put_table("night-0001", "entrants", tables["entrants"])
        store.add_matches([Finished(match.key, "tournament", match.spec(), other, "cray-0000")])
        races, logs = record_replays(store, other, tables, OutputFolder(tmp_path / "out"), pool)
        assert logs == ()
        assert "ended otherwise" in str(races[0].missing)
        assert f"they are of a processor cray-0000, and this one is {processor()}" in str(races[0].missing)
        with pytest.raises(InputError, match="ended otherwise when it was run again"):
            record_stored_race(store, f"{match.key}:0", tmp_path)


def test_every_race_of_a_tournament_can_leave_a_recording(
    store_path: Path, match: Match, results: pl.DataFrame, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    output = OutputFolder(tmp_path / "out")
    told: list[tuple[int, int]] = []
    with Store(Path(shutil.copy(store_path, tmp_path))) as store, Pool(1) as pool:
        store.use("night-0001", [match.key])

        def record() -> None:
            record_tournament(
                store, "night-0001", output, pool, lambda _, done, total: told.append((done, total))
            )

        record()
        paths = [output.races / recording_name(match.key, race) for race in range(2)]
        assert sorted(output.races.iterdir()) == sorted(paths)
        for race, path in enumerate(paths):
            log = read_recording(path)
            assert (log.match, log.race) == (match.key, race)
            raced = results.filter(pl.col("race") == race).sort("car")
            np.testing.assert_array_equal(log.samples["distance_m"][-1], raced["distance_m"].to_numpy())
        paths[0].unlink()
        kept = paths[1].stat().st_mtime_ns
        record()
        assert paths[0].exists()
        assert paths[1].stat().st_mtime_ns == kept
        assert told == [(0, 1), (1, 1)] * 2
        record()
        assert told[4:] == [(0, 0)]
        paths[1].unlink()
        gone = store.table("night-0001", "entrants").with_columns(source=pl.lit("gone.safetensors"))
        store.put_table("night-0001", "entrants", gone)
        record()
        assert not paths[1].exists()
        assert "gone.safetensors" in caplog.text


def test_a_stored_race_becomes_a_page_a_video_and_a_replay(
    store_path: Path, match: Match, tmp_path: Path
) -> None:
    page, video = tmp_path / "race.html", tmp_path / "race.mp4"
    key = f"{match.key[:8]}:0"
    replay(
        str(store_path), key, "driver:pace=0.95", html=page, video=video, start_s=1.0, end_s=1.2, out=tmp_path
    )
    assert {path.suffix for path in tmp_path.iterdir()} == {".html", ".mp4", ".mcap"}
    [recording] = tmp_path.glob("*.mcap")
    replay(str(recording), show=False, out=tmp_path)
    assert recording.with_suffix(".rrd").exists()


def test_a_car_is_known_by_number_or_name() -> None:
    log = oval_race(cars=4, duration_s=5.0)
    assert [car_index(log, car, Path()) for car in ("3", "entrant b", "3 entrant a")] == [2, 1, 2]
    with pytest.raises(InputError, match=r"race\.mcap: there is no car '0', expected a number from 1 to 4"):
        car_index(log, "0", Path("race.mcap"))


def test_a_recording_that_was_cut_short_is_saved_beside_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "race.mcap"
    write_recording(path, oval_race(cars=8, duration_s=30.0))
    path.write_bytes(path.read_bytes()[:-5000])
    with pytest.raises(InputError, match=r"nathlon replay --recover .*race\.mcap"):
        read_recording(path)
    replay(str(path), recover=True)
    log = read_recording(tmp_path / "race.recovered.mcap")
    assert 5.0 < log.time_s[-1] <= 29.9
    assert f"The race until {log.time_s[-1]:.1f} s" in capsys.readouterr().out
