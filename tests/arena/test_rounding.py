"""Numbers that are equal within rounding are equal: wherever points are compared."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import polars as pl
import pytest
from hypothesis import given
from hypothesis import strategies as st

from nathlon.arena.rounding import differing, levelled
from nathlon.arena.world import Outcome
from nathlon.arena.worlds.episodes import place_points, placed
from nathlon.arena.worlds.rehearsal import fairness
from nathlon.selection.battery.ranking import MARKS, rank_battery
from nathlon.selection.pareto import pareto
from nathlon.selection.pareto.objective import Objective, measure, own_runs
from nathlon.tournament.evidence import Evidence
from nathlon.tournament.points import EQUAL, better, matchups, rank
from nathlon.tournament.ratings import notes, rate
from nathlon.tournament.stopping import Stopping, settled
from tests.support.race_results import rows


def game(strengths: dict[str, float], units: int = 4) -> pl.DataFrame:
    """A round robin of a game without chance: who plays alike always comes to the same."""
    frames, base = [], max(strengths.values())
    for home, away in combinations(strengths, 2):
        gap = strengths[home] - strengths[away]
        race, car = np.repeat(np.arange(2 * units), 2), np.tile([0, 1], 2 * units)
        side = (race + car) % 2
        frames.append(
            rows(
                {
                    "match": f"{home} v {away}",
                    "race": race,
                    "mirrored": race % 2 == 1,
                    "car": car,
                    "team": side,
                    "entrant": np.where(side == 0, home, away),
                    "points": np.where(side == 0, base + gap, base - gap),
                    "place": 1 if abs(gap) < 1e-9 * base else np.where((gap > 0) == (side == 0), 1, 2),
                },
                4 * units,
            )
        )
    return pl.concat(frames)


@pytest.mark.parametrize("scale", [1.0, 1e6, 1 / 3])
@pytest.mark.parametrize("alike", [2, 3])
def test_who_plays_alike_shares_rank_points_and_ratings(alike: int, scale: float) -> None:
    same = {f"rock{number}": scale * (0.1 + 0.2 if number else 0.3) for number in range(alike)}
    strengths = same | {"paper": 0.7 * scale, "lizard": 0.1 * scale, "spock": scale / 7}
    results = game(strengths)
    ranking = rank(results, np.random.default_rng(1)).filter(pl.col("entrant").is_in(list(same)))
    assert ranking["rank"].to_list() == [2] * alike
    assert ranking["points_per_race"].n_unique() == 1
    assert ranking["entrant"].to_list() == sorted(same), "whose points are equal stand by their ids"
    evidence = Evidence(results, EQUAL)
    ours = [evidence.entrants.index(name) for name in same]
    assert not better(evidence, 0.05)[np.ix_(ours, ours)].any()
    ratings = rate(results).filter(pl.col("entrant").is_in(list(same)))
    assert ratings["bradley_terry_rank"].n_unique() == ratings["plackett_luce_rank"].n_unique() == 1
    among = pl.all_horizontal(pl.col("entrant", "opponent").is_in(list(same)))
    met = matchups(results, np.random.default_rng(1)).filter(among)
    for bound in ("difference", "difference_low", "difference_high"):
        assert met[bound].to_list() == [0.0] * met.height


def test_differences_that_are_real_stay() -> None:
    ranking = rank(game({"a": 1.0, "b": 1.0 + 1e-9, "c": 0.0}), np.random.default_rng(1))
    assert ranking.select("entrant", "rank").rows() == [("b", 1), ("a", 2), ("c", 3)]


def test_equal_policies_race_on_and_nothing_is_noted() -> None:
    results = game({"a": 3e7, "b": 1e8 * (0.1 + 0.2), "c": 3e7, "d": 1e8 / 7})
    open_ = {frozenset(two) for two in combinations("abc", 2)}
    assert not settled(results, Stopping(0.5, 3.3), EQUAL) & open_
    names = {name: name for name in "abcd"}
    assert notes(results, names).is_empty()


def test_the_battery_ties_sums_that_are_equal() -> None:
    tests = {"a": (0.1, 0.2, 0.3), "b": (0.3, 0.2, 0.1), "c": (0.1, 0.2, 0.1)}
    table = [
        (entrant, f"test {test}", run, 1.0, "s", value)
        for entrant, values in tests.items()
        for test, value in enumerate(values)
        for run in range(3)
    ]
    ranking = rank_battery(pl.DataFrame(table, schema=MARKS, orient="row"), np.random.default_rng(1))
    assert ranking.select("entrant", "rank").rows() == [("a", 1), ("b", 1), ("c", 3)]
    assert ranking["points"].to_list()[0] == ranking["points"].to_list()[1]


def test_equal_objectives_do_not_dominate_each_other() -> None:
    scores = {"a": [0.1 + 0.2, 0.5], "b": [0.3, 0.5], "c": [0.1, 0.5]}
    plain = {"test": "race", "race": [0, 1], "seed": [1, 2], "team": 0}
    frames = [
        rows({**plain, "match": name, "entrant": name, "score": values}, 2) for name, values in scores.items()
    ]
    objective = Objective(name="score", measure="score", source="race", goal="max")
    measured = measure(own_runs(pl.concat(frames)), objective)
    assert measured.cost[0] == measured.cost[1] < measured.cost[2]
    assert measured.runs[0] == measured.runs[2]
    alone = [frame.head(1) for frame in frames]
    table = pareto(pl.concat(alone), [objective], np.random.default_rng(1))
    assert table["survives"].to_list() == [True, True, False]


def test_scores_that_are_equal_share_a_place() -> None:
    outcomes = [Outcome(score) for score in (0.1 + 0.2, 0.3, -0.1, 5e-17, 0.0)]
    places = placed(outcomes, [False] * 5)
    assert places == [1, 1, 5, 3, 3]
    assert place_points(places)[:2] == [9.0, 9.0]
    assert placed([Outcome(1e9), Outcome(1e9 + 1.0)], [False, False]) == [2, 1]


def test_fairness_sees_no_difference_in_rounding() -> None:
    points = np.tile([0.1 + 0.2, 0.3], (6, 1))
    assert "fairness does not show" in fairness(points)[0]


@given(st.lists(st.floats(-1e9, 1e9), max_size=30), st.randoms())
def test_what_is_level_is_equal_and_in_order(values: list[float], random: object) -> None:
    found = levelled(np.array(values))
    order = np.argsort(values, kind="stable")
    assert (np.diff(found[order]) >= 0).all()
    size = np.maximum(np.abs(values), 1.0)
    assert (np.abs(found - values) <= len(values) * 1e-12 * size).all()
    gaps = found[:, None] - found[None, :]
    assert ((differing(gaps, np.maximum(size[:, None], size[None, :])) == 0) == (gaps == 0)).all()


def test_what_is_no_number_stays_what_it_is() -> None:
    found = levelled(np.array([np.nan, 1.0, np.inf, -np.inf, 1.0 + 1e-15]))
    assert np.isnan(found[0])
    assert found[1:].tolist() == [1.0, np.inf, -np.inf, 1.0]
