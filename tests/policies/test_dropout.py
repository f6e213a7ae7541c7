"""Which units are dropped: the right share of them, and no pattern."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from nathlon.policies.qrsac.dropout import dropout_factors

SHAPE = (400, 500)
COUNT = 400 * 500

seeds = st.integers(0, 2**63 - 1).map(np.random.default_rng)


def factors(seed: list[int], dropout: float = 0.25) -> torch.Tensor:
    return dropout_factors(torch.tensor(seed, dtype=torch.int32), SHAPE, dropout)


def drawn(rng: np.random.Generator) -> list[int]:
    return rng.integers(-(2**31), 2**31, 2).tolist()


@given(rng=seeds, dropout=st.sampled_from([0.01, 0.1, 0.25, 0.5, 0.9]))
def test_the_share_and_the_mean_are_right(rng: np.random.Generator, dropout: float) -> None:
    kept = factors(drawn(rng), dropout)
    assert set(np.unique(kept.numpy()).tolist()) == {0.0, float(np.float32(1.0 / (1.0 - dropout)))}
    # six standard deviations of the mean of as many draws
    assert abs(float(kept.mean()) - 1.0) < 6.0 * np.sqrt(dropout / (1.0 - dropout) / COUNT)


@given(rng=seeds)
def test_units_are_dropped_on_their_own(rng: np.random.Generator) -> None:
    """Neighbours, rows, columns and other seeds have nothing to do with each other."""
    kept, other = factors(drawn(rng)), factors(drawn(rng))
    pairs = [(kept[:-1], kept[1:]), (kept[:, :-1], kept[:, 1:]), (kept[:, :-16], kept[:, 16:]), (kept, other)]
    for first, second in pairs:
        correlation = np.corrcoef(first.flatten(), second.flatten())[0, 1]
        assert abs(correlation) < 6.0 / np.sqrt(first.numel())
    for dim in (0, 1):
        spread = np.sqrt(1.0 / 3.0 / SHAPE[dim])
        assert float(kept.mean(dim).std()) == pytest.approx(spread, rel=0.2)


def test_the_same_seed_drops_the_same() -> None:
    assert factors([3, -7]).equal(factors([3, -7]))
    assert not factors([3, -7]).equal(factors([4, -7]))
    assert not factors([3, -7]).equal(factors([3, -6]))
