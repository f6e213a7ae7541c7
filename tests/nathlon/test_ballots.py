"""Ballots: preferences, Schulze's order, favour by Bradley and Terry, agreement."""

from __future__ import annotations

from itertools import pairwise, permutations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.stats import kendalltau

from nathlon.selection.committee.ballots import Ballot, Preferences, agreement, favour, order, support

ABCDE = "abcde"


def ranked(ranking: str, candidates: str = ABCDE) -> Preferences:
    return Ballot(tuple(candidates), tuple(ranking)).preferences(candidates)


def election(votes: dict[str, int], candidates: str = ABCDE) -> NDArray[np.int64]:
    cast = [ranked(ranking, candidates) for ranking, count in votes.items() for _ in range(count)]
    return support(cast, len(candidates))


ballots = st.lists(st.permutations(ABCDE).map("".join), min_size=1, max_size=7)
partial = st.lists(
    st.tuples(st.permutations(ABCDE).map("".join), st.integers(0, 5)).map(lambda b: b[0][: b[1]]),
    min_size=1,
    max_size=7,
)


def test_a_ballot_puts_approved_before_others_and_ranked_before_unranked() -> None:
    stated = Ballot(("b", "a", "c"), ("c", "b", "d")).preferences(ABCDE)
    sequence = ["c", "b", "a", "d", "e"]
    place = [sequence.index(candidate) for candidate in ABCDE]
    assert (stated == np.sign(np.subtract.outer(place, place).T)).all()
    assert Ballot(("a",), ("b",)).preferences("ab").tolist() == [[0, 1], [-1, 0]]
    assert not Ballot(tuple(ABCDE), ()).preferences(ABCDE).any()
    assert not Ballot((), ()).preferences(ABCDE).any()


def test_the_order_of_the_example_of_schulzes_paper() -> None:
    # Schulze 2011, section 3.1: E > A > C > B > D, though no one is preferred to each other one.
    votes = {
        "acbed": 5,
        "adecb": 5,
        "bedac": 8,
        "cabed": 3,
        "caebd": 7,
        "cbade": 2,
        "dceba": 7,
        "ebadc": 8,
    }
    assert [ABCDE[index] for index in order(election(votes))[0]] == list("eacbd")


@given(partial)
@settings(deadline=None)
def test_no_one_stands_after_whom_the_strongest_paths_beat(rankings: list[str]) -> None:
    votes = support([ranked(ranking) for ranking in rankings], 5)

    def strongest(first: int, last: int) -> int:
        others = [index for index in range(5) if index not in (first, last)]
        paths = [(first, *way, last) for size in range(4) for way in permutations(others, size)]
        links = [[votes[a, b] if votes[a, b] > votes[b, a] else 0 for a, b in pairwise(p)] for p in paths]
        return int(max(min(path) for path in links))

    places = order(votes)[0]
    assert sorted(places) == list(range(5))
    for place, first in enumerate(places):
        for second in places[place + 1 :]:
            assert strongest(first, second) >= strongest(second, first)


@given(ballots)
@settings(deadline=None)
def test_who_is_preferred_to_each_other_by_a_majority_is_first(rankings: list[str]) -> None:
    votes = support([ranked(ranking) for ranking in rankings], 5)
    beats = (votes > votes.T).sum(axis=1)
    if beats.max() == 4:
        assert order(votes)[0][0] == beats.argmax()


def test_ties_go_to_the_higher_favour_and_then_to_the_first() -> None:
    assert order(np.zeros((3, 3), np.int64))[0] == [0, 1, 2]
    # Nothing beats a or b, which are level, but b has won against c.
    votes = np.array([[0, 1, 1], [1, 0, 2], [1, 0, 0]])
    places, liked = order(votes)
    assert places == [1, 0, 2]
    assert liked[1] > liked[0] > liked[2]


@pytest.mark.parametrize(("wins", "losses"), [(0, 0), (1, 0), (3, 1), (0, 40), (500, 0)])
def test_favour_of_two_counts_one_draw_more(wins: int, losses: int) -> None:
    liked = favour(np.array([[0, wins], [losses, 0]]))
    expected = np.array([wins + 0.5, losses + 0.5]) / (wins + losses + 1)
    assert liked == pytest.approx(expected, abs=1e-6)


@given(partial)
@settings(deadline=None, max_examples=25)
def test_favour_is_the_most_likely_model(rankings: list[str]) -> None:
    """At the maximum of the likelihood each wins as often as the model expects."""
    votes = support([ranked(ranking) for ranking in rankings], 5) + 0.5 * (1 - np.eye(5))
    liked = favour(support([ranked(ranking) for ranking in rankings], 5))
    strength = np.ones(5)
    for _ in range(2000):
        games = (votes + votes.T) / (strength[:, None] + strength)
        strength = votes.sum(axis=1) / games.sum(axis=1)
    model = strength[:, None] / (strength[:, None] + strength)
    assert liked == pytest.approx((model.sum(axis=1) - 0.5) / 4, abs=1e-5)
    assert liked.mean() == pytest.approx(0.5, abs=1e-6)


def test_alone_there_is_nothing_to_prefer() -> None:
    assert order(np.zeros((1, 1), np.int64))[0] == [0]
    assert favour(np.zeros((1, 1), np.int64)).tolist() == [0.5]
    assert order(support([], 0))[0] == []


@given(st.permutations(ABCDE).map("".join), st.permutations(ABCDE).map("".join))
def test_agreement_of_two_rankings_is_kendalls_tau(first: str, second: str) -> None:
    tau = kendalltau([first.index(c) for c in ABCDE], [second.index(c) for c in ABCDE]).statistic
    assert agreement([ranked(first), ranked(second)]) == pytest.approx(tau)


def test_agreement_counts_only_questions_that_two_answer() -> None:
    assert agreement([ranked("abcde"), ranked("abcde"), ranked("abcde")]) == 1.0
    assert agreement([ranked("abcde"), ranked("edcba")]) == -1.0
    assert agreement([ranked("abcde")]) is None
    assert agreement([ranked("abcde"), ranked("")]) is None
    # Who ranks a alone has a before each other: alike with the first in four answers, contrary to the last.
    assert agreement([ranked("abcde"), ranked("a")]) == 1.0
    assert agreement([ranked("abcde"), ranked("a"), ranked("edcba")]) == pytest.approx((4 - 10 - 4) / 18)
