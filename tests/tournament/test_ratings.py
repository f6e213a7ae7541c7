"""Ratings beside the points, and the notes on what does not fit."""

from __future__ import annotations

import numpy as np
import polars as pl
import pytest
from polars.testing import assert_frame_equal
from scipy.optimize import minimize

from nathlon.arena.results import RATINGS, RESULTS, TOURNAMENT_NOTES
from nathlon.tournament.ratings import PRIOR, notes, rate
from tests.support.race_results import duels, tournament

NAMES = {letter: letter.upper() for letter in "abcdefgh"}


def seeded() -> np.random.Generator:
    return np.random.default_rng(11)


def test_bradley_terry_is_the_maximum_of_its_likelihood() -> None:
    """Checked by a general optimizer; every two that met have half a drawn unit more."""
    results = duels({("a", "b"): [1, 1, 1, -2], ("b", "c"): [3, -1, 1], ("a", "c"): [0, 2]})
    wins = {(0, 1): 3.0, (1, 0): 1.0, (1, 2): 2.0, (2, 1): 1.0, (0, 2): 1.5, (2, 0): 0.5}

    def minus_log_likelihood(strength: np.ndarray) -> float:
        return sum(
            (count + PRIOR / 2) * np.log1p(np.exp(strength[loser] - strength[winner]))
            for (winner, loser), count in wins.items()
        )

    best = minimize(minus_log_likelihood, np.zeros(3)).x
    ratings = rate(results).sort("entrant")
    np.testing.assert_allclose(ratings["bradley_terry"], best - best.mean(), atol=1e-5)
    assert ratings["bradley_terry_rank"].to_list() == [1, 2, 3]


def test_plackett_luce_is_the_maximum_of_its_likelihood_with_many_cars_a_team() -> None:
    """Two teams of four, with the probability of every finishing order written out."""
    results = tournament({"a": 0.0, "b": 0.7}, 10, seeded())
    order = results.sort("race", "place")["entrant"].to_numpy().reshape(20, 8) == "b"

    def minus_log_likelihood(gap: np.ndarray) -> float:
        strength = np.where(order, np.exp(gap[0]), 1.0)
        left = np.cumsum(strength[:, ::-1], axis=1)[:, ::-1]
        return float(np.log(left / strength).sum())

    best = minimize(minus_log_likelihood, np.zeros(1)).x[0]
    ratings = dict(rate(results).select("entrant", "plackett_luce").iter_rows())
    assert ratings["b"] - ratings["a"] == pytest.approx(best, abs=0.01)
    assert best > 0.3


def two_tests(weight: float) -> tuple[pl.DataFrame, dict[str, float]]:
    """Four units that a wins and one of another race that b does, and how often that one counts."""
    home = duels({("a", "b"): [1.0] * 4})
    away = duels({("a", "b"): [-1.0]}).with_columns(match=pl.lit("away"), test=pl.lit("long"))
    return pl.concat([home, away]), {"long": weight}


def test_the_likelihood_of_a_unit_counts_as_often_as_its_race() -> None:
    """Of two entrants both strengths have closed forms; the weights are made 1 on average."""
    results, weights = two_tests(6.0)
    gaps = dict(
        rate(results, weights)
        .unpivot(index="entrant")
        .filter(pl.col("entrant") == "b")
        .drop("entrant")
        .iter_rows()
    )
    won, lost = 4 * 1 / 2, 6 / 2  # units by their weights, whose mean is 2
    assert 2 * gaps["bradley_terry"] == pytest.approx(
        np.log((lost + PRIOR / 2) / (won + PRIOR / 2)), abs=1e-4
    )
    assert 2 * gaps["plackett_luce"] == pytest.approx(np.log(lost / won), abs=0.01)
    assert rate(results)["entrant"].to_list() == ["a", "b"]
    assert rate(results, weights)["entrant"].to_list() == ["b", "a"]


def test_a_race_that_counts_twice_is_one_that_was_raced_twice() -> None:
    results, weights = two_tests(2.0)
    again = results.filter(pl.col("test") == "long").with_columns(match=pl.lit("again"))
    counted, raced = (
        table.sort("entrant") for table in (rate(results, weights), rate(pl.concat([results, again])))
    )
    # Six units instead of five: only the small priors weigh less.
    assert_frame_equal(counted, raced, abs_tol=0.05)


def test_only_the_proportion_of_weights_matters() -> None:
    results, weights = two_tests(2.0)
    assert_frame_equal(rate(results, weights), rate(results, {"long": 14.0, "round_robin": 7.0}))


def test_a_planted_order_is_recovered_and_does_not_depend_on_the_order_of_matches() -> None:
    results = tournament({"a": 0.0, "b": 0.5, "c": 1.0, "d": 1.5}, 30, seeded())
    ratings = rate(results)
    assert ratings.schema == RATINGS
    assert ratings["entrant"].to_list() == ["d", "c", "b", "a"]
    assert ratings["bradley_terry_rank"].to_list() == ratings["plackett_luce_rank"].to_list() == [1, 2, 3, 4]
    assert_frame_equal(ratings, rate(results.sample(fraction=1.0, shuffle=True, seed=3)))


def test_who_won_everything_is_rated_finitely() -> None:
    ratings = rate(duels({("a", "b"): [1.0] * 30}))
    assert ratings.select(pl.col("bradley_terry", "plackett_luce").is_finite().all()).row(0) == (True, True)
    assert ratings["entrant"].to_list() == ["a", "b"]


def test_without_units_there_are_neither_ratings_nor_notes() -> None:
    assert rate(pl.DataFrame(schema=RESULTS)).equals(pl.DataFrame(schema=RATINGS))
    assert notes(pl.DataFrame(schema=RESULTS), {}).equals(pl.DataFrame(schema=TOURNAMENT_NOTES))


def test_races_that_fit_leave_no_note() -> None:
    results = tournament({"a": 0.0, "b": 0.5, "c": 1.0, "d": 1.5}, 12, seeded())
    assert notes(results, NAMES).is_empty()


def test_a_rating_that_contradicts_the_points_is_noted() -> None:
    """b wins two units of three narrowly and loses the third by far."""
    noise = np.tile([0.0, 0.1, -0.1], 20)
    results = duels({("a", "b"): list(np.tile([-1.0, -1.0, 9.0], 20) + noise)})
    [first, second] = notes(results, NAMES)["note"]
    assert first == "Bradley–Terry rates B above A, though A scores more points beyond doubt."
    assert second == "Plackett–Luce rates B above A, though A scores more points beyond doubt."


def test_a_cycle_and_the_lack_of_fit_are_noted() -> None:
    noise = np.tile([-1.0, 1.0, 0.5, -0.5], 3)
    gaps = {("a", "b"): noise + 3, ("b", "c"): noise + 3, ("a", "c"): noise - 3}
    found = notes(duels({two: list(gap) for two, gap in gaps.items()}), NAMES)["note"].to_list()
    assert "A beats B, B beats C, and C beats A." in found
    assert len(found) == 3
    assert "does not explain" in found[0]
    assert (
        found[2] == "Nobody scores more points against a mixture of A 33 %, B 33 %, C 33 % (Nash averaging)."
    )


def test_equals_with_one_score_each_seldom_seem_not_to_fit() -> None:
    rng = seeded()
    noted = sum(notes(tournament(dict.fromkeys("abcd", 0.0), 4, rng), NAMES).height for _ in range(40))
    assert noted / 40 <= 0.1
