"""Alignments: closed forms of straights, arcs and clothoids, and laps that close."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.special import fresnel

from nathlon.sim.track.alignment import (
    Clothoid,
    bend,
    close,
    displacement,
    length_of,
    sample,
    straight,
    turn_of,
)


def test_a_straight_an_arc_and_a_clothoid_end_where_their_closed_forms_say() -> None:
    np.testing.assert_allclose(displacement([straight(100.0)]), [100.0, 0.0], atol=1e-12)
    half_circle = Clothoid(np.pi * 40.0, 1.0 / 40.0, 1.0 / 40.0)
    np.testing.assert_allclose(displacement([half_circle]), [0.0, 80.0], atol=1e-12)
    # Curvature s / A^2: Fresnel's integrals of s / (A sqrt(pi)), scaled.
    length, radius = 60.0, 50.0
    scale = np.sqrt(np.pi * length * radius)
    sine, cosine = fresnel(length / scale)
    clothoid = Clothoid(length, 0.0, -1.0 / radius)
    np.testing.assert_allclose(displacement([clothoid]), [scale * cosine, -scale * sine], rtol=1e-12)


@given(st.floats(0.05, 3.2), st.floats(10.0, 500.0), st.floats(0.05, 1.0), st.sampled_from([1.0, -1.0]))
def test_a_bend_turns_as_far_as_asked_and_is_the_same_backwards(
    turn: float, radius: float, transition: float, side: float
) -> None:
    pieces = bend(side * turn, radius, transition)
    assert turn_of(pieces) == pytest.approx(side * turn)
    assert max(abs(piece.enter) for piece in pieces) == pytest.approx(1.0 / radius)
    assert all(before.leave == after.enter for before, after in pairwise(pieces))
    east, north = displacement(pieces)
    assert np.arctan2(north, east) == pytest.approx(side * turn / 2, abs=1e-9)


def test_points_along_pieces_follow_their_curvature() -> None:
    pieces = [straight(30.0), *bend(1.2, 40.0, 0.5), straight(20.0), *bend(-0.7, 90.0, 0.4)]
    distance = np.arange(0.0, length_of(pieces), 0.25)
    position, heading, curvature = sample(pieces, distance)
    steps = np.diff(position, axis=0)
    np.testing.assert_allclose(np.hypot(*steps.T), 0.25, rtol=1e-4)
    np.testing.assert_allclose(np.gradient(heading, 0.25)[1:-1], curvature[1:-1], atol=2e-4)
    middle = 0.5 * (heading[1:] + heading[:-1])
    np.testing.assert_allclose(np.arctan2(steps[:, 1], steps[:, 0]), middle, atol=1e-4)
    rest = displacement(pieces) - position[-1]
    assert np.hypot(*rest) == pytest.approx(length_of(pieces) - distance[-1], rel=1e-4)


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 1000))
def test_a_closed_lap_ends_where_it_began_with_no_straight_too_short(seed: int) -> None:
    rng = np.random.default_rng(seed)
    turns = rng.uniform(-0.5, 1.5, 8)
    turns += (2.0 * np.pi - turns.sum()) / 8
    bends = [bend(turn, 40.0, 0.5) for turn in turns]
    least = np.full(8, 20.0)
    straights = close(bends, np.full(8, 100.0), least, 2000.0)
    if straights is None:
        return
    assert (straights >= least).all()
    pieces = [
        piece for ahead, those in zip(straights, bends, strict=True) for piece in (straight(ahead), *those)
    ]
    np.testing.assert_allclose(displacement(pieces), 0.0, atol=1e-8)
    assert length_of(pieces) == pytest.approx(2000.0)


def test_a_square_closes_with_equal_sides_and_no_lap_closes_that_is_too_short() -> None:
    corners = [bend(np.pi / 2, 30.0, 0.5)] * 4
    bent = 4 * length_of(corners[0])
    straights = close(corners, np.array([50.0, 90.0, 70.0, 110.0]), np.full(4, 10.0), bent + 400.0)
    assert straights is not None
    assert straights[0] == pytest.approx(straights[2])
    assert straights[1] == pytest.approx(straights[3])
    assert straights.sum() == pytest.approx(400.0)
    assert close(corners, np.full(4, 50.0), np.full(4, 10.0), bent + 30.0) is None
