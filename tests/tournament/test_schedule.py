"""The round robin: who meets whom, and with which seeds."""

from itertools import combinations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from nathlon.tournament.formats import FORMATS
from nathlon.tournament.schedule import meetings

TEAMS = FORMATS["4v4"]


def sequence(seed: int = 5) -> np.random.SeedSequence:
    return np.random.SeedSequence(seed)


@given(entrants=st.integers(0, 8), units=st.integers(1, 5))
def test_every_two_entrants_meet_once_with_fresh_seeds(entrants: int, units: int) -> None:
    names = [f"policy {index}" for index in range(entrants)]
    made = meetings(names, TEAMS, units, sequence())
    assert [meeting.entrants for meeting in made] == list(combinations(names, 2))
    seeds = [seed for meeting in made for seed in meeting.seeds]
    assert len(seeds) == len(set(seeds)) == units * entrants * (entrants - 1) // 2
    assert all(0 <= seed < 2**63 for seed in seeds)


def test_same_seed_sequence_gives_the_same_schedule_and_another_gives_other_seeds() -> None:
    names = ["a", "b", "c"]
    first = meetings(names, TEAMS, 2, sequence(1))
    assert first == meetings(names, TEAMS, 2, sequence(1))
    other = meetings(names, TEAMS, 2, sequence(2))
    assert not {seed for meeting in first for seed in meeting.seeds} & {
        seed for meeting in other for seed in meeting.seeds
    }


def test_a_longer_schedule_begins_as_the_shorter_one() -> None:
    """So that what was raced under a lower cap need not be raced again."""
    short, long = (meetings(["a", "b", "c"], TEAMS, units, sequence()) for units in (3, 11))
    assert [meeting.seeds for meeting in short] == [meeting.seeds[:3] for meeting in long]


def test_a_free_for_all_is_one_meeting_of_all() -> None:
    for names in ("ab", "abcdefgh", "abcdefghijkl"):
        [meeting] = meetings(tuple(names), FORMATS["ffa8"], 4, sequence())
        assert meeting.entrants == tuple(names)
        assert len(meeting.seeds) == 4
    assert meetings(("a",), FORMATS["ffa8"], 4, sequence()) == []


def test_in_a_gauntlet_newcomers_meet_the_references_only() -> None:
    made = meetings(["new", "old", "newer", "oldest"], FORMATS["gauntlet"], 3, sequence(), {"old", "oldest"})
    assert [meeting.entrants for meeting in made] == [
        ("new", "old"), ("new", "oldest"), ("old", "newer"), ("newer", "oldest")
    ]  # fmt: skip
    assert len({seed for meeting in made for seed in meeting.seeds}) == 12
    assert meetings(["a", "b"], FORMATS["gauntlet"], 3, sequence()) == []


def test_an_entrant_cannot_meet_itself() -> None:
    with pytest.raises(ValueError, match="twice"):
        meetings(["a", "b", "a"], TEAMS, 1, sequence())
    with pytest.raises(ValueError, match="at least 1"):
        meetings(["a", "b"], TEAMS, 0, sequence())
