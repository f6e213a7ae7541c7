"""N-step windows against a plain reading of their definition, and the ring."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from policies.replay import NStepReplay
from sim.errors import InputError

Row = tuple[float, float, float, float, float]


def transitions(steps: list[tuple[float, str]], slot: int, n_step: int, gamma: float) -> list[Row]:
    """(observation, action, reward, discount, next observation) of every window of one slot, by definition.

    Step t sees observation 1000 slot + 2t, acts t, and leads to observation 1000 slot + 2t + 1.
    """
    rows: list[Row] = []
    for start, (_, kind) in enumerate(steps):
        if kind == "skip":
            continue
        total, discount = 0.0, 1.0
        for t in range(start, min(start + n_step, len(steps))):
            reward, kind = steps[t]
            if kind == "skip":
                break
            total += discount * reward
            discount *= gamma
            if kind in ("end", "cut", "both") or t == start + n_step - 1:
                bootstrap = 0.0 if kind in ("end", "both") else discount
                rows.append((1000.0 * slot + 2 * start, start, total, bootstrap, 1000.0 * slot + 2 * t + 1))
                break
    return rows


kinds = st.sampled_from(["go", "go", "go", "go", "end", "cut", "both", "skip"])


@settings(max_examples=100, deadline=None)
@given(data=st.data(), slots=st.integers(1, 4), length=st.integers(1, 25), n_step=st.integers(1, 7))
def test_windows_are_those_of_the_definition(
    data: st.DataObject, slots: int, length: int, n_step: int
) -> None:
    gamma = 0.9
    step = st.tuples(st.floats(-10, 10, width=32), kinds)
    runs = [data.draw(st.lists(step, min_size=length, max_size=length)) for _ in range(slots)]
    replay = NStepReplay(1000, slots, 1, 1, n_step, gamma)
    base = 1000.0 * np.arange(slots)
    for t in range(length):
        rewards, kind = zip(*(run[t] for run in runs), strict=True)
        flags = np.array(kind)
        replay.add(
            observation=(base + 2 * t)[:, None].astype(np.float32),
            action=np.full((slots, 1), t, np.float32),
            reward=np.array(rewards, np.float32),
            next_observation=(base + 2 * t + 1)[:, None].astype(np.float32),
            terminated=np.isin(flags, ("end", "both")),
            truncated=np.isin(flags, ("cut", "both")),
            valid=flags != "skip",
        )
    expected = sorted(row for slot, run in enumerate(runs) for row in transitions(run, slot, n_step, gamma))
    assert len(replay) == len(expected)
    stored = replay.stored()
    found = sorted(
        zip(
            stored.observation[:, 0].tolist(),
            stored.action[:, 0].tolist(),
            stored.reward.tolist(),
            stored.discount.tolist(),
            stored.next_observation[:, 0].tolist(),
            strict=True,
        )
    )
    np.testing.assert_allclose(found, expected, rtol=1e-5, atol=1e-5)


def step(replay: NStepReplay, value: float, end: bool = False) -> None:
    """One step of a single slot whose observation, action and reward are all `value`."""
    row = np.array([[value]], np.float32)
    replay.add(row, row, row[0], row, np.array([end]), np.array([False]))


def test_the_ring_keeps_the_newest() -> None:
    replay = NStepReplay(5, 1, 1, 1, 1, 0.5)
    for value in range(13):
        step(replay, float(value))
    assert len(replay) == 5
    assert sorted(replay.stored().observation[:, 0].tolist()) == [8.0, 9.0, 10.0, 11.0, 12.0]


def test_samples_are_uniform_and_belong_together() -> None:
    replay = NStepReplay(8, 1, 1, 1, 1, 0.5)
    for value in range(4):
        step(replay, float(value), end=value == 3)
    batch = replay.sample(40_000, np.random.default_rng(0))
    counts = np.bincount(batch.observation[:, 0].int().numpy(), minlength=4)
    # four standard deviations of a binomial count
    assert np.abs(counts - 10_000).max() < 4 * np.sqrt(40_000 * 0.25 * 0.75)
    assert batch.observation[:, 0].equal(batch.reward)
    assert batch.discount.equal(0.5 * (batch.reward != 3.0).float())


def test_same_seed_same_sample() -> None:
    replay = NStepReplay(8, 1, 1, 1, 1, 0.5)
    for value in range(8):
        step(replay, float(value))
    first, again, other = (replay.sample(64, np.random.default_rng(seed)) for seed in (3, 3, 4))
    assert first.observation.equal(again.observation)
    assert not first.observation.equal(other.observation)


def test_no_sample_of_nothing() -> None:
    with pytest.raises(ValueError, match="empty"):
        NStepReplay(8, 1, 1, 1, 1, 0.5).sample(1, np.random.default_rng(0))


def test_capacity_must_hold_one_step_of_all_slots() -> None:
    with pytest.raises(InputError, match=r"capacity is 9, expected at least 10 \(2 slots times 5 steps\)"):
        NStepReplay(9, 2, 1, 1, 5, 0.5)


def test_nbytes_counts_the_columns() -> None:
    small, large = (NStepReplay(capacity, 1, 100, 2, 3, 0.5).nbytes for capacity in (1000, 3000))
    assert large - small == 2000 * 4 * (100 + 2 + 1 + 1 + 100)
