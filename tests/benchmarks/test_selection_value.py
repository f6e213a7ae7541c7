"""What selecting is worth, against answers that are known."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.selection_value.budget import dealt, enough, expected_lead, fitted
from benchmarks.selection_value.head_to_head import head_to_head
from nathlon.tournament.evidence import Evidence
from tests.support.race_results import duels

WORST_FIRST = {(0, 1): np.full(8, -2.0), (0, 2): np.full(8, -6.0), (1, 2): np.full(8, -4.0)}
"""Pairs without luck: the third beats the first by 6 and the second by 4, so the field by 10 / 3."""


def test_without_luck_a_pair_of_each_finds_the_best() -> None:
    rng = np.random.default_rng(1)
    assert expected_lead(WORST_FIRST, 3, 6, 20, rng) == pytest.approx(10 / 3)


def test_whoever_did_not_race_may_be_sent_by_lot() -> None:
    """After one pair its winner is sent: the second beats the first, the third either; by lot 1/3 and 2/3."""
    rng = np.random.default_rng(1)
    expected = (0 + 2 * 10 / 3) / 3  # the second's lead is (2 - 4) / 3
    assert expected_lead(WORST_FIRST, 3, 2, 3000, rng) == pytest.approx(expected - 2 / 9, abs=0.1)


def test_luck_alone_leads_nobody() -> None:
    """The one that seems best owes it to luck, and the races that judge do not share it."""
    rng = np.random.default_rng(2)
    leads = []
    for _ in range(60):
        pairs = {two: rng.standard_normal(20) for two in WORST_FIRST}
        leads.append(expected_lead(pairs, 3, 30, 10, rng))
    assert abs(np.mean(leads)) < 3 * np.std(leads) / np.sqrt(len(leads))


def test_pairs_are_dealt_evenly() -> None:
    raced = dealt(6, 15, np.random.default_rng(1))
    assert sorted(raced.tolist()) == [2, 2, 2, 3, 3, 3]


def test_scores_are_those_of_the_tournament() -> None:
    evidence = Evidence(duels({("a", "b"): [1.0, 4.0, 3.0], ("b", "c"): [-2.0], ("a", "c"): [6.0, 1.0]}), {})
    gaps, weight = np.zeros((2, 3, 3))
    for (first, second), mean, units in zip(evidence.matchups, evidence.means, evidence.units, strict=True):
        gaps[first, second], gaps[second, first] = mean, -mean
        weight[first, second] = weight[second, first] = units
    assert fitted(gaps, weight) == pytest.approx(evidence.solution @ evidence.means)


def test_more_races_stop_paying_where_the_most_bring_too_little() -> None:
    assert enough({10: 0.0, 20: 1.0, 40: 1.45, 80: 1.5}, 0.1) == 40
    assert enough({10: 0.0, 20: 1.0}, 0.1) == 20


def test_one_beside_another_in_their_own_races() -> None:
    """Pairs won by 4, won by 2 and lost by 1: 5/3 points, two wins of three."""
    results = duels({("a", "b"): [4.0, 2.0, -1.0]})
    found = head_to_head(results, "a", np.random.default_rng(1))
    other = head_to_head(results, "b", np.random.default_rng(1))
    assert found["races"] == 6
    assert (found["points"], found["wins"], found["contacts"]) == (1.667, 0.667, 0.0)
    assert (other["points"], other["wins"]) == (-1.667, 0.333)
    assert found["points_low"] < found["points"] < found["points_high"]
