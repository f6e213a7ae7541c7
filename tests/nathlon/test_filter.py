"""The filter as a stage: who drives what in which round, and how it is told to."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from nathlon.arena.entrant import Entrant, enter, only_once
from nathlon.arena.pool import Pool
from nathlon.arena.store import Store
from nathlon.arena.world_registry import load_world
from nathlon.commands.pareto import pareto as pareto_command
from nathlon.selection.config import Config, read_config
from nathlon.selection.pareto import STANDARD
from nathlon.selection.pareto.filter import FilterPlan, FilterSettings, run_filter
from nathlon.selection.pareto.objective import Objective
from nathlon.selection.run import Answer, Run
from nathlon.sim.errors import InputError
from tests.support.checkpoints import BUNDLED, save_faulty

RACES = load_world("racing")
DASH = """
name = "{name}"
description = "A short way"
cars = {cars}
finish_m = 150.0
time_s = 40.0

[start]
kind = "rolling"
leader_m = [0.0, 20.0]
gap_m = [12.0, 20.0]
lateral_m = [-1.0, 1.0]
speed_m_s = [30.0, 40.0]
"""

OBJECTIVES = """
[[pareto.objective]]
name = "alone"
measure = "race_time_s"
from = "time_trial"

[[pareto.objective]]
name = "points"
measure = "points"
from = "race"
goal = "max"
"""


def short(folder: Path) -> Config:
    """A configuration with short runs, as a file tells it."""
    for name, cars in (("alone", 1), ("duel", 2)):
        (folder / f"{name}.toml").write_text(DASH.format(name=name, cars=cars), "utf-8")
    path = folder / "nathlon.toml"
    path.write_text(
        f'seed = 3\nworkers = 1\n[pareto]\nscenario = "{folder}/duel.toml"\n'
        f'time_trial = "{folder}/alone.toml"\nopponents = ["driver:pace=0.9"]\n'
        f"races = 2\nmost_races = 6\n{OBJECTIVES}",
        "utf-8",
    )
    return read_config(path)


@pytest.fixture(scope="module")
def entrants(tmp_path_factory: pytest.TempPathFactory) -> list[Entrant]:
    faulty = tmp_path_factory.mktemp("faulty") / "faulty.safetensors"
    save_faulty(faulty)
    return only_once([enter(str(path), "lindenring", "gt3") for path in [*BUNDLED[:2], BUNDLED[-1], faulty]])


@pytest.fixture(scope="module")
def pool() -> Iterator[Pool]:
    with Pool(1) as pool:
        yield pool


@pytest.fixture(scope="module")
def config(tmp_path_factory: pytest.TempPathFactory) -> Config:
    return short(tmp_path_factory.mktemp("config"))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("run")


def filtered(folder: Path, pool: Pool, entrants: list[Entrant], config: Config) -> tuple[Answer, int]:
    """The stage's answer, and how many matches had to be run."""
    missing: list[int] = []
    with Store(folder / "store.sqlite") as store:
        store.begin_run("test", {})
        run = Run(store, "test", (3,), pool, lambda stage, done, total: missing.append(total - done))
        return run_filter(run, entrants, config.pareto), max(missing)


@pytest.fixture(scope="module")
def answer(folder: Path, pool: Pool, entrants: list[Entrant], config: Config) -> Answer:
    return filtered(folder, pool, entrants, config)[0]


def runs_of(answer: Answer, entrant: Entrant, test: str) -> int:
    ran = (pl.col("entrant") == entrant.id) & (pl.col("test") == test)
    return answer.results.filter(ran).select("match", "race").unique().height


def test_who_fails_in_the_time_trial_never_races(answer: Answer, entrants: list[Entrant]) -> None:
    *good, faulty = entrants
    assert (runs_of(answer, faulty, "time_trial"), runs_of(answer, faulty, "race")) == (2, 0)
    for entrant in good:
        assert runs_of(answer, entrant, "race") in (2, 4, 6)
    row = answer.tables["pareto"].row(by_predicate=pl.col("entrant") == faulty.id, named=True)
    assert (row["races"], row["survives"], row["contacts_per_km"]) == (0, False, None)


def test_races_are_counted_and_survivors_go_on(answer: Answer, entrants: list[Entrant]) -> None:
    table = answer.tables["pareto"]
    assert dict(table.select("entrant", "races").iter_rows()) == {
        entrant.id: runs_of(answer, entrant, "race") for entrant in entrants
    }
    assert {entrant.id for entrant in answer.entrants} == set(table.filter("survives")["entrant"])
    assert answer.entrants
    # Who stopped before the last round was settled or out of contention.
    stopped = table.filter(pl.col("races") < 6)["nondominated_probability"].to_numpy()
    assert ((stopped >= 0.95) | (stopped <= 0.5)).all()


def test_configured_objectives_decide_and_are_told(answer: Answer, entrants: list[Entrant]) -> None:
    told = answer.tables["objectives"].pivot("objective", index="entrant", values="value")
    races = answer.results.filter((pl.col("test") == "race") & (pl.col("slot") == 2))
    for entrant in entrants[:3]:
        points = races.filter(pl.col("entrant") == entrant.id)["points"].mean()
        assert told.filter(pl.col("entrant") == entrant.id)["points"].item() == pytest.approx(points)
    goals = dict(answer.tables["objectives"].select("objective", "goal").unique().iter_rows())
    assert goals == {"alone": "min", "points": "max"}


def test_a_second_run_runs_nothing_and_says_the_same(
    answer: Answer, folder: Path, pool: Pool, entrants: list[Entrant], config: Config
) -> None:
    again, missing = filtered(folder, pool, entrants, config)
    assert missing == 0
    for name, table in answer.tables.items():
        assert again.tables[name].equals(table)


def test_all_have_the_same_seeds_in_a_round_and_others_in_the_next(
    entrants: list[Entrant], config: Config
) -> None:
    plan = FilterPlan(config.pareto, RACES, np.random.SeedSequence(1))
    seeds: list[int] = []
    for index, count in enumerate([2, 2, 2]):
        for matches in (plan.time_trials(entrants, index), plan.races(entrants, index)):
            [drawn] = {tuple(race.seed for race in match.races) for match in matches}
            assert len({match.key for match in matches}) == len(entrants)
            assert len(drawn) == count
            seeds += drawn
    assert len(set(seeds)) == len(seeds)
    assert all(race.seats[-1].entrant == 0 for race in plan.races(entrants, 0)[0].races)


def test_rounds_double_what_was_raced_up_to_the_most() -> None:
    assert FilterSettings().rounds == [2, 2, 4]
    assert FilterSettings(races=3, most_races=10).rounds == [3, 3, 4]
    assert FilterSettings(races=5, most_races=5).rounds == [5]


def test_without_an_objective_from_races_nobody_races(entrants: list[Entrant]) -> None:
    lap = Objective(name="lap", measure="lap_s", source="time_trial")
    assert (
        FilterPlan(FilterSettings(objective=(lap,)), RACES, np.random.SeedSequence(1)).races(entrants, 0)
        == []
    )


def test_a_checkpoint_as_opponent_is_known_by_its_contents(entrants: list[Entrant]) -> None:
    settings = FilterSettings(opponents=(entrants[0].source, "driver:pace=0.9"))
    [match] = FilterPlan(settings, RACES, np.random.SeedSequence(1)).races([entrants[1]], 0)
    assert match.entrants == (entrants[1].id, entrants[0].id, "driver:pace=0.9")


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ("most_races = 1\nraces = 2", "most_races is 1: expected at least races, 2"),
        ("opponents = []", "pareto.opponents"),
        ('[[pareto.objective]]\nname = "a"\nmeasure = "speed"\nfrom = "race"', "expected one of lap_s, "),
        ('[[pareto.objective]]\nname = "a"\nmeasure = "place"\nfrom = "pit"', "pareto.objective.0.from"),
        ('[[pareto.objective]]\nname = "a"\nmeasure = "place"', "pareto.objective.0.from"),
        (2 * '[[pareto.objective]]\nname = "a"\nmeasure = "place"\nfrom = "race"\n', "a different name"),
    ],
)
def test_a_wrong_file_is_named_with_the_field(tmp_path: Path, more: str, said: str) -> None:
    path = tmp_path / "nathlon.toml"
    path.write_text(f"[pareto]\n{more}\n", "utf-8")
    with pytest.raises(InputError, match=said) as caught:
        read_config(path)
    assert str(path) in str(caught.value)


@pytest.mark.parametrize(("field", "name"), [("scenario", "1v3"), ("time_trial", "sprint")])
def test_scenarios_must_fit(field: str, name: str, folder: Path, pool: Pool, entrants: list[Entrant]) -> None:
    settings = FilterSettings.model_validate({field: name})
    with Store(folder / "other.sqlite") as store, pytest.raises(InputError, match=f"pareto.{field}"):
        run_filter(Run(store, "test", (1,), pool, lambda *_: None), entrants, settings)


def test_the_command_writes_the_table_and_prints_the_front(
    entrants: list[Entrant], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    short(tmp_path)
    once = tmp_path / "once.toml"
    once.write_text((tmp_path / "nathlon.toml").read_text().replace("most_races = 6", "most_races = 2"))
    sources = [entrant.source for entrant in entrants[:3]]
    pareto_command(sources, tmp_path, once, as_json=True)
    summary = json.loads(capsys.readouterr().out)
    table = pl.read_parquet(tmp_path / "pareto.parquet")
    assert table.height == summary["in"] == 3
    assert [row["name"] for row in summary["front"]] == table.filter("survives")["name"].to_list()
    assert {"alone", "points", "lap_s", "races"} <= set(table.columns)
    assert pl.read_csv(tmp_path / "pareto.csv")["name"].to_list() == table["name"].to_list()
    pareto_command(sources, tmp_path, once)
    printed = capsys.readouterr().out
    assert str(table["name"][0]) in printed
    assert not list(tmp_path.glob(".*partial"))


def test_the_standard_objectives_are_speed_discipline_and_care() -> None:
    assert [(o.name, o.source, o.goal) for o in STANDARD] == [
        ("lap_s", "time_trial", "min"),
        ("off_course_share", "race", "min"),
        ("contacts_per_km", "race", "min"),
    ]
