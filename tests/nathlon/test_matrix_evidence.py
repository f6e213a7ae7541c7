"""What few runs in many cells tell: against closed forms, another library, and drawn truths."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import binom

from nathlon.judge.matrix.evidence import (
    as_one_cell,
    discovered,
    looks,
    mean_over_cells,
    mishap,
    no_worse,
    p_worse,
    rate_of_look,
    shrink,
    variances_of_means,
)
from nathlon.tournament.non_inferiority import LOSS


def grid(rows: int, columns: int) -> np.ndarray:
    return np.stack([np.repeat(np.arange(rows), columns), np.tile(np.arange(columns), rows)], axis=1)


def test_cells_are_drawn_towards_their_rows_and_keep_what_they_know() -> None:
    rng = np.random.default_rng(1)
    levels = grid(60, 8)
    truth = rng.normal(0.0, 0.8, 60)[levels[:, 0]] + rng.normal(0.0, 0.3, len(levels))
    variances = np.full(len(levels), 0.5)
    means = truth + rng.normal(0.0, np.sqrt(0.5), len(levels))
    shrunk = shrink(means, variances, levels)
    # The error of the best linear estimate that knows all spreads is about 0.14.
    assert np.mean((means - truth) ** 2) > 0.4
    assert np.mean((shrunk.mean - truth) ** 2) < 0.2
    assert 0.92 < np.mean(np.abs(shrunk.mean - truth) < 1.96 * shrunk.error) < 0.98
    certain = shrink(means, np.full(len(levels), 1e-9), levels)
    np.testing.assert_allclose(certain.mean, means, atol=1e-4)


def test_equal_cells_have_their_common_mean() -> None:
    rng = np.random.default_rng(2)
    means = 3.0 + rng.normal(0.0, 0.5, 400)
    shrunk = shrink(means, np.full(400, 0.25), grid(20, 20))
    assert np.abs(shrunk.mean - means.mean()).max() < 0.35
    assert np.std(shrunk.mean) < 0.2 * np.std(means)


def test_nothing_that_varies_is_no_evidence() -> None:
    shrunk = shrink(np.zeros(12), np.zeros(12), grid(3, 4))
    assert np.abs(shrunk.mean).max() == 0.0
    assert not shrunk.above(0.01).any()


def test_one_wild_cell_leaves_the_others_their_precision() -> None:
    rng = np.random.default_rng(3)
    differences = rng.normal(0.0, 0.1, (100, 4))
    differences[0] = [50.0, -50.0, 40.0, -60.0]
    variances = variances_of_means(differences)
    assert np.median(variances[1:]) == pytest.approx(0.01 / 4, rel=0.3)
    assert variances[0] > 300


def test_runs_that_are_missing_do_not_count() -> None:
    differences = np.array(
        [[1.0, 2.0, np.nan, np.nan], [1.0, 1.0, 1.0, 1.0], [np.nan] * 4, [5.0, np.nan, np.nan, np.nan]]
    )
    p = p_worse(differences, 0.5, 1.5)
    # That an exponential variable outweighs others is a product of odds.
    assert p[:2] == pytest.approx([1 / 2 / 4, (2 / 3) ** 4], rel=0.1)
    assert p[2:].tolist() == [1.0, 1.0]
    assert no_worse(differences, 1.0).tolist() == [False, True, True, False]


@pytest.mark.parametrize("mishaps", [0, 1, 2])
def test_runs_of_two_values_are_judged_by_the_exact_binomial_test(mishaps: int) -> None:
    """A policy that is worse by 3, but for a mishap of the baseline that costs it 40."""
    runs = np.full((1, 64), 3.0)
    runs[0, :mishaps] = -37.0
    # They are where the mishap comes in 5 % of the runs.
    [p] = p_worse(runs, 1.0, 40.0)
    assert p == pytest.approx(binom.cdf(mishaps, 64, 0.05), rel=0.03)


def test_p_values_are_those_of_random_weights() -> None:
    rng = np.random.default_rng(6)
    runs = rng.normal(4.0, 3.0, 16)
    weights = rng.standard_exponential((100_000, 17))
    values = np.append(runs, np.median(runs) - 12.0) - 1.0
    assert p_worse(runs[None], 1.0, 12.0)[0] == pytest.approx((weights @ values <= 0).mean(), rel=0.05)


def test_a_mishap_that_has_not_happened_yet_is_reckoned_with() -> None:
    """Eight runs that are all a little worse: they may be those without the baseline's rare mishap."""
    steady = np.full((1, 8), 3.0) + np.linspace(-0.1, 0.1, 8)
    assert p_worse(steady, 1.0, LOSS)[0] > 0.1
    assert p_worse(np.tile(steady, 8), 1.0, LOSS)[0] < 1e-4
    # No mishap of so little makes up for so much, and nothing that does not vary is doubted at a margin of 0.
    assert p_worse(steady + 20.0, 1.0, LOSS)[0] == 0.0
    assert p_worse(np.ones((1, 4)), 0.0, 0.0)[0] == 0.0


def test_a_mishap_is_as_large_as_any_in_the_matrix() -> None:
    quiet = np.array([[2.0, 2.1, np.nan, 1.9], [30.0, 30.5, 29.5, np.nan], [np.nan] * 4])
    assert mishap(quiet, 1.0) == LOSS
    assert mishap(quiet, 0.0) == pytest.approx(0.5)
    quiet[1, 1] = -10.0
    assert mishap(quiet, 1.0) == pytest.approx(39.5)
    assert mishap(np.empty((2, 0)), 1.0) == LOSS


def test_levels_are_not_worse_for_mishaps_of_the_baseline() -> None:
    """Equal means over 15 cells of four runs, most of which the policy loses."""
    rng = np.random.default_rng(7)
    said = 0
    for _ in range(200):
        spoilt = rng.uniform(size=(15, 4)) < 0.05
        runs = np.linspace(-5.0, 5.0, 15)[:, None] + 1.0 + 40.0 * (0.05 - spoilt)
        runs += 0.5 * rng.standard_normal((15, 4))
        said += p_worse(as_one_cell(runs), 1.0, max(40.0, mishap(runs, 1.0)))[0] < 0.05
    assert said <= 0.05 * 200


def test_looks_double_and_share_out_the_rate() -> None:
    assert (looks(64), looks(8), looks(20)) == ([8, 16, 32, 64], [8], [8, 16, 20])
    assert sum(rate_of_look(end, looks(64), 0.05) for end in looks(64)) == pytest.approx(0.05)
    assert rate_of_look(8, [8], 0.05) == pytest.approx(0.75 * 0.05)


def test_a_mean_over_cells_is_that_of_their_means_and_as_uncertain_as_their_runs() -> None:
    rng = np.random.default_rng(4)
    shifts, drawn = rng.normal(0.0, 3.0, 40), rng.normal(0.0, 1.0, (2000, 40, 4))
    known = [mean_over_cells(shifts[:, None] + runs) for runs in drawn]
    assert known[0].mean == pytest.approx((shifts[:, None] + drawn[0]).mean())
    assert {one.freedom for one in known} == {120}
    # However far apart the cells lie: they are those that are asked about.
    assert np.mean([one.error for one in known]) == pytest.approx(1 / np.sqrt(160), rel=0.02)
    assert np.std([one.mean for one in known]) == pytest.approx(1 / np.sqrt(160), rel=0.06)
    assert np.isnan(mean_over_cells(np.full((2, 3), np.nan)).mean)
    as_one = as_one_cell(shifts[:, None] + drawn[0])
    assert as_one.shape == (1, 160)
    assert as_one.mean() == pytest.approx(known[0].mean)
    assert as_one.std(ddof=1) == pytest.approx(1.0, rel=0.1)
    cells = [as_one_cell(shifts[:, None] + runs) for runs in drawn[:200]]
    p = np.array([p_worse(one, shifts.mean(), mishap(one, 0.0))[0] for one in cells])
    assert np.mean(p < 0.05) < 0.09


def test_discoveries_are_those_of_benjamini_and_hochberg() -> None:
    # Their own example: of 15 p-values the first four are rejected at 0.05.
    p = np.array([0.0001, 0.0004, 0.0019, 0.0095, 0.0201, 0.0278, 0.0298, 0.0344, 0.0459, 0.3240, 0.4262,
                  0.5719, 0.6528, 0.7590, 1.0])  # fmt: skip
    assert discovered(p, 0.05).tolist() == 4 * [True] + 11 * [False]
    assert discovered(p[::-1], 0.05).tolist() == 11 * [False] + 4 * [True]
    assert discovered(np.zeros(0), 0.05).tolist() == []
