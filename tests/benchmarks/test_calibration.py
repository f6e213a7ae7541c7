"""What is drawn from raced races, against answers that are known."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from benchmarks.calibration.__main__ import need_spread
from benchmarks.calibration.batteries import by_scenario, drawn
from benchmarks.calibration.filters import RacedRuns, true_front
from benchmarks.calibration.tally import tally
from benchmarks.calibration.tournaments import (
    dealt,
    judged,
    nearly_equal,
    of_equals,
    of_finalists,
    pool_sd,
    true_points,
)
from benchmarks.ladder import Ladder
from benchmarks.meetings import Meeting, Two, meetings
from benchmarks.resampled import Units, resampled
from nathlon.arena.entrant import Entrant
from nathlon.arena.match import Match, Race, Seat
from nathlon.arena.pool import Pool
from nathlon.arena.store import Store
from nathlon.selection.battery.ranking import MARKS
from nathlon.selection.battery.skill import load_skills
from nathlon.selection.config import Config
from nathlon.selection.pareto import STANDARD
from nathlon.selection.round_robin import TournamentSettings
from nathlon.selection.run import Run
from nathlon.tournament.evidence import appearances, differences
from tests.support.race_results import duels, rows


def match(entrants: Sequence[str], races: int, test: str = "4v4") -> Match:
    """A match of so many races with seeds from 100 on."""
    seats = (Seat(0, 0), Seat(1, 1))
    return Match(
        "tournament",
        test,
        "race",
        "lindenring",
        "gt3",
        tuple(entrants),
        tuple(entrants),
        tuple(Race(100 + number, seats, number % 2 == 1) for number in range(races)),
    )


def entrant(name: str) -> Entrant:
    return Entrant(name, name, name, "none", "lindenring", "gt3", None, None)


def gaps(results: pl.DataFrame) -> list[float]:
    return differences(appearances(results))["difference"].to_list()


def test_units_are_taken_whole_and_renumbered() -> None:
    units = Units(duels({("a", "b"): [1.0, 2.0, 3.0]}), 2)
    taken = units.take(match(("a", "b"), 4), np.array([2, 0]))
    assert len(units) == 3
    assert gaps(taken) == [3.0, 1.0]
    assert taken["race"].to_list() == [0, 0, 1, 1, 2, 2, 3, 3]
    assert taken["seed"].unique().sort().to_list() == [100, 101, 102, 103]


def test_units_of_different_sizes_are_refused() -> None:
    results = duels({("a", "b"): [1.0, 2.0]})
    with pytest.raises(ValueError, match="expected one size"):
        Units(results.head(7), 2)


def test_sides_are_dealt_by_a_coin_for_each_pair() -> None:
    """Of pairs that one side always wins by 3, half go to either name, and never half a pair."""
    results = Units(duels({("x", "y"): [3.0] * 400}), 2).take(match(("a", "b"), 800), np.arange(400))
    found = gaps(dealt(results, ("a", "b"), np.random.default_rng(1)))
    assert set(found) == {3.0, -3.0}
    assert abs(sum(found)) < 3 * 3 * np.sqrt(400)


def test_the_truth_is_that_of_the_field() -> None:
    """With a over b by 2, b over c by 4, a over c by 6, scores are row means."""
    met = meetings(duels({("a", "b"): [1.0, 3.0], ("b", "c"): [4.0, 4.0], ("a", "c"): [5.0, 7.0]}))
    assert true_points(["a", "b", "c"], met) == pytest.approx(9 + np.array([8 / 3, 2 / 3, -10 / 3]))
    assert true_points(["b", "a"], met) == pytest.approx([8.0, 10.0])
    assert met[frozenset("ab")].deviation == pytest.approx(np.sqrt(2))


def test_only_matchups_without_a_difference_that_matters_are_nearly_equal() -> None:
    met = meetings(duels({("a", "b"): [-1.0, 2.0], ("b", "c"): [4.0, 5.0], ("a", "c"): [2.0, 2.0]}))
    assert nearly_equal(list(met.values()), 0.5) == [met[frozenset("ab")]]


def test_the_tally_counts_intervals_and_ranks() -> None:
    columns = {"entrant": ["a", "b", "c"], "truth": [2.0, 1.0, 1.0]}
    right = pl.DataFrame(columns | {"rank": [1, 1, 2], "low": [1.0, 0.0, 0.0], "high": [3.0, 1.0, 0.5]})
    wrong = pl.DataFrame(columns | {"rank": [2, 1, 3], "low": [2.5, 0.0, 0.0], "high": [3.0, 2.0, 2.0]})
    found = tally([right, wrong])
    assert (found["coverage"], found["false_accept"], found["best_kept"]) == (round(4 / 6, 4), 0.5, 0.5)
    assert found["runs"] == 2


@pytest.fixture
def run(tmp_path: Path) -> Iterator[Run]:
    with Pool(1) as pool, Store(tmp_path / "store.sqlite") as store:
        store.begin_run("none", {})
        yield Run(store, "none", (1,), pool, lambda stage, done, total: None)


def raced(lead: float, rng: np.random.Generator) -> dict[Two, Meeting]:
    """Pairs of two of whom one has a lead, in deviations of 4 points."""
    return meetings(duels({("a", "b"): (4 * (lead + rng.standard_normal(200))).tolist()}))


def test_equals_are_covered_and_share_the_first_rank(run: Run) -> None:
    """Though one of the two that raced is better: names are dealt."""
    met = list(raced(0.4, np.random.default_rng(3)).values())
    found = judged(run, of_equals(entrant("a"), met, 2), TournamentSettings(), range(30))
    assert found["coverage"] >= 0.85
    assert found["false_accept"] <= 0.1
    assert found["pool_sd"] == pytest.approx(4 * np.sqrt(1 + 0.4**2), rel=0.15)


def test_a_finalist_that_is_far_better_is_found_in_few_pairs(run: Run) -> None:
    kind = of_finalists([entrant("b"), entrant("a")], raced(3.0, np.random.default_rng(4)), 2)
    found = judged(run, kind, TournamentSettings(), range(10))
    assert (found["false_accept"], found["best_kept"]) == (0.0, 1.0)
    assert found["pairs_share"] < 0.75


def test_races_without_spread_end_with_a_sentence() -> None:
    """As where a checkpoint races itself, and the mirrored race is the first with the names swapped."""
    same = meetings(duels({("a", "b"): [0.0] * 8}))
    with pytest.raises(SystemExit, match=r"finalists: pool_sd is 0, expected races that differ"):
        need_spread("finalists", pool_sd(same.values()))
    need_spread("finalists", pool_sd(raced(0.0, np.random.default_rng(1)).values()))


def runs_of(name: str, laps: Sequence[float], contacts: int) -> pl.DataFrame:
    """Time trials with these laps and as many races with so many contacts each."""
    return pl.concat(
        rows(
            {
                "match": f"{name} {test}",
                "test": test,
                "entrant": name,
                "team": 0,
                "race": np.arange(len(laps)),
                "seed": np.arange(len(laps)),
                "best_lap_s": list(laps),
                "contacts": contacts,
            },
            len(laps),
        )
        for test in ("time_trial", "race")
    )


FIELD = pl.concat(
    [runs_of("fast", [90.0, 92.0], 3), runs_of("clean", [95.0, 93.0], 0), runs_of("worse", [93.0, 92.0], 4)]
)


def test_the_true_front_is_that_of_all_runs() -> None:
    """Slower and in more contacts than `fast`, `worse` is dominated, though not by each of its laps."""
    assert true_front(FIELD, STANDARD) == {"fast", "clean"}


def test_of_one_seed_everybody_gets_the_same_run() -> None:
    pool = RacedRuns(FIELD)

    def laps(seed: int, name: str) -> list[float]:
        return pool.draw(seed, match((name,), 30, "time_trial"))["best_lap_s"].to_list()

    assert set(laps(5, "fast")) == {90.0, 92.0}
    assert [{90.0: 95.0, 92.0: 93.0}[lap] for lap in laps(5, "fast")] == laps(5, "clean")
    assert laps(6, "fast") != laps(5, "fast")


def test_a_battery_has_the_runs_that_are_drawn() -> None:
    own = [("a", "t", run, None, "s", 10.0 * run) for run in range(3)]
    marks = pl.DataFrame([*own, *(("b", *rest) for _, *rest in own)], schema=MARKS, orient="row")
    battery = drawn(marks, {"t": np.array([2, 2, 0])}).sort("entrant", "run")
    assert battery["points"].to_list() == [20.0, 20.0, 0.0] * 2
    assert battery["run"].to_list() == [0, 1, 2] * 2


def test_tests_of_one_scenario_share_the_runs_drawn() -> None:
    tests = load_skills(["hot_lap", "consistency", "following"])
    chosen = by_scenario(tests, 64, np.random.default_rng(1))
    assert {name: len(numbers) for name, numbers in chosen.items()} == {
        "hot lap": 4,
        "consistency": 4,
        "following": 8,
    }
    assert chosen["hot lap"].tolist() == chosen["consistency"].tolist()


def test_fewer_fresh_pairs_are_the_first_of_more_whoever_else_races(run: Run) -> None:
    """So that benchmarks share what they race."""
    asked: list[Match] = []

    def draw(asked_for: Match) -> pl.DataFrame:
        asked.append(asked_for)
        return duels({("a", "b"): [0.0]})

    def seeds(entrants: Sequence[str], pairs: int) -> dict[Two, list[int]]:
        asked.clear()
        those = tuple(map(entrant, entrants))
        Ladder(resampled(run, 1, draw), Config(), those, those[0]).race(those, pairs)
        found: dict[Two, list[int]] = {}
        for one in asked:
            found.setdefault(frozenset(one.entrants), []).extend(race.seed for race in one.races)
        return found

    few, more = seeds("ab", 40), seeds("cba", 60)
    assert more[frozenset("ab")][:80] == few[frozenset("ab")]
    assert len(set(more[frozenset("ab")]) | set(more[frozenset("ac")])) == 120
