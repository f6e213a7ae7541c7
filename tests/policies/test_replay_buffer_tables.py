"""The tables' exact shares of a minibatch, what they refuse, and going on from a file."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from safetensors.torch import load_file, save_file
from torch import Tensor

from nathlon.policies.replay_buffer.table import NStepReplay
from nathlon.policies.replay_buffer.tables import ReplayTables, apportion, available_memory
from nathlon.sim.errors import InputError


def add_random(replay: NStepReplay, rng: np.random.Generator) -> None:
    """A step of random numbers; a tenth of them ends a run."""
    state = replay.state_dict()
    slots, width = len(state["open"]), state["observation"].shape[1]
    before, after = rng.standard_normal((2, slots, width)).astype(np.float32)
    action, reward = rng.standard_normal((slots, 1)).astype(np.float32), rng.standard_normal(slots)
    terminated, truncated, skipped = rng.random((3, slots)) < 0.05
    replay.add(before, action, reward.astype(np.float32), after, terminated, truncated, ~skipped)


def tables(shares: tuple[float, ...] = (3.0, 1.0, 2.0), batch: int = 16) -> ReplayTables:
    return ReplayTables(120, (3, 1, 2), shares, batch, 3, 1, 4, 0.9)


def test_bytes_are_those_of_all_that_is_kept() -> None:
    replay = tables()
    for t in range(100):
        for table in replay.tables:
            add_random(table, np.random.default_rng(t))
    kept = replay.state_dict()
    assert replay.nbytes == sum(tensor.nbytes for name, tensor in kept.items() if not name.endswith("counts"))


@given(
    total=st.integers(0, 10_000),
    shares=st.lists(st.floats(0.01, 100), min_size=1, max_size=9),
)
def test_parts_are_the_shares_rounded_up_or_down(total: int, shares: list[float]) -> None:
    parts = apportion(total, shares)
    assert sum(parts) == total
    quotas = total * np.array(shares) / sum(shares)
    assert (np.abs(np.array(parts) - quotas) < 1 + 1e-9).all()


@pytest.mark.parametrize(
    ("total", "shares", "parts"),
    [
        (256, [0.5, 0.25, 0.25], [128, 64, 64]),
        (10, [1, 1, 1], [4, 3, 3]),
        (100, [0.07, 0.58, 0.35], [7, 58, 35]),
        # Hamilton's method as the textbooks show it: quotas 3.29, 2.42, 2.33, 1.96
        (10, [329, 242, 233, 196], [3, 3, 2, 2]),
    ],
)
def test_largest_remainders(total: int, shares: list[float], parts: list[int]) -> None:
    assert apportion(total, shares) == parts


def test_every_minibatch_has_the_exact_shares() -> None:
    replay = tables()
    assert replay.counts == [8, 3, 5]
    assert [table.capacity for table in replay.tables] == [60, 20, 40]
    rng = np.random.default_rng(0)
    for number, table in enumerate(replay.tables):
        for _ in range(10):
            row = np.full((len(table.state_dict()["open"]), 3), number, np.float32)
            no = np.zeros(len(row), np.bool_)
            table.add(row, row[:, :1], row[:, 0], row, no, no)
    for _ in range(5):
        batch = replay.sample(rng)
        assert batch.observation[:, 0].tolist() == [0] * 8 + [1] * 3 + [2] * 5
        assert batch.next_observation.equal(batch.observation)
        assert batch.action.equal(batch.observation[:, :1])


def test_an_empty_table_is_an_error_and_not_ready() -> None:
    replay = tables()
    rng = np.random.default_rng(0)
    for _ in range(20):
        add_random(replay.tables[0], rng)
        add_random(replay.tables[2], rng)
    assert len(replay) == len(replay.tables[0]) + len(replay.tables[2])
    assert not replay.ready(1)
    with pytest.raises(ValueError, match="empty"):
        replay.sample(rng)
    while not replay.ready(60):
        assert replay.tables[1].gathered < 10
        add_random(replay.tables[1], rng)
    replay.sample(rng)


def test_a_share_too_small_for_a_row_is_refused() -> None:
    with pytest.raises(InputError, match=r"batch of 16 are \(16, 0\) transitions, expected at least 1"):
        ReplayTables(120, (1, 1), (1.0, 0.001), 16, 3, 1, 4, 0.9)


def test_a_replay_larger_than_memory_is_refused() -> None:
    assert 2**27 < available_memory() < 2**50
    with pytest.raises(
        InputError, match=r"^replay: \d+ transitions need [\d,]+ bytes .* the [\d,]+ available$"
    ):
        ReplayTables(10**13, (1,), (1.0,), 16, 3, 1, 4, 0.9)


@pytest.mark.parametrize("steps", [0, 20, 90])
def test_a_run_goes_on_from_its_file_as_if_it_had_not_stopped(steps: int, tmp_path: Path) -> None:
    def play(replay: ReplayTables, first: int, last: int) -> list[Tensor]:
        drawn = []
        for t in range(first, last):
            for number, table in enumerate(replay.tables):
                add_random(table, np.random.default_rng([t, number]))
            if replay.ready(1):
                drawn += [tensor.clone() for tensor in replay.sample(np.random.default_rng(t))]
        return drawn

    whole, stopped, resumed = tables(), tables(), tables()
    play(whole, 0, steps)
    play(stopped, 0, steps)
    save_file(stopped.state_dict(), tmp_path / "replay.safetensors")
    play(resumed, 0, 7)  # what is loaded replaces all that was there
    resumed.load_state_dict(load_file(tmp_path / "replay.safetensors"))
    assert len(resumed) == len(whole)
    expected, found = (play(replay, steps, steps + 40) for replay in (whole, resumed))
    assert len(found) == len(expected) > 0
    assert all(map(torch.equal, found, expected))


def without(tensors: dict[str, Tensor]) -> None:
    del tensors["table.1.reward"]


def foreign(tensors: dict[str, Tensor]) -> None:
    tensors["table.3.reward"] = tensors["table.1.reward"]


def shorter(tensors: dict[str, Tensor]) -> None:
    tensors["table.1.reward"] = tensors["table.1.reward"][1:]


def larger(tensors: dict[str, Tensor]) -> None:
    tensors["table.1.observation"] = tensors["table.1.observation"].float()


def overfull(tensors: dict[str, Tensor]) -> None:
    tensors["table.1.counts"] = torch.tensor([3, 4, 0, 0])


def negative(tensors: dict[str, Tensor]) -> None:
    tensors["table.1.counts"] = torch.tensor([3, -4, 0, 0])


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (without, "table 1: replay: tensor 'reward' is missing"),
        (foreign, "replay: tensor 'table.3.reward' is unknown"),
        (shorter, r"tensor 'reward' is \(16,\) torch.float32, expected \(17,\) torch.float32"),
        (larger, r"tensor 'observation' is \(\d+, 3\) torch.float32, expected \(\d+, 3\) torch.float16"),
        (overfull, "tensor 'counts': 4 of 3 transitions stored"),
        (negative, "tensor 'counts': expected 4 whole numbers from 0 up"),
    ],
)
def test_a_file_that_does_not_fit_is_refused(
    spoil: Callable[[dict[str, Tensor]], None], message: str
) -> None:
    replay = tables()
    steps = 0
    while replay.tables[1].gathered < 17:
        add_random(replay.tables[1], np.random.default_rng(steps))
        steps += 1
    state = replay.state_dict()
    spoil(state)
    with pytest.raises(InputError, match=message):
        tables().load_state_dict(state)
