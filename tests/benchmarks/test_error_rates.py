"""Rows of error rates: their intervals, a verdict that keeps its word, and faults that rows must show."""

from __future__ import annotations

import json
import sys
from unittest.mock import patch

import numpy as np
import pytest

from benchmarks.error_rates import __main__ as error_rates
from benchmarks.error_rates import gates, matrices, recipes, selections
from benchmarks.error_rates.simulation import Case, Outcome, missed, row, simulated
from nathlon.arena.decision import Decision
from nathlon.tournament.completion import Completed, Completion

FEW = range(30)


def chosen(module: object, noise: str, claim: str = "") -> Case:
    return next(case for case in module.cases() if case.noise == noise and claim in case.claim)  # type: ignore[attr-defined]


def test_rows_have_exact_intervals_and_miss_a_goal_only_where_it_is_proven() -> None:
    case = Case("gate", "passes", "normal", 0.05, lambda rng: Outcome(0.0, 1, None))
    made = row(case, [Outcome(float(number < 3), 1, 1.0) for number in range(20)])
    assert (made["claims"], made["false_share"], made["power"]) == (20, 0.15, 1.0)
    assert (made["low"], made["high"]) == (0.0321, 0.3789)
    assert not missed(made)
    assert missed(row(case, [Outcome(float(number < 6), 1, None) for number in range(20)]))
    shares = row(case, [Outcome(0.25, 4, None), Outcome(0.75, 4, None)])
    assert (shares["claims"], shares["false_share"]) == (8, 0.5)


@pytest.mark.parametrize("module", [gates, recipes, matrices])
def test_a_sound_verdict_keeps_its_goal(module: object) -> None:
    case = chosen(module, "disasters in 5 %")
    assert not missed(row(case, simulated(case, FEW)))


def test_a_matrix_does_not_take_rare_mishaps_of_the_baseline_for_a_worse_policy() -> None:
    case = chosen(matrices, "disasters in 5 %", "mishaps")
    made = row(case, simulated(case, range(8)))
    assert made["false_share"] < 0.05
    assert made["power"] > 0.7


def test_every_verdict_is_judged_under_every_noise() -> None:
    cases = error_rates.all_cases()
    assert {case.verdict for case in cases} == {
        "filter",
        "battery",
        "round robin",
        "gate",
        "matrix",
        "recipes",
    }
    noises = {case.noise for case in cases}
    assert all({one.noise for one in cases if one.verdict == case.verdict} == noises for case in cases)
    for verdict in ("filter", "battery", "round robin"):
        case = next(one for one in selections.cases() if one.verdict == verdict and "voids" in one.noise)
        [outcome] = simulated(case, range(1))
        assert outcome == simulated(case, range(1))[0]
        assert 0.0 <= outcome.false <= 1.0


def test_a_range_that_is_too_narrow_is_seen() -> None:
    def outcome(*said: tuple[int, int]) -> Outcome:
        return selections.ranges(selections.Ranks(*np.array(said).T))

    assert outcome((1, 1), (2, 3), (2, 3)) == Outcome(0.0, 1, 1.0)
    assert outcome((1, 3), (1, 3), (1, 3)) == Outcome(0.0, 1, 0.0)
    for narrow in ([(1, 1), (2, 2), (2, 3)], [(1, 1), (2, 3), (3, 3)], [(2, 3), (1, 3), (1, 3)]):
        assert outcome(*narrow).false == 1.0


def test_a_gate_that_counts_no_breakdowns_is_seen(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def careless(self: Completion, seen: Completed) -> Decision:
        return Decision.PASS

    case = chosen(gates, "disasters in 5 %", "passes")
    monkeypatch.setattr(Completion, "verdict", careless)
    monkeypatch.setattr(error_rates, "all_cases", lambda: [case])
    with (
        patch.object(sys, "argv", ["error_rates", "--simulations", "30", "--workers", "1"]),
        pytest.raises(SystemExit) as end,
    ):
        error_rates.main()
    assert end.value.code == 1
    [made] = json.loads(capsys.readouterr().out.splitlines()[-1])["rows"]
    assert made["false_share"] > 0.5


def test_recipes_that_resample_in_each_task_are_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    def stratified(rng: np.random.Generator, ours: np.ndarray, theirs: np.ndarray) -> int:
        both = [
            scores[rng.integers(len(scores), size=(300, *scores.shape)), np.arange(scores.shape[1])]
            for scores in (ours, theirs)
        ]
        gaps = both[0][:, :, None] - both[1][:, None]
        low, high = np.quantile((gaps > 0).mean(axis=(1, 2, 3)), [0.025, 0.975])
        return int(low > 0.5) - int(high < 0.5)

    monkeypatch.setattr(recipes, "says", stratified)
    case = chosen(recipes, "normal", "10 runs")
    assert missed(row(case, simulated(case, range(100))))


def test_a_matrix_without_its_correction_is_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(matrices, "discovered", lambda p, rate: p <= 0.3)
    case = chosen(matrices, "normal")
    assert missed(row(case, simulated(case, range(20))))
