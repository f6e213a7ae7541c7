"""Non-inferiority: known ratios, error rates at the margin and at equality, and intervals."""

from __future__ import annotations

from math import log, sqrt

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.special import stdtrit

from nathlon.arena.decision import Decision
from nathlon.arena.statistics import Floats
from nathlon.tournament.non_inferiority import NonInferiority, Sample, least_deviation, together

LOOKS, BLOCK = 8, 8
TEST = NonInferiority(margin=0.5, looks=LOOKS)


def ends(differences: Floats, test: NonInferiority, floor: float = 0.0) -> Decision:
    """What a gate says in the end that looks after every block."""
    said = Decision.CANNOT_TELL
    for units in range(BLOCK, len(differences) + 1, BLOCK):
        said = test.verdict(Sample.of(differences[:units], floor))
        if said != Decision.CANNOT_TELL:
            break
    return said


def test_it_passes_exactly_where_the_ratio_reaches_walds_bound() -> None:
    """At t = 0 the ratio is N / 2 ln(1 + m^2), which must reach ln(0.95 / 0.05)."""
    units = 2 * log(19) / log(1 + 0.5**2)
    assert TEST.verdict(Sample(units + 0.01, 0.0, 1.0)) == Decision.PASS
    assert TEST.verdict(Sample(units - 0.01, 0.0, 1.0)) == Decision.CANNOT_TELL


@given(st.floats(4, 500), st.floats(-3, 3), st.floats(0.01, 3), st.floats(0.01, 3))
def test_better_is_never_judged_worse(units: float, mean: float, more: float, deviation: float) -> None:
    order = [Decision.FAIL, Decision.CANNOT_TELL, Decision.PASS]
    worse, better = (TEST.verdict(Sample(units, value, deviation)) for value in (mean, mean + more))
    assert order.index(better) >= order.index(worse)


@pytest.mark.parametrize("margin", [0.25, 0.5, 1.0])
def test_errors_are_at_most_as_asked(margin: float) -> None:
    rng, test = np.random.default_rng(7), NonInferiority(margin, looks=LOOKS)
    count = 1500
    allowed = 0.05 + 3 * sqrt(0.05 * 0.95 / count)
    for truth, wrong in ((-margin, Decision.PASS), (0.0, Decision.FAIL)):
        said = [ends(rng.normal(truth, 1.0, LOOKS * BLOCK), test) for _ in range(count)]
        assert said.count(wrong) / count <= allowed


def test_rare_events_that_have_not_happened_yet_are_no_proof() -> None:
    """Four units without a contact: by what was seen they do not vary, by counting they may."""
    km, margin = 10.0, 0.05
    nothing = np.zeros(4)
    test = NonInferiority(margin)
    assert test.verdict(Sample.of(nothing)) == Decision.PASS
    assert test.verdict(Sample.of(nothing, sqrt(margin / km))) == Decision.CANNOT_TELL


def test_nothing_passes_before_a_loss_that_matters_would_have_been_seen() -> None:
    test = NonInferiority(margin=0.5, sweep=63)
    assert test.verdict(Sample(62, 1.0, 1.0)) == Decision.CANNOT_TELL
    assert test.verdict(Sample(63, 1.0, 1.0)) == Decision.PASS


def test_before_the_first_look_only_what_is_far_worse_fails() -> None:
    test = NonInferiority(margin=0.5, first=24)
    assert test.verdict(Sample(8, 3.0, 1.0)) == Decision.CANNOT_TELL
    assert test.verdict(Sample(8, -1.1, 1.0)) == Decision.CANNOT_TELL
    assert test.verdict(Sample(24, -1.1, 1.0)) == Decision.FAIL
    assert test.verdict(Sample(4, -6.0, 1.0)) == Decision.FAIL


@pytest.mark.parametrize("block", [4, 8])
def test_skewed_noise_seldom_passes_who_is_worse_however_often_it_looks(block: int) -> None:
    """An exponential tail on the bad side, as of slow laps; the least deviation holds it."""
    rng, count = np.random.default_rng(13), 400
    test = NonInferiority(margin=1.0, first=24, sweep=63)
    passed = 0
    for _ in range(count):
        units = 2.0 * (1.0 - rng.standard_exponential(192)) - 1.0
        said = (
            test.verdict(Sample.of(units[:taken], least_deviation(1.0))) for taken in range(block, 193, block)
        )
        passed += next((one for one in said if one != Decision.CANNOT_TELL), None) == Decision.PASS
    assert passed / count <= 0.05


def test_a_candidate_with_more_contacts_seldom_passes() -> None:
    rng, km, margin, count = np.random.default_rng(3), 10.0, 0.05, 1000
    test = NonInferiority(margin, looks=LOOKS)
    differences = (rng.poisson(0.02 * km, (count, 64)) - rng.poisson((0.02 + margin) * km, (count, 64))) / km
    said = [ends(row, test, sqrt(margin / km)) for row in differences]
    assert said.count(Decision.PASS) / count <= 0.05 + 3 * sqrt(0.05 * 0.95 / count)


def test_intervals_hold_at_all_looks_together() -> None:
    rng, count, missed = np.random.default_rng(5), 800, 0
    for _ in range(count):
        differences = rng.normal(0.2, 1.0, LOOKS * BLOCK)
        lows = [TEST.interval(Sample.of(differences[:n]))[0] for n in range(BLOCK, 65, BLOCK)]
        missed += any(low is not None and low > 0.2 for low in lows)
    assert missed / count <= 0.05 + 3 * sqrt(0.05 * 0.95 / count)


def test_an_interval_at_the_only_look_is_student_s() -> None:
    """Each bound is missed with probability alpha: together they are one of 90 %."""
    half = float(stdtrit(15, 0.95)) * 2.0 / sqrt(16)
    bounds = NonInferiority(margin=1.0).interval(Sample(16, 0.3, 2.0))
    assert bounds == pytest.approx((0.3 - half, 0.3 + half))


def test_too_few_units_say_nothing() -> None:
    assert TEST.verdict(Sample(3, 100.0, 0.0)) == Decision.CANNOT_TELL
    assert TEST.interval(Sample.of(np.array([1.0]))) == (None, None)


def test_all_must_pass() -> None:
    yes, no, open_ = Decision.PASS, Decision.FAIL, Decision.CANNOT_TELL
    assert together([yes, yes]) == yes
    assert together([yes, open_]) == open_
    assert together([yes, open_, no]) == no
    assert together([]) == open_


@pytest.mark.parametrize("mean", [0.3, 0.0, -0.2, -0.4, -0.6])
def test_it_says_after_how_many_such_units_it_decides(mean: float) -> None:
    needed = TEST.needed(Sample(20, mean, 2.0))
    assert needed is not None
    assert TEST.verdict(Sample(needed, mean, 2.0)) != Decision.CANNOT_TELL
    assert TEST.verdict(Sample(needed - 1, mean, 2.0)) == Decision.CANNOT_TELL
    assert TEST.needed(Sample(2, mean, 2.0)) is None
    assert TEST.needed(Sample(20, -0.25, 2.0)) is None, "midway no number decides"
