"""Completion: known numbers of runs, exact errors at every look, and a fair coin for the reference."""

from __future__ import annotations

from math import ceil, log

import numpy as np
import pytest
from scipy.integrate import quad

from nathlon.arena.decision import Decision
from nathlon.tournament.completion import Completed, Completion, breaks_more, clean_sweep, enough


def passes_at_any_look(rate: float, needed: tuple[int, ...], most: int) -> float:
    """By following every number of breakdowns from run to run."""
    open_, passed = {0: 1.0}, 0.0
    for runs in range(1, most + 1):
        after: dict[int, float] = {}
        for broken, chance in open_.items():
            after[broken] = after.get(broken, 0.0) + chance * (1 - rate)
            after[broken + 1] = after.get(broken + 1, 0.0) + chance * rate
        few = sum(runs >= least for least in needed)
        passed += sum(chance for broken, chance in after.items() if broken < few)
        open_ = {broken: chance for broken, chance in after.items() if broken >= few}
    return passed


def test_the_numbers_of_runs_are_those_of_the_binomial() -> None:
    # 0.95^63 = 0.0395 is the first power below 0.8 x 0.05.
    assert enough(0.05, 0.05, 192)[0] == clean_sweep(0.05, 0.05) == 63
    assert 0.95**63 <= 0.04 < 0.95**62
    # One breakdown among those 63, and none in what follows, may spend 0.8 of what is left.
    one = 63 * 0.05 * 0.95**62
    assert enough(0.05, 0.05, 192)[1] == 63 + ceil(log(0.8 * (0.05 - 0.95**63) / one) / log(0.95))
    assert enough(0.05, 0.05, 62) == ()
    assert [clean_sweep(rate, 0.05) for rate in (0.02, 0.01, 0.005)] == [160, 321, 643]


@pytest.mark.parametrize(("rate", "alpha", "most"), [(0.05, 0.05, 400), (0.2, 0.1, 150), (0.02, 0.01, 900)])
def test_the_error_is_exact_at_all_looks_together(rate: float, alpha: float, most: int) -> None:
    needed = enough(rate, alpha, most)
    assert len(needed) >= 3
    assert 0.85 * alpha < passes_at_any_look(rate, needed, most) <= alpha


def test_more_runs_allow_more_breakdowns_and_change_nothing_before() -> None:
    assert enough(0.05, 0.05, 500)[:3] == enough(0.05, 0.05, 192)[:3]
    assert list(enough(0.05, 0.05, 500)) == sorted(set(enough(0.05, 0.05, 500)))


def test_verdicts() -> None:
    test = Completion(0.05)
    assert test.verdict(Completed(62, 0, 0, 0)) == Decision.CANNOT_TELL
    assert test.verdict(Completed(63, 0, 0, 0)) == Decision.PASS
    assert test.verdict(Completed(63, 0, 1, 0)) == Decision.CANNOT_TELL
    assert test.verdict(Completed(63, 13, 0, 0)) == Decision.CANNOT_TELL
    assert test.verdict(Completed(20, 0, 9, 0)) == Decision.FAIL
    assert test.verdict(Completed(64, 2, 12, 11)) == Decision.CANNOT_TELL


def test_what_is_ruled_out_is_where_the_runs_would_just_pass() -> None:
    test = Completion(0.05)
    assert test.ruled_out(Completed(64, 0, 0, 0)) == pytest.approx(1 - 0.04 ** (1 / 64), abs=2e-4)
    assert test.ruled_out(Completed(1, 0, 1, 0)) is None
    bounds = [test.ruled_out(Completed(192, 0, broken, 0)) or 1.0 for broken in range(6)]
    assert bounds == sorted(bounds)


def test_the_evidence_against_an_equal_is_the_integral_and_holds_at_all_looks() -> None:
    for alone, other in ((0, 0), (6, 0), (9, 3), (2, 8)):
        area, _ = quad(lambda p, a=alone, b=other: p**a * (1 - p) ** b, 0.5, 1.0)
        assert breaks_more(alone, other) == pytest.approx(2 * area * 2 ** (alone + other))
    coins = np.random.default_rng(3).uniform(size=(600, 100)) < 0.5
    heads = coins.cumsum(axis=1)
    wrong = [
        any(breaks_more(int(row[n]), n + 1 - int(row[n])) >= 20 for n in range(0, 100, 3)) for row in heads
    ]
    assert np.mean(wrong) <= 0.05
