"""Bradley and Terry's strengths against closed forms and the condition of the maximum."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.special import expit

from nathlon.tournament.bradley_terry import bradley_terry


def test_of_two_the_odds_are_those_of_their_wins() -> None:
    strength = bradley_terry(np.array([[0.0, 6.0], [2.0, 0.0]]))
    assert strength[0] - strength[1] == pytest.approx(np.log(3.0))
    assert strength.sum() == pytest.approx(0.0, abs=1e-12)


def test_of_three_in_a_row_the_odds_multiply() -> None:
    strength = bradley_terry(np.array([[0.0, 4.0, 0.0], [1.0, 0.0, 6.0], [0.0, 2.0, 0.0]]))
    assert strength[0] - strength[2] == pytest.approx(np.log(4.0 * 3.0))


def test_who_beat_each_other_in_a_circle_are_equal() -> None:
    circle = np.array([[0.0, 5.0, 1.0], [1.0, 0.0, 5.0], [5.0, 1.0, 0.0]])
    np.testing.assert_allclose(bradley_terry(circle), 0.0, atol=1e-12)


def test_a_thousand_wins_over_half_a_draw_are_finite() -> None:
    strength = bradley_terry(1000.0 * np.triu(np.ones((6, 6)), 1) + 0.25 * (1 - np.eye(6)))
    assert (np.diff(strength) < -1).all()
    assert np.isfinite(strength).all()


@given(
    st.integers(2, 9).flatmap(lambda n: arrays(np.float64, (n, n), elements=st.integers(0, 50).map(float)))
)
def test_everybody_has_won_as_often_as_expected(wins: np.ndarray) -> None:
    wins = (wins + 0.25) * (1 - np.eye(len(wins)))
    strength = bradley_terry(wins)
    expected = ((wins + wins.T) * expit(strength[:, None] - strength)).sum(axis=1)
    np.testing.assert_allclose(expected, wins.sum(axis=1), rtol=1e-8, atol=1e-8)
