"""`nathlon recipes`: who belongs together, what the figures over runs say, and from folders to a page."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from scipy.stats import mannwhitneyu

import nathlon
from nathlon.arena.pool import Pool
from nathlon.arena.store import Store
from nathlon.judge.recipes.grouping import attempts, checkpoints_of, recipe_folders, same_files
from nathlon.judge.recipes.statistics import (
    estimate,
    interquartile_mean,
    mean,
    optimality_gap,
    probability_of_improvement,
    shrunk,
)
from nathlon.judge.recipes.summary import last_checkpoints, summarise
from nathlon.reports.recipes_figure import curve
from nathlon.reports.recipes_page import headline
from nathlon.results.recipes import RECIPES, SCORES, too_few
from nathlon.sim.errors import InputError
from tests.support.checkpoints import BUNDLED
from tests.support.command_line import nathlon as command
from tests.support.command_line import refused

LADDER = BUNDLED[0].parent
QUICK = """
seed = 3
[tournament]
format = "1v1"
pairs = 2
[nightly]
anchors = ["driver", "driver:pace=0.9"]
"""


def rng() -> np.random.Generator:
    return np.random.default_rng(11)


@pytest.fixture(scope="module")
def folders(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two recipes: one with two runs of two checkpoints, one with two seeds in one folder."""
    root = tmp_path_factory.mktemp("recipes")
    placed = {
        "plain/one": ("s1-004k", "s1-008k"),
        "plain/two": ("s1-020k", "s1-032k"),
        "wary": ("timid-004k", "fair-020k"),
    }
    for folder, names in placed.items():
        (root / folder).mkdir(parents=True)
        for name in names:
            shutil.copy(LADDER / f"lindenring-{name}.safetensors", root / folder)
    (root / "quick.toml").write_text(QUICK)
    return root


def test_a_folder_holds_a_recipe_and_those_in_it_its_runs(folders: Path) -> None:
    found = recipe_folders([str(folders / "plain"), f"careful={folders / 'wary'}"])
    assert list(found) == ["plain", "careful"]
    with Pool(1) as pool:
        runs = attempts(pool, found, checkpoints_of(found, ()), "lindenring", "gt3", "racing")
    assert [(run.recipe, len(run.checkpoints)) for run in runs[:2]] == [("plain", 2), ("plain", 2)]
    assert [one.step for one in runs[0].checkpoints] == [4000, 8000]
    seeds = {one.seed for run in runs[2:] for one in run.checkpoints}
    assert len(runs[2:]) == len(seeds), "a seed is a run"


def test_copies_of_a_training_run_are_no_further_run_and_said(tmp_path: Path) -> None:
    """A run that ends with another's file would else be judged by an earlier checkpoint of its own."""
    placed = {
        "plain/one/a": "s1-004k",
        "plain/one/b": "s1-032k",
        "plain/one/best": "s1-032k",
        "wary/again/a": "s1-008k",
        "wary/again/b": "s1-032k",
        "wary/own/a": "fair-020k",
    }
    for place, name in placed.items():
        (tmp_path / place).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(LADDER / f"lindenring-{name}.safetensors", tmp_path / f"{place}.safetensors")
    found = recipe_folders([str(tmp_path / "plain"), str(tmp_path / "wary")])
    with Pool(1) as pool:
        files = checkpoints_of(found, ())
        runs = attempts(pool, found, files, "lindenring", "gt3", "racing")
        echo = {"plain": tmp_path / "plain", "echo": tmp_path / "wary/again"}
        with pytest.raises(InputError, match="again: all training runs end with a copy of another recipe's"):
            attempts(pool, echo, checkpoints_of(echo, ()), "lindenring", "gt3", "racing")
    assert [(run.recipe, len(run.checkpoints)) for run in runs] == [("plain", 2), ("wary", 1)]
    [itself, copied, left] = same_files(runs, files, [runs[0].checkpoints[0]])
    assert itself.endswith("itself, which it does not race.")
    assert copied.startswith(f"Same file as {runs[0].last.name}, counted once: ")
    assert [f"{place}.safetensors" in copied for place in placed] == [False, False, True, False, True, False]
    assert left.endswith("ends with such a copy: " + str(tmp_path / "wary/again/a.safetensors") + ".")


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (["nowhere"], "no such folder"),
        (["empty"], "holds no checkpoint"),
        (["a=full", "a=full"], "NAME=FOLDER"),
    ],
)
def test_wrong_folders_are_one_sentence(tmp_path: Path, given: list[str], said: str) -> None:
    (tmp_path / "empty").mkdir()
    (tmp_path / "full").mkdir()
    shutil.copy(LADDER / "lindenring-s1-004k.safetensors", tmp_path / "full")
    refused(command("recipes", *given, cwd=tmp_path), said)
    with pytest.raises(InputError):
        recipe_folders(["nowhere"])


def test_aggregates_have_known_answers() -> None:
    scores = np.array([[0.0, 1.0], [2.0, 3.0], [4.0, 5.0], [6.0, 100.0]])
    assert mean(scores) == pytest.approx(121 / 8)
    assert interquartile_mean(scores) == pytest.approx((2 + 3 + 4 + 5) / 4)
    assert optimality_gap(3.0)(scores) == pytest.approx((3 + 2 + 1) / 8)
    stacked = np.stack([scores, scores + 1])
    assert interquartile_mean(stacked) == pytest.approx([3.5, 4.5])


def test_the_probability_of_improvement_is_mann_and_whitneys() -> None:
    ours, theirs = rng().integers(0, 6, (2, 9, 1)).astype(float)
    told = probability_of_improvement(ours, theirs, rng(), 100, 0.95)
    assert told.value == pytest.approx(mannwhitneyu(ours[:, 0], theirs[:, 0]).statistic / 81)
    assert probability_of_improvement(ours + 10, theirs, rng(), 100, 0.95) == (1.0, 1.0, 1.0)


@pytest.mark.parametrize("references", [1, 4])
def test_equal_recipes_are_seldom_told_apart_however_many_references_a_run_meets(references: int) -> None:
    generator, count, told_apart = rng(), 400, 0
    for _ in range(count):
        ours, theirs = generator.normal(size=(2, 5, 1)) + 0.3 * generator.normal(size=(2, 5, references))
        told = probability_of_improvement(ours, theirs, generator, 300, 0.95)
        told_apart += told.low > 0.5 or told.high < 0.5
    assert told_apart / count <= 0.05 + 2 * (0.05 * 0.95 / count) ** 0.5


def test_so_few_runs_that_chance_does_as_much_prove_nothing() -> None:
    ours, theirs = np.arange(3.0)[:, None], np.arange(3.0)[:, None]
    told = probability_of_improvement(ours + 10, theirs, rng(), 100, 0.95)
    assert (told.value, told.low, told.high) == (1.0, 0.5, 1.0)
    assert too_few(3, 3, 1)
    assert not too_few(4, 4, 1)
    assert too_few(4, 4, 2), "two comparisons share the five per cent"
    same = np.full((6, 2), 1 / 3)
    assert probability_of_improvement(same, same, rng(), 100, 0.95)[:2] == (0.5, 0.5)


def test_intervals_over_runs_cover_and_one_run_has_none() -> None:
    generator, covered = rng(), 0
    for _ in range(300):
        scores = generator.normal(1.0, 1.0, (20, 2))
        told = estimate(scores, mean, generator, 300, 0.95)
        covered += told.low <= 1.0 <= told.high
    assert 0.88 <= covered / 300 <= 0.98
    assert np.isnan(estimate(np.array([[1.0, 2.0]]), mean, rng(), 10, 0.95)[1:]).all()


def test_the_best_of_equals_is_expected_to_be_like_the_others() -> None:
    generator = rng()
    regret = []
    for spread in (0.0, 2.0):
        gains, expected = [], []
        for _ in range(300):
            truth = generator.normal(5.0, spread, 12) if spread else np.full(12, 5.0)
            seen = truth + generator.normal(0.0, 1.0, 12)
            best = int(np.argmax(seen))
            gains.append(seen[best] - truth[best])
            expected.append(shrunk(seen, np.ones(12))[best] - truth[best])
        assert np.mean(gains) > 0.25, "the winner's curse"
        assert abs(np.mean(expected)) < 0.4 * np.mean(gains)
        regret.append(np.mean(gains))
    assert regret[0] > regret[1]
    assert shrunk(np.array([1.0, 9.0]), np.zeros(2)) == pytest.approx([1.0, 9.0]), "nothing was luck"


def scores_of(**recipes: list[list[float]]) -> pl.DataFrame:
    """SCORES of recipes whose runs have checkpoints of so many points, by steps of a thousand."""
    rows = [
        {
            "recipe": recipe, "run": f"seed {seed}", "step": 1000 * step, "entrant": f"{recipe}{seed}{step}",
            "name": f"{recipe}-{seed}-{step}", "task": "4v4", "units": 8, "points": points, "error": 0.5,
            "contacts": 4, "at_fault": seed, "km": 10.0, "void": 0, "judged": True,
        }
        for recipe, runs in recipes.items()
        for seed, run in enumerate(runs, 1)
        for step, points in enumerate(run, 1)
    ]  # fmt: skip
    return pl.DataFrame(rows, schema=SCORES)


def test_a_recipe_is_judged_by_the_ends_of_its_runs() -> None:
    good, bad = [[9.0, 1.0], [2.0, 3.0]], [[1.0, -4.0], [0.0, -2.0]]
    assert "too few runs to prove it: worse" in headline(summarise(scores_of(base=good, worse=bad), rng()))
    scores = scores_of(base=2 * good, worse=2 * bad)
    table = summarise(scores, rng())
    assert table.schema == RECIPES
    base, worse = table.to_dicts()
    assert (base["points"], worse["points"]) == (2.0, -3.0)
    assert base["at_fault_per_km"] == pytest.approx(0.25)
    assert (base["best"], base["best_points"]) == ("base-1-1", 9.0)
    assert 2.0 < base["best_expected"] < 9.0
    assert (base["better"], worse["better"], worse["gap"]) == (None, 0.0, 3.0)
    assert headline(table) == "Worse than base: worse"
    assert last_checkpoints(scores)["points"].to_list() == [1.0, 3.0, 1.0, 3.0, -4.0, -2.0, -4.0, -2.0]
    assert curve(scores, "base").to_dicts() == [
        {"step": 1000, "mean": 5.5, "low": 2.0, "high": 9.0},
        {"step": 2000, "mean": 2.0, "low": 1.0, "high": 3.0},
    ]


def test_from_folders_to_a_page_and_nothing_runs_twice(folders: Path) -> None:
    given = [folders / "plain", folders / "wary"]
    result = nathlon.recipes(given, folders / "out", config=folders / "quick.toml", progress=False)
    assert result.scores.height == 6 * 2, "every checkpoint meets both anchors"
    assert result.scores["task"].unique().sort().to_list() == ["1v1, driver", "1v1, driver:pace=0.9"]
    assert (result.scores["units"] == 2).all()
    mean_points = last_checkpoints(result.scores).filter(recipe="plain")["points"].mean()
    assert result.recipes["points"][0] == pytest.approx(mean_points)
    page = (result.folder / "index.html").read_text()
    assert headline(result.recipes) in page
    with Store(result.folder / "store.sqlite") as store:
        before = store.results().height
    again = ("recipes", "plain", "wary", "--out", "out", "--config", "quick.toml", "--json")
    done = command(*again, cwd=folders)
    assert json.loads(done.stdout)["recipes"] == result.recipes.to_dicts()
    assert json.loads(done.stdout)["remarks"] == list(result.remarks) == []
    with Store(result.folder / "store.sqlite") as store:
        assert store.results().height == before
