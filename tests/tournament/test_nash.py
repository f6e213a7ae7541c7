"""Nash averaging against games with known equilibria."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from nathlon.tournament.nash import nash_weights


def game(*beats: tuple[int, int, float], count: int = 3) -> np.ndarray:
    payoff = np.zeros((count, count))
    for winner, loser, margin in beats:
        payoff[winner, loser], payoff[loser, winner] = margin, -margin
    return payoff


@settings(deadline=None, max_examples=40)
@given(st.tuples(*[st.floats(0.2, 5.0)] * 3))
def test_a_cycle_of_three_has_its_closed_form(margins: tuple[float, float, float]) -> None:
    """By how much each beats each weighs the third: p of rock is the margin of the other two."""
    x, y, z = margins
    weights = nash_weights(game((0, 1, x), (1, 2, y), (2, 0, z)))
    assert weights == pytest.approx(np.array([y, z, x]) / (x + y + z), abs=1e-3)


def test_copies_share_the_weight_of_one() -> None:
    """Rock twice, paper, scissors: of all equilibria the one of most entropy."""
    payoff = game((2, 0, 1.0), (2, 1, 1.0), (0, 3, 1.0), (1, 3, 1.0), (3, 2, 1.0), count=4)
    assert nash_weights(payoff) == pytest.approx([1 / 6, 1 / 6, 1 / 3, 1 / 3], abs=1e-3)


def test_who_beats_all_has_all_the_weight_and_equals_share_it() -> None:
    assert nash_weights(game((0, 1, 1.0), (0, 2, 2.0), (1, 2, 1.0))) == pytest.approx([1.0, 0.0, 0.0])
    assert nash_weights(np.zeros((4, 4))) == pytest.approx([0.25] * 4, abs=1e-3)


@settings(deadline=None, max_examples=40)
@given(st.integers(2, 9), st.integers(0, 1000))
def test_nobody_scores_more_against_the_mixture(count: int, seed: int) -> None:
    half = np.random.default_rng(seed).normal(size=(count, count))
    payoff = half - half.T
    weights = nash_weights(payoff)
    assert weights.sum() == pytest.approx(1.0)
    assert (payoff @ weights).max() <= 0.06 * np.abs(payoff).max()


def test_what_is_no_game_of_two_is_refused() -> None:
    with pytest.raises(ValueError, match="antisymmetric"):
        nash_weights(np.ones((2, 2)))
