"""What is compared where a policy that sees is trained without its memory."""

from __future__ import annotations

import pytest
from scipy import stats

from benchmarks.sight_memory import MEMORY, NO_MEMORY, compared, configurations
from nathlon.policies.training.config import TrainingConfig


def test_nothing_but_the_memory_differs() -> None:
    whole, blank = (configurations()[name].model_dump() for name in (MEMORY, NO_MEMORY))
    assert TrainingConfig.model_validate(blank).vision.memory == 0  # type: ignore[union-attr]
    assert whole["vision"].pop("memory") > 0
    del blank["vision"]["memory"]
    assert whole == blank


def test_differences_are_of_the_same_seed() -> None:
    found = {MEMORY: {"metres": [500.0, 620.0, 410.0]}, NO_MEMORY: {"metres": [450.0, 600.0, 400.0]}}
    less = [50.0, 20.0, 10.0]
    expected = stats.t.interval(0.95, 2, sum(less) / 3, stats.sem(less))
    assert compared(found, "metres")["less"] == pytest.approx([80.0 / 3, *expected], abs=1e-4)
