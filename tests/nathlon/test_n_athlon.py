"""The n-athlon as a stage, from results that are in the store already."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from pydantic import ValidationError

from nathlon.arena.entrant import enter
from nathlon.arena.match import TESTED, Match
from nathlon.arena.pool import Pool
from nathlon.arena.results import BATTERY, RESULTS, SKILLS
from nathlon.arena.store import Store
from nathlon.selection.battery import (
    DECATHLON,
    MARKS_RUNS,
    BatterySettings,
    marking_matches,
    run_battery,
    skill_matches,
)
from nathlon.selection.battery.skill import SKILLS_FOLDER, load_skills
from nathlon.selection.run import Run
from nathlon.sim.errors import InputError
from tests.support.race_results import DEFAULTS

CIRCUIT, CAR = "porto-sereno", "coupe"
ENTRANTS = [enter(f"driver:pace={pace}", CIRCUIT, CAR) for pace in (0.5, 0.7, 0.9)]
LAP_S = dict(zip((entrant.id for entrant in ENTRANTS), (110.0, 100.0, 96.0), strict=True))
SETTINGS = BatterySettings(tests=("hot_lap", "chicane_in_traffic", "consistency"))

Lap = Callable[[str], float | None]


@pytest.fixture
def store(tmp_path: Path) -> Iterator[Store]:
    with Store(tmp_path / "store.sqlite") as store:
        yield store


def night(store: Store, seed: int) -> Run:
    store.begin_run(f"night {seed}", {})
    return Run(store, f"night {seed}", (seed,), Pool(1), lambda stage, done, total: None)


def keep(store: Store, matches: Sequence[Match], lap: Lap) -> None:
    """Put results of matches of one car into the store: four laps, the fastest of them by entrant."""
    for match in matches:
        best = lap(match.entrants[0])
        rows = [
            DEFAULTS
            | {"match": match.key, "stage": "battery", "race": index, "seed": race.seed, "laps": 4}
            | {
                "entrant": match.entrants[0],
                "team": TESTED,
                "best_lap_s": best,
                "race_time_s": best and 4 * best + 0.4,
            }
            for index, race in enumerate(match.races)
        ]
        store.add_match(match.key, "battery", match.spec(), pl.DataFrame(rows, schema=RESULTS))


def raced(store: Store, seed: int, driver: float | None = 100.0) -> Run:
    """A night whose matches are all in the store."""
    run = night(store, seed)
    tests = load_skills(["hot_lap"])
    keep(store, list(skill_matches(ENTRANTS, tests, run.seeds("battery")).values()), LAP_S.__getitem__)
    keep(store, list(marking_matches(tests, ENTRANTS[0]).values()), lambda _: driver)
    return run


def seeds_of(match: Match) -> list[int]:
    return [race.seed for race in match.races]


def test_entrants_share_seeds_which_do_not_depend_on_the_other_tests() -> None:
    tests, seeds = load_skills(DECATHLON), np.random.SeedSequence([1, 1])
    everything = skill_matches(ENTRANTS, tests, seeds)
    assert len(everything) == len(tests) * len(ENTRANTS)
    for skill in tests:
        matches = [everything[skill.name, entrant.id] for entrant in ENTRANTS]
        assert len({tuple(seeds_of(match)) for match in matches}) == 1
        assert len(set(seeds_of(matches[0]))) == skill.runs
        assert skill_matches(ENTRANTS, [skill], seeds)[skill.name, ENTRANTS[0].id] == matches[0]
    other = skill_matches(ENTRANTS, tests, np.random.SeedSequence([2, 1]))
    assert not {seed for match in everything.values() for seed in seeds_of(match)} & {
        seed for match in other.values() for seed in seeds_of(match)
    }


def test_tests_that_ask_for_the_same_runs_share_them() -> None:
    tests = load_skills(["hot_lap", "consistency", "start_front", "start_back"])
    matches = skill_matches(ENTRANTS[:1], tests, np.random.SeedSequence(1))
    lap, steady, front, back = (match.key for match in matches.values())
    assert lap == steady
    assert front != back


def test_the_entrant_sits_in_its_slots_in_turn() -> None:
    [skill] = load_skills(["start_middle"])
    [match] = skill_matches(ENTRANTS[:1], [skill], np.random.SeedSequence(1), runs=3).values()
    for run, race in enumerate(match.races):
        assert [place for place, seat in enumerate(race.seats, 1) if seat.entrant == 0] == [skill.slot(run)]


def test_the_driver_drives_the_tests_with_seeds_of_its_own() -> None:
    tests = load_skills(["hot_lap", "delayed_lap"])
    own = marking_matches(tests, ENTRANTS[0])
    assert {match.entrants for match in own.values()} == {("driver",)}
    assert [match.scenario for match in own.values()] == ["stint", "time_trial"]
    assert {len(match.races) for match in own.values()} == {MARKS_RUNS}


def test_points_and_order_follow_from_the_runs(store: Store) -> None:
    answer = run_battery(raced(store, 1), ENTRANTS, SETTINGS)
    slow, middle, fast = ENTRANTS
    table, battery = answer.tables["skills"], answer.tables["battery"]
    assert table.schema == SKILLS
    assert battery.schema == BATTERY
    points = {(row["entrant"], row["test"]): row["points"] for row in table.iter_rows(named=True)}
    assert points[middle.id, "hot lap"] == pytest.approx(500.0, abs=0.01)
    for test in ("hot lap", "consistency"):
        assert points[fast.id, test] > 500.0 > points[slow.id, test]
    assert battery["entrant"].to_list() == [fast.id, middle.id, slow.id]
    assert battery["points"][1] == pytest.approx(1000.0, abs=0.01)
    assert answer.entrants == [fast, middle, slow]
    assert answer.results["entrant"].n_unique() == len(ENTRANTS) + 1


def test_runs_that_set_no_mark_are_counted(store: Store) -> None:
    run, tests = night(store, 1), load_skills(["hot_lap"])
    lost = ENTRANTS[0].id
    planned = skill_matches(ENTRANTS, tests, run.seeds("battery"))
    keep(store, list(planned.values()), lambda entrant: None if entrant == lost else LAP_S[entrant])
    keep(store, list(marking_matches(tests, ENTRANTS[0]).values()), lambda _: 100.0)
    runs = tests[0].runs
    assert run_battery(run, ENTRANTS, SETTINGS).failed == {
        "hot lap": {lost: runs},
        "consistency": {lost: runs},
    }


def test_a_circuit_without_the_section_sets_the_test_aside(store: Store) -> None:
    answer = run_battery(raced(store, 1), ENTRANTS, SETTINGS)
    assert set(answer.marks) == {"hot lap", "consistency"}
    assert answer.set_aside == {
        "chicane in traffic": "circuit 'porto-sereno' has no section 'last chicane'",
    }


def test_a_driver_that_fails_sets_the_test_aside(store: Store) -> None:
    answer = run_battery(raced(store, 1, driver=None), ENTRANTS, SETTINGS)
    assert set(answer.set_aside) == {"hot lap", "chicane in traffic", "consistency"}
    assert answer.tables["battery"].is_empty()
    assert answer.entrants == []


def test_the_marks_do_not_depend_on_the_night(store: Store) -> None:
    first, second = (run_battery(raced(store, seed), ENTRANTS, SETTINGS) for seed in (1, 2))
    assert first.marks == second.marks
    assert first.marks["hot lap"].base == pytest.approx(100.0)
    assert set(first.results["seed"]) != set(second.results["seed"])


def test_without_entrants_there_is_nothing_to_say(store: Store) -> None:
    run = night(store, 1)
    answer = run_battery(run, [], SETTINGS)
    assert answer.tables["skills"].schema == SKILLS
    assert answer.tables["battery"].is_empty()
    assert run.stages[-1].races == 0


def test_an_opponent_that_cannot_drive_is_named_before_anything_runs(store: Store, tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text((SKILLS_FOLDER / "defending.toml").read_text().replace('["driver"]', '["driver:wit=2"]'))
    with pytest.raises(InputError, match=r"test 'defending': field opponents: .*unknown setting 'wit'"):
        run_battery(night(store, 1), ENTRANTS, BatterySettings(tests=(str(path),)))


def test_settings_are_checked() -> None:
    for wrong in ({"tests": ()}, {"runs": 0}, {"sports": 1}):
        with pytest.raises(ValidationError):
            BatterySettings.model_validate(wrong)
