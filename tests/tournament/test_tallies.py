"""What is kept of tournaments ranks their entrants as all their races would."""

from __future__ import annotations

import numpy as np
import polars as pl
import pytest
from polars.testing import assert_frame_equal

from nathlon.arena.results import POOL_CELLS, POOL_TOTALS
from nathlon.tournament.evidence import Evidence
from nathlon.tournament.points import EQUAL, rank
from nathlon.tournament.tallies import Tallied, Tally, rank_tally
from tests.support.race_results import duels, tournament
from tests.tournament.test_free_for_all import free_for_all

EXACT = ["entrant", "rank", "points_per_race", "barred", "pairs", "races", "faults"]
RATES = ["contacts_per_km", "at_fault_per_km"]


def seeded() -> np.random.Generator:
    return np.random.default_rng(5)


def named(results: pl.DataFrame, night: str) -> pl.DataFrame:
    """As of one of several nights: no two share a match."""
    return results.with_columns(pl.col("match") + f" on {night}")


def nights() -> list[pl.DataFrame]:
    """Three newcomers a night against an anchor and, from the second on, the best so far."""
    rng, pace = seeded(), {"anchor": 0.0}
    found = []
    for number in range(4):
        field = {"anchor": 0.0} | {f"n{number}{letter}": 0.4 * i - 0.2 for i, letter in enumerate("xyz")}
        best = max(pace, key=pace.__getitem__)
        found.append(named(tournament(field | {best: pace[best]}, 3 + number, rng), str(number)))
        pace |= field
    faulty = pl.when(pl.col("race") == 0, pl.col("car") == 0).then(pl.lit("timed_out")).otherwise("ending")
    void = pl.when(pl.col("race") == 3, pl.col("car") == 1).then(pl.lit("interrupted")).otherwise("ending")
    return [found[0].with_columns(ending=faulty), found[1].with_columns(ending=void), *found[2:]]


def blocks() -> list[pl.DataFrame]:
    """Free-for-alls of five, then of some of them with others, and a duel."""
    rng = seeded()
    five = free_for_all(dict(zip("abcde", (0.0, 0.2, 0.4, 0.6, 1.5), strict=True)), 6, rng)
    again = free_for_all(dict(zip("abcde", (0.0, 0.2, 0.4, 0.6, 1.5), strict=True)), 4, rng)
    four = free_for_all(dict(zip("aefg", (0.0, 1.5, 0.1, 1.2), strict=True)), 5, rng)
    return [
        named(five, "1"),
        named(again, "2"),
        named(four, "3"),
        named(duels({("a", "g"): [1, -2, 3, -4]}), "4"),
    ]


def alike() -> list[pl.DataFrame]:
    """Units that do not vary: too few to believe in one matchup, enough in another."""
    few = {("a", "b"): [2.0, 2.0], ("a", "c"): [1.0, 3.0, 5.0], ("b", "c"): [0.5] * 5, ("c", "d"): [41.0]}
    more = {("a", "b"): [2.0], ("c", "d"): [40.0, 42.0, 41.0]}
    return [named(duels(few), "1"), named(duels(more), "2")]


@pytest.mark.parametrize("raced", [nights(), blocks(), alike()], ids=["nights", "blocks", "alike"])
def test_a_tally_ranks_as_all_races_do(raced: list[pl.DataFrame]) -> None:
    expected = rank(pl.concat(raced), seeded(), resamples=4000)
    tally = Tally()
    for results in raced:
        tally = Tally.together([tally, Tally.of(results)])
    found = rank_tally(tally)
    assert_frame_equal(found[EXACT], expected[EXACT])
    assert_frame_equal(found[RATES], expected[RATES])
    assert found["rank"].n_unique() > 1
    half = (expected["points_high"] - expected["points_low"]).to_numpy() / 2
    for bound in ("points_low", "points_high"):
        gap = np.abs((found[bound] - expected[bound]).to_numpy().astype(float))
        assert np.all((gap < 0.25 * half) | np.isnan(half))


@pytest.mark.parametrize("raced", [nights(), blocks(), alike()], ids=["nights", "blocks", "alike"])
def test_standard_errors_are_those_of_the_units(raced: list[pl.DataFrame]) -> None:
    evidence = Evidence(pl.concat(raced), EQUAL)
    tallied = Tallied(Tally.of(pl.concat(raced)).cells)
    np.testing.assert_allclose(tallied.means, evidence.means, atol=1e-12)
    two = evidence.every_two()
    contrasts = evidence.solution[two[:, 0]] - evidence.solution[two[:, 1]]
    for found, expected in zip(tallied.errors(contrasts), evidence.errors(contrasts), strict=True):
        np.testing.assert_allclose(found, expected, rtol=1e-9)
    assert tallied.mean_points == pytest.approx(evidence.mean_points)


def test_the_order_of_nights_does_not_matter() -> None:
    tallies = [Tally.of(results) for results in nights()]
    forth, back = Tally.together(tallies), Tally.together(tallies[::-1])
    assert_frame_equal(forth.cells, back.cells)
    assert_frame_equal(forth.totals, back.totals)
    at_once = Tally.of(pl.concat(nights()))
    assert_frame_equal(forth.cells, at_once.cells)
    assert_frame_equal(forth.totals, at_once.totals)


def test_those_that_are_left_out_take_their_matchups_with_them() -> None:
    results = pl.concat(nights())
    kept = ["anchor", "n0z", "n1z", "n2z"]
    tally = Tally.of(results).among(kept)
    assert set(tally.cells["entrant"]) | set(tally.cells["opponent"]) == set(kept)
    met = results.filter(pl.col("entrant").is_in(kept).all().over("match"))
    expected = rank(met, seeded()).select("entrant", "rank", "points_per_race")
    assert_frame_equal(rank_tally(tally).select("entrant", "rank", "points_per_race"), expected)


def test_nothing_raced_is_an_empty_pool() -> None:
    tally = Tally.together([Tally(), Tally()])
    assert (tally.cells.schema, tally.totals.schema) == (POOL_CELLS, POOL_TOTALS)
    assert rank_tally(tally).is_empty()


def test_who_has_only_void_races_is_in_the_pool_without_rank() -> None:
    results = tournament({"a": 0.0, "b": 1.0}, 4, seeded()).with_columns(ending=pl.lit("interrupted"))
    found = rank_tally(Tally.of(results))
    assert found.select("rank", "points_per_race", "contacts_per_km").null_count().row(0) == (2, 2, 2)
    assert found["pairs"].to_list() == [0, 0]
