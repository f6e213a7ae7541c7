"""When to stop: the sequential test against published figures, its error rates, and intervals afterwards."""

from __future__ import annotations

from math import log

import numpy as np
import polars as pl
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.special import ndtri

from nathlon.tournament.stopping import (
    DIFFERENT,
    FEWEST,
    OPEN,
    Stopping,
    _all_within,
    _followed,
    log_likelihood_ratio,
    repeated,
    settled,
    settled_in_gauntlet,
    wald_bounds,
)
from tests.support.race_results import rows, tournament

STOPPING = Stopping(effect=0.5, drop=3.3)
NELO = 800 / log(10)  # normalized Elo in a t of games; a pair has sqrt(2) times the t


@pytest.mark.parametrize(
    ("nelo", "pairs", "published"),
    [
        # Pull requests 6019 and 4194 of Stockfish: hypotheses, pairs by points 0, 1/2 .. 2, and the LLR.
        ((0.0, 2.0), (320, 12431, 27275, 12858, 316), 2.95),
        ((0.5, 2.5), (197, 45541, 117722, 46579, 228), 2.96),
        ((0.0, 2.0), (371, 10263, 24989, 10642, 379), 2.95),
        ((0.5, 2.5), (47, 8181, 25234, 8575, 47), 2.94),
    ],
)
def test_it_repeats_published_ratios(
    nelo: tuple[float, float], pairs: tuple[int, ...], published: float
) -> None:
    counts, scores = np.array(pairs), np.linspace(0.0, 1.0, 5)
    mean = counts @ scores / counts.sum()
    deviation = np.sqrt(counts @ (scores - mean) ** 2 / counts.sum())
    t0, t1 = (np.sqrt(2) * bound / NELO for bound in nelo)
    ratio = log_likelihood_ratio(counts.sum(), (mean - 0.5) / deviation, t0, t1)
    assert ratio == pytest.approx(published, abs=0.011)


def test_the_ratio_is_that_of_normal_likelihoods_with_a_free_variance() -> None:
    x = np.array([3.0, -1.0, 4.0, 1.0, 5.0])
    mean, deviation = x.mean(), x.std()

    def log_likelihood(t: float) -> float:
        squares = ((x - t * deviation) ** 2).mean()
        return -len(x) / 2 * (np.log(2 * np.pi * squares) + 1)

    expected = log_likelihood(0.8) - log_likelihood(0.1)
    ratio = log_likelihood_ratio(5.0, mean / deviation, 0.1, 0.8)
    assert ratio == pytest.approx(expected)


@given(st.floats(0.0, 3.0), st.floats(0.01, 2.0), st.integers(1, 500))
def test_the_ratio_changes_sides_between_the_hypotheses(t0: float, step: float, units: int) -> None:
    t1, n = t0 + step, float(units)
    assert log_likelihood_ratio(n, t0 + step / 2, t0, t1) == pytest.approx(0.0, abs=1e-9 * units)
    for_t1 = log_likelihood_ratio(n, t1, t0, t1)
    assert for_t1 > 0
    assert log_likelihood_ratio(n, t0, t0, t1) == pytest.approx(-for_t1)


def test_the_bounds_are_walds() -> None:
    """Those that Stockfish's tests print: (-2.94, 2.94)."""
    assert wald_bounds(0.05, 0.05) == pytest.approx((-2.944, 2.944), abs=0.001)
    assert Stopping(0.5, 3.3, alpha=0.20, beta=0.05).bounds == wald_bounds(0.05, 0.05)


def test_a_clear_winner_needs_no_more_races_and_equals_race_on() -> None:
    results = tournament({"a": 0.0, "b": 0.0, "c": 1.5}, 8, np.random.default_rng(3))
    never_behind = Stopping(effect=0.5, drop=1e9)
    assert settled(results, never_behind, {}) == {frozenset("ac"), frozenset("bc")}


def test_equals_are_settled_in_the_end() -> None:
    results = tournament({"a": 0.0, "b": 0.0}, 100, np.random.default_rng(8))
    assert settled(results.filter(pl.col("race") < 16), STOPPING, {}) == set()
    assert settled(results, STOPPING, {}) == {frozenset("ab")}


def test_nothing_is_decided_by_void_units_or_fewer_than_four() -> None:
    assert settled(sweep(3), STOPPING, {}) == set()
    assert settled(sweep(4), STOPPING, {}) == {frozenset("ab")}
    assert settled(sweep(4).with_columns(ending=pl.lit("simulator_fault")), STOPPING, {}) == set()


def sweep(pairs: int) -> pl.DataFrame:
    height = 4 * pairs
    side = np.arange(height) % 2
    return rows(
        {
            "race": np.arange(height) // 2,
            "mirrored": np.arange(height) // 2 % 2 == 1,
            "team": side,
            "entrant": np.where(side == 0, "a", "b"),
            "points": np.where(side == 0, 29.0, 10.0),
        },
        height,
    )


def test_an_entrant_far_behind_the_leader_races_no_more_against_anybody() -> None:
    rng = np.random.default_rng(5)
    results = tournament({"a": 0.0, "b": 0.0, "c": 0.0, "z": -4.0}, 4, rng)
    never = Stopping(effect=0.5, drop=3.3, alpha=1e-12)
    assert settled(results, never, {}) == {frozenset((other, "z")) for other in "abc"}


def gauntlet(pace: dict[str, float], references: str, pairs: int) -> pl.DataFrame:
    """A tournament without the races between two newcomers or two references."""
    results = tournament(pace, pairs, np.random.default_rng(4))
    one = pl.col("match").str.slice(0, 1).is_in(list(references))
    other = pl.col("match").str.slice(-1).is_in(list(references))
    return results.filter(one != other)


def test_in_a_gauntlet_newcomers_are_compared_through_the_references() -> None:
    """Both newcomers beat the reference; which of them is better is another question."""
    never_behind = Stopping(effect=0.5, drop=1e9)
    alike = gauntlet({"a": 1.5, "b": 1.5, "r": 0.0}, "r", 8)
    assert settled(alike, never_behind, {}) == {frozenset("ar"), frozenset("br")}
    assert settled_in_gauntlet(alike, never_behind, {}, "r") == set()
    told = gauntlet({"a": 2.5, "b": 0.0, "r": 0.0}, "r", 12)
    assert settled_in_gauntlet(told, never_behind, {}, "r") == {frozenset("ar"), frozenset("br")}


def test_in_a_gauntlet_a_better_reference_drops_nobody() -> None:
    results = gauntlet({"a": 0.0, "b": 0.0, "z": -3.0, "r": 1.0}, "r", 12)
    never = Stopping(effect=0.5, drop=3.3, alpha=1e-12)
    assert settled(results, never, {}) >= {frozenset("ar"), frozenset("br"), frozenset("zr")}
    assert settled_in_gauntlet(results, never, {}, "r") == {frozenset("zr")}


def test_one_newcomer_alone_is_compared_with_the_references() -> None:
    results = gauntlet({"a": 0.0, "r": 0.0, "s": 3.0}, "rs", 8)
    never_behind = Stopping(effect=0.5, drop=1e9)
    assert settled_in_gauntlet(results, never_behind, {}, "rs") == {frozenset("as")}


def test_equals_are_seldom_told_apart_and_differing_ones_mostly() -> None:
    """Errors of the test of two entrants after every four units up to 100, on normal differences."""
    rng = np.random.default_rng(6)
    for t, told in ((0.0, (0.0, 0.05)), (0.5, (0.95, 1.0)), (2.0, (1.0, 1.0))):
        share = np.mean([_told_apart(t + rng.standard_normal(100)) for _ in range(1000)])
        assert told[0] <= share <= told[1]


def _told_apart(x: np.ndarray) -> bool:
    for n in range(4, len(x) + 1, 4):
        t = np.array(abs(x[:n].mean()) / x[:n].std(ddof=1))
        verdict = STOPPING.verdict(np.array(float(n)), t)
        if verdict != OPEN:
            return bool(verdict == DIFFERENT)
    return False


def test_the_more_they_differ_the_sooner_it_is_said() -> None:
    """Against one mean alone the ratio would fall again for means far above it."""
    t = np.array([0.5, 1.0, 2.0, 4.0, 50.0])
    fewest = [
        next(n for n in range(1, 999) if STOPPING.verdict(np.array(float(n)), one) == DIFFERENT) for one in t
    ]
    assert fewest == sorted(fewest, reverse=True)
    assert fewest[-1] == FEWEST


def test_many_looks_are_what_following_them_all_gives() -> None:
    """Nights are looks: there may be thousands."""
    for bound in (2.6, 3.2):
        kept = _followed(bound, 600)
        found = [_all_within(bound, looks) for looks in (100, 128, 129, 300, 600)]
        np.testing.assert_allclose(found, kept[[99, 127, 128, 299, 599]], atol=5e-5)
    confidences = [repeated(0.95, looks) for looks in (1, 10, 100, 1000, 1500, 5000)]
    assert confidences == sorted(confidences)
    assert ndtri((1 + confidences[3]) / 2) == pytest.approx(3.063, abs=0.002)


def test_repeated_intervals_have_pococks_bounds() -> None:
    """Pocock (1977), table 1: two-sided 5 %."""
    bounds = {looks: ndtri((1 + repeated(0.95, looks)) / 2) for looks in (1, 2, 3, 4, 5, 10)}
    published = {1: 1.960, 2: 2.178, 3: 2.289, 4: 2.361, 5: 2.413, 10: 2.555}
    assert bounds == pytest.approx(published, abs=0.001)


@pytest.mark.parametrize("confidence", [0.2, 0.6])
def test_one_look_has_the_confidence_that_is_asked_for(confidence: float) -> None:
    """A gate may be as bold as alpha 0.4."""
    assert repeated(confidence, 1) == pytest.approx(confidence)
    assert repeated(confidence, 24) > confidence
