"""The whole selection on real checkpoints, one of them made faulty."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import openpyxl
import polars as pl
import pytest

from nathlon.arena.entrant import Entrant, enter, only_once
from nathlon.arena.pool import Pool, run_matches
from nathlon.arena.recording import read_recording
from nathlon.arena.results import RESULTS
from nathlon.arena.store import Store
from nathlon.arena.world_registry import load_world
from nathlon.results.summary import Sent, Summary, read_summary
from nathlon.selection.battery import BatterySettings, skill_matches
from nathlon.selection.battery.skill import load_skills
from nathlon.selection.committee.rules import CommitteeSettings
from nathlon.selection.config import Config
from nathlon.selection.field import EntryList
from nathlon.selection.pareto.filter import FilterPlan, FilterSettings
from nathlon.selection.publish.decider import notable_races
from nathlon.selection.publish.output import OutputFolder
from nathlon.selection.round_robin import TournamentSettings, tournament_matches
from nathlon.selection.single_selection import single_selection
from nathlon.sim.errors import InputError
from tests.support.checkpoints import BUNDLED, save_faulty

pytestmark = pytest.mark.takes_long

RACES = load_world("racing")
CHOSEN = ("lindenring-aggressive-004k", "lindenring-s1-008k", "lindenring-wake-028k")
"""Of whom the filter leaves enough for the stages that follow."""
CONFIG = Config(
    seed=5,
    recordings="notable",
    pareto=FilterSettings(races=1, most_races=2),
    battery=BatterySettings(tests=("hot_lap", "pass_left", "start_back"), runs=2),
    committee=CommitteeSettings(shortlist=3),
    tournament=TournamentSettings(pairs=2),
)


@pytest.fixture(scope="module")
def entrants(tmp_path_factory: pytest.TempPathFactory) -> list[Entrant]:
    faulty = tmp_path_factory.mktemp("faulty") / "faulty.safetensors"
    save_faulty(faulty)
    chosen = [path for path in BUNDLED if path.stem in CHOSEN]
    return only_once([enter(str(path), "lindenring", "gt3") for path in [*chosen, faulty]])


@pytest.fixture(scope="module")
def run(entrants: list[Entrant], tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("run")
    seen: list[tuple[str, int, int]] = []
    told: list[Summary] = []

    def on_verdict(verdict: Summary) -> None:
        there = {path.name.partition("-")[0] for path in folder.rglob("*") if path.is_file()}
        kept = {Path(str(sent.path)).name.partition("-")[0] for sent in verdict.sent}
        assert len(kept) == 1, "a copy of what is sent is there as soon as anybody is told"
        assert there - {"policies.log"} == {"store.sqlite"} | kept, "what policies print may come at any time"
        told.append(verdict)

    with Pool(2) as pool:
        single_selection(
            EntryList(tuple(entrants)),
            OutputFolder(folder),
            CONFIG,
            pool,
            lambda *progress: seen.append(progress),
            on_verdict,
        )
    assert {stage for stage, _, _ in seen} == {"kernels", "pareto", "battery", "timing", "tournament"}
    [verdict] = told
    published = read_summary(folder / "summary.json")
    assert verdict.ranking
    assert (verdict.ranking, verdict.sent) == (published.ranking, published.sent)
    return folder


@pytest.fixture(scope="module")
def summary(run: Path) -> Any:
    return json.loads((run / "summary.json").read_text())


def test_it_leaves_everything_that_it_promises(run: Path) -> None:
    for path in ("report/index.html", "report/ranking.xlsx", "replays/final.rrd", "races/final.mcap"):
        assert (run / path).stat().st_size > 1000, path
    assert not list(run.rglob("*.partial"))
    assert read_summary(run / "summary.json").log == "../policies.log"
    assert "actions that are not finite" in (run / "policies.log").read_text()


def test_the_summary_counts_what_was_run(run: Path, summary: Any, entrants: list[Entrant]) -> None:
    stages = {stage["name"]: stage for stage in summary["stages"]}
    assert list(stages) == ["pareto", "battery", "committee", "tournament"]
    assert stages["pareto"]["in"] == len(entrants)
    assert stages["battery"]["in"] == stages["pareto"]["out"]
    assert stages["committee"]["in"] == stages["battery"]["out"]
    assert stages["tournament"]["in"] == stages["committee"]["out"]
    with Store.open(run / "store.sqlite") as store:
        for name, stage in stages.items():
            assert store.results(name).select("match", "race").unique().height == stage["races"]
    assert all(stage["ran"] == stage["races"] for stage in stages.values())
    assert all(stage["core_s"] == pytest.approx(2 * stage["wall_s"]) for stage in stages.values())
    expected = {stage["name"]: stage for stage in summary["forecast"]["stages"]}
    assert expected["pareto"]["entrants"] == len(entrants)
    assert stages["pareto"]["races"] <= expected["pareto"]["most_races"]
    ranking = summary["ranking"]
    assert len(ranking) == stages["tournament"]["in"]
    for row in ranking:
        assert row["points_low"] <= row["points_per_race"] <= row["points_high"]
    # A race gives 39 points to two teams.
    assert np.mean([row["points_per_race"] for row in ranking]) == pytest.approx(19.5)


def test_the_faulty_policy_loses_and_the_rest_go_on(run: Path, summary: Any, entrants: list[Entrant]) -> None:
    faulty = next(entrant for entrant in entrants if entrant.name == "faulty")
    with Store.open(run / "store.sqlite") as store:
        rows = store.results("pareto").filter(pl.col("entrant") == faulty.id)
        [record] = store.runs()
        survives = dict(store.table(record.name, "pareto").select("entrant", "survives").iter_rows())
    assert (rows["ending"] == "illegal_action").all()
    assert summary["faults"] == rows.height
    assert not survives[faulty.id]
    assert any(survives.values())


def test_a_second_run_runs_nothing_and_says_the_same(
    run: Path, summary: Any, entrants: list[Entrant]
) -> None:
    page = (run / "report" / "index.html").stat().st_mtime_ns
    done: list[tuple[str, int, int]] = []
    sent: list[tuple[Sent, ...]] = []
    with Pool(2) as pool:
        single_selection(
            EntryList(tuple(entrants)),
            OutputFolder(run),
            CONFIG,
            pool,
            lambda *progress: done.append(progress),
            lambda verdict: sent.append(verdict.sent),
        )
    assert all(count == total for stage, count, total in done if stage != "kernels")
    again = json.loads((run / "summary.json").read_text())
    for stage in (*summary["stages"], *again["stages"]):
        for clocked in ("wall_s", "core_s"):
            stage.pop(clocked, None)
    assert again == summary
    assert [[one.name for one in those] for those in sent] == [[one["name"] for one in summary["sent"]]]
    assert (run / "report" / "index.html").stat().st_mtime_ns > page


def test_one_worker_in_a_new_folder_says_the_same(
    run: Path, summary: Any, entrants: list[Entrant], tmp_path: Path
) -> None:
    """Only the filter, from nothing: results do not depend on how matches are spread over processes."""
    matches = FilterPlan(CONFIG.pareto, RACES, np.random.SeedSequence([CONFIG.seed, 0])).time_trials(
        entrants[:1], 0
    )
    [(match, results)] = list(run_matches(matches, 1))
    with Store.open(run / "store.sqlite") as store:
        assert store.results_of([match.key]).equals(results)


def test_the_recorded_race_is_the_deciding_one(run: Path, summary: Any) -> None:
    log = read_recording(run / "races" / "final.mcap")
    first, second = (row["name"] for row in summary["ranking"][:2])
    assert set(log.names) == {first, second}
    assert sorted(log.teams) == [0] * 4 + [1] * 4
    assert summary["recording"] == "../races/final.mcap"


def test_the_spreadsheet_ranks_like_the_summary(run: Path, summary: Any) -> None:
    sheet = openpyxl.load_workbook(run / "report" / "ranking.xlsx")["Ranking"]
    cells = {cell for row in sheet.iter_rows(values_only=True) for cell in row if isinstance(cell, str)}
    assert {row["name"] for row in summary["ranking"]} <= cells


def test_the_tournament_mirrors_every_pair(entrants: list[Entrant]) -> None:
    matches = tournament_matches(entrants, 3, np.random.SeedSequence(0))
    assert len(matches) == 6
    for match in matches:
        assert len(match.races) == 6
        for plain, mirror in zip(match.races[::2], match.races[1::2], strict=True):
            assert plain.seed == mirror.seed
            assert (plain.mirrored, mirror.mirrored) == (False, True)
            assert [seat.entrant for seat in plain.seats] == [1 - seat.entrant for seat in mirror.seats]
            assert [seat.entrant for seat in plain.seats] == [0, 1] * 4


def test_stages_have_fresh_seeds_and_entrants_share_them(entrants: list[Entrant]) -> None:
    filters = FilterPlan(CONFIG.pareto, RACES, np.random.SeedSequence([1, 0])).races(entrants, 0)
    assert len({tuple(race.seed for race in match.races) for match in filters}) == 1
    assert len({match.key for match in filters}) == len(entrants)
    skills = skill_matches(entrants, load_skills(CONFIG.battery.tests), np.random.SeedSequence([1, 1]))
    filter_seeds = {race.seed for race in filters[0].races}
    assert not filter_seeds & {race.seed for match in skills.values() for race in match.races}


def test_there_is_no_deciding_race_without_two() -> None:
    with pytest.raises(InputError):
        only_once([])
    alone = pl.DataFrame({"entrant": ["alone"]})
    assert notable_races(pl.DataFrame(schema=RESULTS), alone) == []
