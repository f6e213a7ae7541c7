"""Ratings beside the points, and the notes on what does not fit."""

from __future__ import annotations

import choix
import numpy as np
import polars as pl
import pytest
from polars.testing import assert_frame_equal
from scipy.optimize import minimize

from arena.results import RATINGS, RESULTS, TOURNAMENT_NOTES
from tests.race_results import rows, tournament
from tournament.ratings import PRIOR, notes, rate

NAMES = {letter: letter.upper() for letter in "abcdefgh"}


def seeded() -> np.random.Generator:
    return np.random.default_rng(11)


def duels(differences: dict[tuple[str, str], list[float]]) -> pl.DataFrame:
    """1v1 matches with these point differences of their units; the better finishes first."""
    frames = []
    for (home, away), gaps in differences.items():
        gap = np.repeat(gaps, 4)
        side = np.arange(len(gap)) % 2
        frames.append(
            rows(
                {
                    "match": f"{home} v {away}",
                    "race": np.arange(len(gap)) // 2,
                    "mirrored": np.arange(len(gap)) // 2 % 2 == 1,
                    "team": side,
                    "entrant": np.where(side == 0, home, away),
                    "points": 9.0 + np.where(side == 0, gap, -gap) / 2,
                    "place": np.where((gap > 0) == (side == 0), 1, 2),
                },
                len(gap),
            )
        )
    return pl.concat(frames)


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
    np.testing.assert_allclose(ratings["bradley_terry"], best - best.mean(), atol=1e-3)
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
    assert len(found) == 2
    assert "does not explain" in found[0]


def test_equals_with_one_score_each_seldom_seem_not_to_fit() -> None:
    rng = seeded()
    noted = sum(notes(tournament(dict.fromkeys("abcd", 0.0), 4, rng), NAMES).height for _ in range(40))
    assert noted / 40 <= 0.1


def test_the_library_takes_repeated_items_as_cars_of_equal_strength() -> None:
    """Three races a a b, one b a a: the probability that b is last is in closed form."""
    strength = choix.ilsr_rankings(2, [(0, 0, 1)] * 3 + [(1, 0, 0)], alpha=0.0)
    s = np.exp(strength[0] - strength[1])

    def derivative(gap: float) -> float:
        def log_likelihood(g: float) -> float:
            a = np.exp(g)
            first = np.log(a / (2 * a + 1)) + np.log(a / (a + 1))
            return float(3 * first + np.log(1 / (2 * a + 1)))

        return (log_likelihood(gap + 1e-5) - log_likelihood(gap - 1e-5)) / 2e-5

    assert derivative(float(np.log(s))) == pytest.approx(0.0, abs=1e-4)
