"""Selections, tournaments and nights in worlds of environments, end to end."""

from __future__ import annotations

import json
import os
from pathlib import Path

import polars as pl
import pytest
from openpyxl import load_workbook

import nathlon
from nathlon.arena.store import Store
from nathlon.commands.selection import print_verdict
from nathlon.results.words import percent
from nathlon.selection.answers import ALIKE, remarks
from nathlon.selection.config import read_config
from nathlon.selection.field import EntryList
from nathlon.selection.nightly.night import nightly
from tests.support.command_line import nathlon as command
from tests.support.games import player, refused, world_of


@pytest.fixture
def players(tmp_path: Path) -> list[str]:
    """Policies that are right about all three lights, about two, and about none."""
    return [player(tmp_path / f"{name}.onnx", right) for name, right in (("all", 3), ("two", 2), ("none", 0))]


def settings(folder: Path, more: str = "") -> Path:
    """A configuration that takes everybody everywhere, with few episodes."""
    path = folder / "nathlon.toml"
    path.write_text(
        f"""{more}
[pareto]
races = 2
most_races = 2
keep_probability = 0.0

[battery]
runs = 4

[tournament]
pairs = 6
block = 3
"""
    )
    return path


@pytest.mark.parametrize("points", ["score", "place"])
def test_the_better_policy_is_sent_from_a_duel(tmp_path: Path, players: list[str], points: str) -> None:
    name = world_of(tmp_path, f"PettingZooWorld({{'duel': envs['duel']}}, points='{points}')")
    result = nathlon.select(
        players, tmp_path / "out", config=settings(tmp_path), workers=1, world=name, progress=False
    )
    assert result.sent == ["all"]
    assert result.ranking["name"][0] == "all"
    assert result.summary.world == name
    assert result.summary.faults == result.summary.void == 0
    assert result.report.is_file()
    assert result.recording is None
    first = result.summary.ranking[0]
    assert first.mean is not None
    assert first.won is not None
    assert first.won > 0.5
    assert first.won + (first.drawn or 0.0) + (first.lost or 0.0) == pytest.approx(1.0)
    least, most, what = {"score": (0.5, 3.0, ""), "place": (9.0, 10.0, "points ")}[points]
    assert least < first.mean <= most
    told = result.verdict.sentences[1]
    assert f"It scored {first.mean:.2f} {what}an episode on average (95 % interval " in told
    assert f"won {percent(first.won)}, drew {percent(first.drawn)}, lost {percent(first.lost)}" in told


def test_it_is_said_where_all_pairs_come_out_alike() -> None:
    """Intervals of width zero prove nothing where every episode is the same one."""
    field = EntryList((), notes=("folder holds no checkpoint.",))
    assert remarks(field, None) == remarks(field, 0.1) == field.notes
    assert remarks(field, 1e-17) == (*field.notes, ALIKE)


def test_three_sides_meet_in_a_free_for_all(
    tmp_path: Path, players: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    name = world_of(tmp_path, "PettingZooWorld({'trio': envs['trio']})")
    result = nathlon.select(
        players, tmp_path / "out", config=settings(tmp_path), workers=1, world=name, progress=False
    )
    assert result.sent == ["all"]
    with Store.open(str(result.store)) as store:
        rows = store.results_of_run(store.runs()[-1].name, "tournament")
    # Every block of a free-for-all has each entrant on each side once.
    counts = rows.group_by("entrant", "car").len()["len"]
    assert counts.n_unique() == 1
    assert rows.group_by("match", "race").agg(pl.col("entrant").n_unique())["entrant"].to_list() == [3] * (
        rows.select(pl.struct("match", "race").n_unique()).item()
    )
    ids = dict(result.ranking.select("name", "entrant").iter_rows())
    means = dict(result.ranking.select("name", "mean").iter_rows())
    for policy, mean in means.items():
        own = rows.filter(pl.col("entrant") == ids[policy])
        assert mean == pytest.approx(own["points"].mean())
    print_verdict(result.summary)
    printed = " ".join(capsys.readouterr().out.split())
    assert "Mean score an episode played" in printed
    for head in ("Won", "Drawn", "Lost", "Action, ms"):
        assert head in printed
    # Every finalist is timed, and the store's tables hold none of it.
    assert [one.name for one in result.summary.action_times] == ["all", "two", "none"]
    assert all(one.actions for one in result.summary.action_times)
    assert result.ranking["action_p99_ms"].min() > 0  # type: ignore[operator]
    heads = [cell.value for cell in load_workbook(result.spreadsheet)["Ranking"][1]]
    assert "Action, 99th percentile [ms]" in heads


def test_where_no_sides_meet_the_tests_rank_and_what_is_no_policy_is_set_aside(
    tmp_path: Path, players: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    name = world_of(
        tmp_path, "GymnasiumWorld({'only': envs['Alone']}, measures={'steps': Declared('steps')})"
    )
    reasons = {"link": "No such file", "pipe": "a pipe or a device", "text": "not", "wide": "expected"}
    (tmp_path / "link.onnx").symlink_to("nowhere")
    os.mkfifo(tmp_path / "pipe.onnx")
    (tmp_path / "text.onnx").write_text("no policy")
    player(tmp_path / "wide.onnx", 3, inputs=4)
    result = nathlon.select(
        tmp_path, tmp_path / "out", config=settings(tmp_path), workers=1, world=name, progress=False
    )
    assert result.sent == ["all"]
    assert "tournament" in result.summary.stages_set_aside
    aside = {Path(item.source).stem: item.reason for item in result.summary.excluded}
    assert aside.keys() == reasons.keys()
    print_verdict(result.summary)
    printed = capsys.readouterr().out
    for stem, reason in reasons.items():
        assert reason in aside[stem]
        assert f"Set aside    {tmp_path / stem}.onnx" in printed
    assert json.loads((tmp_path / "out" / "summary.json").read_text())["excluded"]
    told = " ".join([result.verdict.headline, *result.verdict.sentences])
    assert "points (95 % interval" in told or "points in the n-athlon" in told
    assert "race" not in told
    assert "contact" not in told


def test_unequal_sides_and_a_background_are_played(tmp_path: Path, players: list[str]) -> None:
    sides = "[['hunter_1', 'hunter_2'], ['prey']]"
    name = world_of(tmp_path, f"PettingZooWorld({{'chase': envs['chase']}}, sides={sides})")
    result = nathlon.select(
        players[::2], tmp_path / "out", config=settings(tmp_path), workers=1, world=name, progress=False
    )
    assert result.sent == ["all"]


def test_a_team_is_judged_by_all_of_its_seats_and_measures_keep_their_unit(
    tmp_path: Path, players: list[str]
) -> None:
    sides = "[['hunter_1', 'hunter_2']]"
    measures = "{'hits': Declared('hits', unit='lights')}"
    name = world_of(
        tmp_path, f"PettingZooWorld({{'chase': envs['chase']}}, sides={sides}, measures={measures})"
    )
    result = nathlon.select(
        players[1:], tmp_path / "out", config=settings(tmp_path), workers=1, world=name, progress=False
    )
    with Store.open(str(result.store)) as store:
        run = store.runs()[-1].name
        rows, objectives = store.results_of_run(run, "pareto"), store.table(run, "objectives")
    seats = rows.filter(pl.col("team") == 0)
    assert (
        seats.filter(pl.col("car") == 0)["score"].to_list()
        != seats.filter(pl.col("car") == 1)["score"].to_list()
    )
    means = dict(seats.group_by("entrant").agg(pl.col("score").mean()).iter_rows())
    scores = objectives.filter(pl.col("objective") == "score")
    assert dict(scores.select("entrant", "value").iter_rows()) == pytest.approx(means)
    assert set(objectives.filter(pl.col("objective") == "hits")["unit"]) == {"lights"}


def test_a_night_selects_in_the_world_of_its_configuration(tmp_path: Path, players: list[str]) -> None:
    world_of(tmp_path, "PettingZooWorld({'duel': envs['duel']})")
    for source in players:
        (tmp_path / "checkpoints").mkdir(exist_ok=True)
        Path(source).rename(tmp_path / "checkpoints" / Path(source).name)
    config = read_config(settings(tmp_path, 'world = "worlds.py:world"\ncheckpoints = ["checkpoints"]'))
    night = nightly(config, 1, lambda *_: None)
    assert (night.code, night.reason) == (0, "all is sent.")
    assert night.selection is not None
    assert night.selection.summary.world == f"{tmp_path / 'worlds.py'}:world"
    again = nightly(config, 1, lambda *_: None)
    assert again.reason == "all is sent.", "it was not told yet"


def test_a_world_that_is_unknown_or_hangs_selects_nobody(tmp_path: Path, players: list[str]) -> None:
    with refused("world 'chess': expected racing, MODULE:NAME or PATH.py:NAME"):
        nathlon.select(players, tmp_path / "out", world="chess", workers=1, progress=False)
    done = command("evaluate", *players, "--world", "gone.py:world", "--out", "out", cwd=tmp_path)
    assert done.returncode == 2
    assert "gone.py: no such file, expected a world" in done.stderr
