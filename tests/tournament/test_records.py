"""What entrants came to in the races that they took part in: closed forms, sitting out, shares, failures."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import permutations

import numpy as np
import polars as pl
import pytest

from nathlon.arena.results import RECORDS
from nathlon.tournament.points import rank
from nathlon.tournament.records import records
from tests.support.race_results import duels, rows

LADDER = (10.0, 8.0, 6.0)


def seeded() -> np.random.Generator:
    return np.random.default_rng(3)


def table(units: Sequence[Sequence[Sequence[str]]]) -> pl.DataFrame:
    """Races at a table of three seats, entrants in the order in which they came in, by unit."""
    races = [race for unit in units for race in unit]
    return rows(
        {
            "match": "m",
            "race": np.repeat(np.arange(len(races)), 3),
            "car": np.tile([0, 1, 2], len(races)),
            "entrant": [entrant for race in races for entrant in race],
            "place": np.tile([1, 2, 3], len(races)),
            "points": np.tile(LADDER, len(races)),
        },
        3 * len(races),
    )


def test_a_race_that_was_sat_out_does_not_count() -> None:
    """Six take turns at three seats: each plays half of the races, and the best wins all of its own."""
    unit = [sorted(three) for three in ("abc", "ade", "bdf", "cef", "abf", "cde")]
    results = table([unit] * 4)
    told = records(results, seeded())
    assert told.schema == RECORDS
    first = told.row(by_predicate=pl.col("entrant") == "a", named=True)
    assert (first["mean"], first["won"], first["drawn"], first["lost"]) == (10.0, 1.0, 0.0, 0.0)
    assert (first["mean_low"], first["mean_high"]) == (10.0, 10.0)
    last = told.row(by_predicate=pl.col("entrant") == "f", named=True)
    assert (last["mean"], last["won"], last["lost"]) == (6.0, 0.0, 1.0)
    middle = told.row(by_predicate=pl.col("entrant") == "c", named=True)
    assert middle["mean"] == pytest.approx((6 + 10 + 10) / 3)
    assert middle["won"] == pytest.approx(2 / 3)
    fitted = rank(results, seeded()).row(by_predicate=pl.col("entrant") == "a", named=True)
    assert fitted["points_per_race"] < 6, "the points of a ranking are shared out over all races"


def test_means_lie_within_what_a_game_gives() -> None:
    """Six that beat each other in order, by one point: the fitted points of the best lie above."""
    names = "abcdef"
    gaps = {(one, other): [2.0] * 4 for k, one in enumerate(names) for other in names[k + 1 :]}
    results = duels(gaps).with_columns(pl.col("points") - 9)
    told = records(results, seeded())
    assert told["mean"].to_list() == pytest.approx([1.0, 0.6, 0.2, -0.2, -0.6, -1.0])
    assert told["won"].to_list() == pytest.approx([1.0, 0.8, 0.6, 0.4, 0.2, 0.0])
    assert rank(results, seeded())["points_per_race"].to_numpy().max() > 1.5


def test_draws_are_told_from_wins_and_rounding_does_not_matter() -> None:
    results = duels({("a", "b"): [0.0, 0.0, 1.0, -1.0, 1e-15]})
    told = records(results, seeded())
    assert told["drawn"].to_list() == [pytest.approx(0.6)] * 2
    assert told["won"].to_list() == told["lost"].to_list() == [pytest.approx(0.2)] * 2


def test_who_has_failed_is_behind_whom_it_shares_points_with() -> None:
    results = duels({("a", "b"): [0.0, 0.0]}).with_columns(
        ending=pl.when(pl.col("entrant") == "b").then(pl.lit("policy_raised")).otherwise("ending")
    )
    told = records(results, seeded())
    assert told["won"].to_list() == [1.0, 0.0]
    assert told["lost"].to_list() == [0.0, 1.0]


def test_void_units_do_not_count_and_nobody_has_no_record() -> None:
    results = duels({("a", "b"): [2.0, 2.0, -2.0]})
    void = pl.when(pl.col("race") == 5).then(pl.lit("simulator_fault")).otherwise("ending")
    told = records(results.with_columns(ending=void), seeded())
    assert told["won"].to_list() == [1.0, 0.0]
    assert records(results.with_columns(ending=pl.lit("interrupted")), seeded()).is_empty()


def test_an_interval_covers_the_mean_of_whole_units() -> None:
    """The mean of a table of three, whose seats are drawn: 95 % of intervals cover it, give or take."""
    rng = np.random.default_rng(5)
    orders = np.array(list(permutations("abc")))
    covered = 0
    for _ in range(200):
        drawn = orders[rng.integers(len(orders), size=(8, 3))]
        told = records(table(drawn.tolist()), rng, resamples=200)
        covered += told["mean_low"][0] <= 8.0 <= told["mean_high"][0]
    assert covered / 200 == pytest.approx(0.95, abs=3 * np.sqrt(0.95 * 0.05 / 200))


def test_tests_count_by_their_weights() -> None:
    """Of two scenarios, with as many races or not, the mean is that of their means."""
    one = duels({("a", "b"): [2.0] * 8}).with_columns(test=pl.lit("long"))
    other = duels({("a", "b"): [-2.0] * 2}).with_columns(test=pl.lit("short"), match=pl.lit("other"))
    told = records(pl.concat([one, other]), seeded(), weights={"short": 3.0})
    assert told["mean"].to_list() == pytest.approx([9 - 0.5, 9 + 0.5])


def test_a_team_s_cars_count_together_and_cars_of_one_apart() -> None:
    """Points of a team of two are sums; who has two of three seats in a free-for-all has their mean."""
    teams = duels({("a", "b"): [2.0, 2.0]})
    pairs = pl.concat([teams, teams.with_columns(pl.col("car") + 2)])
    assert records(pairs, seeded())["mean"].to_list() == [20.0, 16.0]
    assert records(table([["aab", "baa"]]), seeded())["mean"].to_list() == [8.0, 8.0]
