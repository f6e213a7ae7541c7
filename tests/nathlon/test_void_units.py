"""Void runs in gate, matrix and recipes: said everywhere, and never evidence for a policy."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import onnx
import polars as pl
import pytest

from nathlon.arena.decision import Decision
from nathlon.arena.entrant import Entrant
from nathlon.arena.store import Store
from nathlon.arena.voids import most_void
from nathlon.arena.world_registry import load_world
from nathlon.judge.gate.gate import run_gate
from nathlon.judge.matrix.cells import plan_cells
from nathlon.judge.matrix.matrix import run_matrix
from nathlon.judge.recipes.grouping import RecipeRun
from nathlon.judge.recipes.scores import score
from nathlon.judge.recipes.summary import summarise
from nathlon.reports.gate import junit, markdown
from nathlon.reports.gate_page import render_gate
from nathlon.reports.matrix_page import render_matrix
from nathlon.reports.recipes_page import headline
from nathlon.results.gate import GateReport
from nathlon.results.matrix import MatrixReport
from nathlon.results.recipes import exit_code, void_units
from nathlon.selection.config import Config, read_config
from nathlon.selection.run import Run
from tests.nathlon.test_voids import ALL, NOTHING, Here, OwnProcess, Spoil
from tests.support import planted_laps
from tests.support.games import player, world_of
from tests.support.race_results import rows

RISKS = "alpha = 0.1\nbeta = 0.1\n"
LAPS = f"{planted_laps.__file__}:PLANTED"


def begun(folder: Path, entrants: Sequence[Entrant], spoil: Spoil) -> Run:
    """A run in this process that voids what `spoil` says."""
    store = Store(folder / "store.sqlite")
    store.begin_run("run", {})
    engine = Here(store, {one.id: one.name for one in entrants}, spoil, "simulator_fault")
    pool: Any = OwnProcess()
    return Run(store, "run", (1,), pool, lambda *_: None, other_engine=engine)


def configured(folder: Path, world: str, text: str) -> Config:
    path = folder / "nathlon.toml"
    path.write_text(f"world = {json.dumps(world)}\n{text}")
    return read_config(path).suited


def lappers(folder: Path, *names: str) -> list[Entrant]:
    for name in names:
        (folder / f"{name}.onnx").write_text(name)
    return [load_world(LAPS).enter(str(folder / f"{name}.onnx")) for name in names]


def laps_gated(folder: Path, champion: str, candidate: str, spoil: Spoil = lambda *_: NOTHING) -> GateReport:
    text = '[pareto]\ntime_trial = "solo"\n[gate]\nblock = 64\nruns = 64\nbreakdowns = 0.1\n' + RISKS
    first, other = lappers(folder, champion, candidate)
    return run_gate(begun(folder, [first, other], spoil), first, [other], configured(folder, LAPS, text))


def duellists(folder: Path, *names: str) -> tuple[str, list[Entrant]]:
    """A game of two, and players that are all perfect, each in a file of its own."""
    world = world_of(folder, "PettingZooWorld({'duel': envs['duel']})")
    entrants = []
    for name in names:
        source = player(folder / f"{name}.onnx", 3)
        model = onnx.load(source)
        model.doc_string = name
        onnx.save(model, source)
        entrants.append(load_world(world).enter(source))
    return world, entrants


def duels_gated(folder: Path, spoil: Spoil, block: int = 72) -> GateReport:
    world, (first, other) = duellists(folder, "old", "new")
    config = configured(
        folder,
        world,
        f"[gate]\npoints = 5.0\npairs = 72\nblock = {block}\n",
    )
    return run_gate(begun(folder, [first, other], spoil), first, [other], config)


def told(report: GateReport) -> list[str]:
    """What a gate says, wherever it does."""
    pages = [markdown(report), render_gate(report), junit(report).decode(), report.model_dump_json()]
    return [page.replace("\\", "") for page in pages]


def test_a_gate_whose_races_are_all_void_judges_nobody(tmp_path: Path) -> None:
    report = duels_gated(tmp_path, lambda *_: ALL)
    assert (report.verdict, report.exit_code) == (Decision.CANNOT_TELL, 3)
    assert report.headline == "new could not be judged beside old: most runs of new and old are void."
    assert all("72 of 72 pairs are void" in page for page in told(report))
    assert report.void == report.races == 144
    [gated] = report.candidates
    assert {finding.verdict for finding in gated.findings} == {Decision.CANNOT_TELL}
    assert {(one.name, one.void, one.runs, one.unit) for one in gated.not_judged} == {
        (name, 72, 72, "pair") for name in ("new", "old")
    }


def test_void_pairs_are_no_evidence_for_a_candidate(tmp_path: Path) -> None:
    """An eighth of the pairs may hide any loss; a few are said and hinder nobody."""
    report = duels_gated(tmp_path, lambda *_: pl.col("race") % 16 == 0)
    assert (report.verdict, report.exit_code) == (Decision.CANNOT_TELL, 4)
    assert all("9 of 72 pairs are void, 9 maybe by its doing" in page for page in told(report))
    few = tmp_path / "few"
    few.mkdir()
    report = duels_gated(few, lambda *_: pl.col("race") == 0)
    assert report.verdict == Decision.PASS
    assert all("1 of 72 pairs are void and count for nobody" in page for page in told(report))
    assert report.remarks == ["1 of 144 races are void and count for nobody."]


def test_a_gate_of_races_ends_where_void_pairs_leave_no_pass(tmp_path: Path) -> None:
    """Of a void pair nobody knows who voided it: with 5 % of 72 pairs void, nobody can pass any more."""
    report = duels_gated(tmp_path, lambda *_: ALL, block=8)
    assert (report.verdict, report.exit_code, report.races) == (Decision.CANNOT_TELL, 3, 16)
    assert "8 of 8 pairs are void" in report.candidates[0].findings[0].note


def test_who_voids_its_own_runs_is_not_ruled_to_complete_them(tmp_path: Path) -> None:
    report = laps_gated(tmp_path, "old", "new", lambda _, names: ALL if names[0] == "new" else NOTHING)
    assert (report.exit_code, report.headline) == (
        3,
        "new could not be judged beside old: most runs of new are void.",
    )


@pytest.mark.parametrize(("every", "lost"), [(5, 13), (3, 22)])
def test_some_void_runs_of_its_own_may_be_breakdowns(tmp_path: Path, every: int, lost: int) -> None:
    report = laps_gated(
        tmp_path,
        "old",
        "new",
        lambda _, names: pl.col("race") % every == 0 if names[0] == "new" else NOTHING,
    )
    completion = report.candidates[0].findings[0]
    assert completion.verdict == Decision.CANNOT_TELL
    assert f"{lost} void runs of its own may be breakdowns too" in completion.note


def test_runs_void_for_both_or_for_the_champion_do_not_hinder_a_candidate(tmp_path: Path) -> None:
    report = laps_gated(tmp_path, "old", "new", lambda *_: pl.col("race") % 5 == 0)
    assert report.verdict == Decision.PASS
    theirs = tmp_path / "theirs"
    theirs.mkdir()
    report = laps_gated(
        theirs, "old", "new", lambda _, names: pl.col("race") % 5 == 0 if names[0] == "old" else NOTHING
    )
    assert report.verdict == Decision.PASS
    assert "13 of 64 runs are void and count for nobody" in report.candidates[0].findings[0].note


def test_a_champion_at_fault_is_said(tmp_path: Path) -> None:
    report = laps_gated(tmp_path, "illegal-60", "new")
    assert 0 < report.champion_faults < report.champion_runs
    said = (
        f"illegal-60 itself ended {report.champion_faults} of {report.champion_runs} runs by its own fault."
    )
    assert said in report.remarks
    assert f"{report.champion_faults} of {report.champion_runs} runs of the champion ended" in (
        report.candidates[0].findings[-1].note
    )


def test_what_a_gate_cannot_tell_has_a_note(tmp_path: Path) -> None:
    world, (first, other) = duellists(tmp_path, "old", "new")
    config = configured(tmp_path, world, "[gate]\npoints = 0.1\npairs = 8\nblock = 8\n")
    run = begun(tmp_path, [first, other], lambda *_: NOTHING)
    [gated] = run_gate(run, first, [other], config).candidates
    assert gated.verdict == Decision.CANNOT_TELL
    [points] = [finding for finding in gated.findings if finding.measure == "points"]
    assert "the budget is spent" in points.note
    assert points.needed is None or points.needed > 8


def cells(folder: Path, spoil: Spoil, runs: int = 8) -> MatrixReport:
    policy, baseline = lappers(folder, "new", "old")
    config = configured(
        folder, LAPS, f"[matrix]\nruns = {runs}\nmost_runs = 8\n[matrix.margins]\nscore = 0.5\n"
    )
    run = begun(folder, [policy, baseline], spoil)
    return run_matrix(run, plan_cells(run.pool, policy.source, baseline.source, config), config)[0]


@pytest.mark.parametrize(("who", "counts"), [("new", (8, 0)), ("old", (0, 8))])
def test_a_matrix_of_void_runs_judges_nothing(tmp_path: Path, who: str, counts: tuple[int, int]) -> None:
    report = cells(tmp_path, lambda _, names: ALL if names[0] == who else NOTHING)
    assert (report.policy_void, report.baseline_void) == counts
    assert report.headline == "new could not be judged beside old: most runs are void."
    assert report.exit_code == 3
    assert report.void_runs in render_matrix(report)
    frame = report.frame()
    assert (frame["judged"].to_list(), frame["policy_void"].to_list()) == ([False], [counts[0]])


def test_a_matrix_says_what_is_void_and_compares_the_rest(tmp_path: Path) -> None:
    report = cells(tmp_path, lambda _, names: pl.col("race") < 4 if names[0] == "new" else NOTHING)
    assert (report.exit_code, report.not_judged) == (0, 0)
    assert report.void_runs.startswith("4 of 8 runs of new and 0 of old are void")
    assert report.cells[0].findings[0].worse is not None


def trained(folder: Path, spoil: Spoil) -> tuple[pl.DataFrame, pl.DataFrame]:
    """RECIPES and SCORES of two recipes of two training runs each."""
    names = [f"{recipe}{seed}" for recipe in ("base", "more") for seed in range(2)]
    world, (reference, *ends) = duellists(folder, "reference", *names)
    attempts = [RecipeRun(one.name[:4], one.name, (one,)) for one in ends]
    config = configured(folder, world, "[tournament]\npairs = 3\n")
    scores = score(begun(folder, [reference, *ends], spoil), attempts, [reference], config)
    return summarise(scores, np.random.default_rng(1)), scores


@pytest.mark.filterwarnings("error::RuntimeWarning")
def test_training_runs_that_are_void_are_not_counted(tmp_path: Path) -> None:
    recipes, scores = trained(tmp_path, lambda _, names: pl.col("race") < 4 if "more1" in names else NOTHING)
    base, more = recipes.to_dicts()
    assert (base["runs"], base["not_judged"], more["runs"], more["not_judged"]) == (2, 0, 1, 1)
    assert scores.filter(run="more1").select("units", "void", "judged", "points").row(0) == (
        1,
        2,
        False,
        None,
    )
    assert exit_code(scores) == 3
    said = void_units(recipes, scores)
    assert said == (
        "2 of 12 mirrored pairs are void and count for nobody; could not be judged: "
        "1 training run of more (1 left)."
    )


@pytest.mark.filterwarnings("error::RuntimeWarning")
def test_recipes_that_are_all_void_are_said_not_to_be_judged(tmp_path: Path) -> None:
    recipes, scores = trained(
        tmp_path, lambda _, names: ALL if any(name.startswith("more") for name in names) else NOTHING
    )
    assert recipes["runs"].to_list() == [2, 0]
    assert recipes["best"].to_list()[1] is None
    assert headline(recipes) == "Could not be judged, as most of its pairs are void: more"
    assert exit_code(scores) == 3


def test_runs_that_are_missing_never_make_a_recipe_better() -> None:
    """What beats all others is not called better where half of its runs are void."""
    from tests.nathlon.test_recipes import scores_of

    scores = scores_of(base=[[0.0 + n] for n in range(6)], more=[[10.0 + n] for n in range(12)])
    lost = (pl.col("recipe") == "more") & pl.col("run").is_in([f"seed {seed}" for seed in range(7, 13)])
    scores = scores.with_columns(
        points=pl.when(~lost).then("points"), judged=~lost, void=pl.when(lost).then(8).otherwise(0)
    )
    recipes = summarise(scores, np.random.default_rng(1))
    assert recipes["better"][1] == 1.0
    assert recipes["better_low"][1] == 0.5
    assert headline(recipes) == "No recipe is surely better or worse than base"


def raced(void: dict[str, int], races: int = 20) -> pl.DataFrame:
    """Tests of some, of which so many runs are void."""
    frames = [
        rows(
            {
                "match": name,
                "entrant": name,
                "race": list(range(races)),
                "team": 0,
                "ending": ["simulator_fault"] * lost + ["finished"] * (races - lost),
            },
            races,
        )
        for name, lost in void.items()
    ]
    return pl.concat(frames)


def test_whose_runs_are_void_is_named_where_it_stands_out() -> None:
    assert most_void(raced({"a": 8, "b": 1, "c": 0}), "abc") == ("a", 8, 20)
    assert most_void(raced({"a": 8, "b": 1, "c": 0}), "bc") is None
    assert most_void(raced({"a": 3, "b": 2, "c": 3}), "abc") is None
    assert most_void(raced({"a": 1, "b": 0}), "ab") is None
