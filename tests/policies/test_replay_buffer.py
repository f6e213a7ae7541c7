"""N-step windows against a plain reading of their definition, and the rings."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from nathlon.policies.replay_buffer.table import Batch, NStepReplay, table_bytes
from nathlon.sim.errors import InputError

GAMMA = 0.9
Row = tuple[float, float, float, float, float]


class Step(NamedTuple):
    """One step of one slot: what it saw before and after, its reward, and how it ended."""

    before: int
    after: int
    reward: float
    kind: str


def run(steps: list[tuple[float, str]], slot: int) -> list[Step]:
    """The steps of a slot that sees 500 slot + 0, 1, 2 ...; two more, not one, where the run breaks.

    The kind `jump` breaks it without telling.
    """
    seen, told = 500 * slot, []
    for reward, kind in steps:
        told.append(Step(seen, seen + 1, reward, kind))
        seen += 1 if kind == "go" else 2
    return told


def transitions(steps: list[Step], n_step: int) -> list[tuple[int, int, Row]]:
    """(closing time, opening time, values) of every window of one slot, by definition."""
    rows: list[tuple[int, int, Row]] = []
    for start, first in enumerate(steps):
        total, discount = 0.0, 1.0
        for t in range(start, min(start + n_step, len(steps))):
            step = steps[t]
            if step.kind == "skip":
                break
            total += discount * step.reward
            discount *= GAMMA
            if step.kind in ("end", "cut", "both") or t == start + n_step - 1:
                bootstrap = 0.0 if step.kind in ("end", "both") else discount
                rows.append((t, start, (first.before, start, total, bootstrap, step.after)))
                break
    return rows


def add(replay: NStepReplay, time: int, steps: tuple[Step, ...]) -> None:
    """One step of all slots; the action is the time, an observation its number and minus that."""
    kind = np.array([step.kind for step in steps])
    numbers = [step.before for step in steps], [step.after for step in steps]
    before, after = (np.array([[x, -x] for x in seen], np.float32) for seen in numbers)
    replay.add(
        observation=before,
        action=np.full((len(steps), 1), time, np.float32),
        reward=np.array([step.reward for step in steps], np.float32),
        next_observation=after,
        terminated=np.isin(kind, ("end", "both")),
        truncated=np.isin(kind, ("cut", "both")),
        valid=kind != "skip",
    )


def values(batch: Batch) -> list[Row]:
    """The transitions of a batch as rows of numbers."""
    assert batch.observation[:, 0].equal(-batch.observation[:, 1])
    assert batch.next_observation[:, 0].equal(-batch.next_observation[:, 1])
    columns = (
        batch.observation[:, 0],
        batch.action[:, 0],
        batch.reward,
        batch.discount,
        batch.next_observation[:, 0],
    )
    return list(zip(*(column.tolist() for column in columns), strict=True))


kinds = st.sampled_from(["go"] * 12 + ["jump", "end", "cut", "both", "skip"])


@settings(max_examples=60, deadline=None)
@given(
    data=st.data(),
    slots=st.integers(1, 4),
    length=st.integers(1, 40),
    n_step=st.integers(1, 7),
    spare=st.integers(0, 20),
    dtype=st.sampled_from([np.float16, np.float32]),
)
def test_the_newest_windows_of_the_definition_are_stored_and_no_others(
    data: st.DataObject, slots: int, length: int, n_step: int, spare: int, dtype: type
) -> None:
    one = st.tuples(st.floats(-10, 10, width=32), kinds)
    runs = [run(data.draw(st.lists(one, min_size=length, max_size=length)), slot) for slot in range(slots)]
    replay = NStepReplay(slots * n_step + spare, slots, 2, 1, n_step, GAMMA, dtype)
    closed = sorted(
        (close, slot, start % n_step, row)
        for slot, steps in enumerate(runs)
        for close, start, row in transitions(steps, n_step)
    )
    broken = 0
    for t, steps in enumerate(zip(*runs, strict=True)):
        add(replay, t, steps)
        broken += sum(step.kind != "go" for step in steps)
        expected = [row for close, *_, row in closed if close <= t]
        assert replay.gathered == len(expected)
        if broken <= replay.capacity // 8:
            assert len(replay) == min(len(expected), replay.capacity)
        if t % 4 and t < length - 1:
            continue
        stored = values(replay.stored())
        assert len(stored) == len(replay)
        newest = expected[len(expected) - len(stored) :]
        np.testing.assert_allclose(
            np.reshape(stored, (-1, 5)), np.reshape(newest, (-1, 5)), rtol=1e-5, atol=1e-5
        )


def test_a_full_table_stays_full_where_a_tenth_of_the_steps_ends_a_run() -> None:
    replay = NStepReplay(1000, 7, 2, 1, 5, GAMMA)
    for t in range(400):
        add(replay, t, tuple(Step(t, t + 1, 0.0, "cut" if t % 10 == slot else "go") for slot in range(7)))
        assert len(replay) == min(1000, replay.gathered)


def test_where_every_step_breaks_a_run_fewer_are_held_and_all_are_whole() -> None:
    replay = NStepReplay(200, 2, 2, 1, 3, GAMMA)
    for t in range(400):
        add(replay, t, (Step(2 * t, 2 * t + 1, 1.0, "cut" if t % 3 else "jump"),) * 2)
        stored = values(replay.stored())
        assert [row[0] for row in stored] == [2.0 * row[1] for row in stored]
        assert all(row[4] == 2.0 * row[1] + (1.0 if row[1] % 3 else 3.0) for row in stored)
    assert 50 < len(replay) < 200


def simple(replay: NStepReplay, value: float, end: bool = False, after: float | None = None) -> None:
    """One step of a single slot whose observation, action and reward are all `value`."""
    row = np.array([[value]], np.float32)
    then = row + 1 if after is None else np.array([[after]], np.float32)
    replay.add(row, row, row[0], then, np.array([end]), np.array([False]))


def test_the_ring_keeps_the_newest() -> None:
    replay = NStepReplay(5, 1, 1, 1, 1, 0.5)
    for value in range(13):
        simple(replay, float(value))
    assert len(replay) == 5
    assert replay.stored().observation[:, 0].tolist() == [8.0, 9.0, 10.0, 11.0, 12.0]


def test_no_window_outlives_a_drop() -> None:
    replay = NStepReplay(9, 1, 1, 1, 3, 0.5)
    for value in (0.0, 1.0, 2.0, 3.0):
        simple(replay, value)
    replay.drop_open()
    for value in (10.0, 11.0, 12.0):
        simple(replay, value)
    assert replay.stored().observation[:, 0].tolist() == [0.0, 1.0, 10.0]
    assert replay.stored().reward.tolist() == [1.0, 2.75, 18.5]


def test_samples_are_uniform_and_belong_together() -> None:
    replay = NStepReplay(8, 1, 1, 1, 1, 0.5)
    for value in range(4):
        simple(replay, float(value), end=value == 3)
    batch = replay.sample(40_000, np.random.default_rng(0))
    counts = np.bincount(batch.observation[:, 0].int().numpy(), minlength=4)
    # four standard deviations of a binomial count
    assert np.abs(counts - 10_000).max() < 4 * np.sqrt(40_000 * 0.25 * 0.75)
    assert batch.observation[:, 0].equal(batch.reward)
    assert batch.next_observation.equal(batch.observation + 1)
    assert batch.discount.equal(0.5 * (batch.reward != 3.0).float())


def test_same_seed_same_sample() -> None:
    replay = NStepReplay(8, 1, 1, 1, 1, 0.5)
    for value in range(8):
        simple(replay, float(value))
    first, again, other = (replay.sample(64, np.random.default_rng(seed)) for seed in (3, 3, 4))
    assert first.observation.equal(again.observation)
    assert not first.observation.equal(other.observation)


def test_halves_are_the_nearest_and_stay_finite() -> None:
    replay = NStepReplay(8, 1, 1, 1, 1, 0.5, np.float16)
    simple(replay, 1.0 / 3.0, after=1e6)
    simple(replay, -np.inf, after=0.25)
    stored = replay.stored()
    assert stored.observation.tolist() == [[float(np.float16(1.0 / 3.0))], [-65504.0]]
    assert stored.next_observation.tolist() == [[65504.0], [0.25]]
    assert stored.reward[0].item() == np.float32(1.0 / 3.0)


def test_no_sample_of_nothing() -> None:
    with pytest.raises(ValueError, match="empty"):
        NStepReplay(8, 1, 1, 1, 1, 0.5).sample(1, np.random.default_rng(0))


def test_capacity_must_hold_one_step_of_all_slots() -> None:
    with pytest.raises(InputError, match=r"capacity is 9, expected at least 10 \(2 slots times 5 steps\)"):
        NStepReplay(9, 2, 1, 1, 5, 0.5)


def test_a_million_transitions_at_the_reference_layout_fit_in_two_gigabytes() -> None:
    assert table_bytes(1_000_000, 64, 627, 2, 5, np.float16) < 2e9
