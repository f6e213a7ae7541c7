"""The round robin: who meets whom, with which seeds, from which places."""

from itertools import combinations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tournament.schedule import MIRRORED_GRIDS, round_robin


@given(entrants=st.integers(0, 8), pairs=st.integers(1, 5))
def test_every_two_entrants_meet_equally_often_with_fresh_seeds(entrants: int, pairs: int) -> None:
    names = [f"policy {index}" for index in range(entrants)]
    pairings = round_robin(names, pairs, np.random.SeedSequence(5))
    meetings = [frozenset((pairing.entrant, pairing.opponent)) for pairing in pairings]
    for matchup in combinations(names, 2):
        assert meetings.count(frozenset(matchup)) == pairs
    assert len(meetings) == pairs * entrants * (entrants - 1) // 2
    assert len({pairing.seed for pairing in pairings}) == len(pairings)
    assert all(0 <= pairing.seed < 2**63 for pairing in pairings)


def test_same_seed_sequence_gives_the_same_schedule_and_another_gives_other_seeds() -> None:
    names = ["a", "b", "c"]
    first = round_robin(names, 2, np.random.SeedSequence(1))
    assert first == round_robin(names, 2, np.random.SeedSequence(1))
    other = round_robin(names, 2, np.random.SeedSequence(2))
    assert not {pairing.seed for pairing in first} & {pairing.seed for pairing in other}


def test_the_mirror_swaps_odd_and_even_places() -> None:
    first, second = MIRRORED_GRIDS
    assert first.slots == ((1, 3, 5, 7), (2, 4, 6, 8))
    assert second.slots == first.slots[::-1]
    assert (first.mirrored, second.mirrored) == (False, True)


def test_an_entrant_cannot_meet_itself() -> None:
    with pytest.raises(ValueError, match="twice"):
        round_robin(["a", "b", "a"], 1, np.random.SeedSequence(0))
    with pytest.raises(ValueError, match="at least 1"):
        round_robin(["a", "b"], 0, np.random.SeedSequence(0))
