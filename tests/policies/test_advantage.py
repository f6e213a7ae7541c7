"""Advantages in a group, and the loss that follows them."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import norm

from nathlon.policies.mlp import Mlp
from nathlon.policies.policy import Policy, StatelessPolicy
from nathlon.policies.training.actor import LEAST_SLOPE, UTMOST, Actor, Saturating
from nathlon.policies.training.advantage import OUTLYING, advantages, discounted
from nathlon.policies.training.lessons import study
from nathlon.policies.training.proximal import CLIP, improve, proximal_loss
from nathlon.policies.training.trial import Driven
from nathlon.sim.observation import ObservationSpec

NONE = np.zeros(32)
"""Charges."""


def drawn(seed: int, *shape: int) -> np.ndarray:
    return np.random.default_rng(seed).standard_normal(shape)


def test_discounted_returns() -> None:
    returns = discounted(np.ones((50, 2)), 0.9)
    np.testing.assert_allclose(returns[:, 1], (1.0 - 0.9 ** np.arange(50, 0, -1)) / 0.1)
    late = np.zeros((3, 1))
    late[2] = 8.0
    assert discounted(late, 0.5).ravel().tolist() == [2.0, 4.0, 8.0]


@given(st.integers(0, 2**32), st.floats(-1e4, 1e4), st.floats(0.01, 1e3))
def test_neither_the_start_nor_units_matter(seed: int, start: float, unit: float) -> None:
    returns, motion = drawn(seed, 3, 32), drawn(seed + 1, 3, 32, 4)
    found = advantages(returns, NONE, motion)
    np.testing.assert_allclose(advantages(returns + start, NONE, motion * unit + start), found, atol=1e-6)


def test_what_motion_explains_is_no_advantage() -> None:
    """Of returns that are a plane over motion and what the action brought, the latter is left."""
    motion, brought = drawn(0, 200, 32, 4), 0.1 * drawn(1, 200, 32)
    returns = 50.0 + motion @ np.array([3.0, -2.0, 0.5, 1.0]) + brought
    found = advantages(returns, NONE, motion)
    assert np.corrcoef(found.ravel(), brought.ravel())[0, 1] > 0.9
    assert np.corrcoef((returns - returns.mean(axis=1, keepdims=True)).ravel(), brought.ravel())[0, 1] < 0.1
    still = advantages(returns, NONE, np.zeros_like(motion))  # of motion that says nothing the mean is left
    np.testing.assert_allclose(still, returns - returns.mean(axis=1, keepdims=True), atol=0.01)


def test_one_crash_does_not_drown_the_others() -> None:
    returns, motion = drawn(0, 1, 32), np.zeros((1, 32, 1))
    crashed = returns.copy()
    crashed[0, 5] = -1e6
    found = advantages(crashed, NONE, motion)
    assert found.min() == found[0, 5]
    assert found[0, 5] > -2.0 * OUTLYING
    np.testing.assert_allclose(
        np.delete(found - found[0, 0], 5), np.delete(returns - returns[0, 0], 5), atol=1e-6
    )


def test_charges_count_beside_what_motion_explains() -> None:
    returns, motion = drawn(0, 50, 32), drawn(1, 50, 32, 4)
    charges = np.zeros((50, 32))
    charges[:, 3], charges[:, 4] = -8.0, -1e6
    brought = advantages(returns, charges, motion) - advantages(returns, NONE, motion)
    brought -= brought[:, :1]
    np.testing.assert_allclose(brought[:, 5:], 0.0, atol=1e-9)
    held = brought[:, 4] / (1.5 * np.median(abs(returns - np.median(returns, axis=1)[:, None]), axis=1))
    np.testing.assert_allclose(brought[:, 3], -8.0)
    np.testing.assert_allclose(held, -OUTLYING)


def test_the_loss_begins_as_the_policy_gradient() -> None:
    noise, advantage = torch.from_numpy(drawn(0, 64, 2)), torch.from_numpy(drawn(1, 64))
    moved = torch.zeros(64, 2, dtype=torch.float64, requires_grad=True)
    (gradient,) = torch.autograd.grad(proximal_loss(moved, noise, advantage), moved)
    torch.testing.assert_close(gradient, -noise * advantage[:, None] / 64)


def test_the_loss_is_the_ratio_of_normal_densities_clipped() -> None:
    moved = torch.tensor([[0.05, -0.02], [1.0, 0.0], [1.0, 0.0]], dtype=torch.float64)
    noise = torch.tensor([[1.0, 0.3], [2.0, 0.0], [2.0, 0.0]], dtype=torch.float64)
    advantage = torch.tensor([2.0, 1.0, -1.0], dtype=torch.float64)
    density = [norm.pdf(actions.numpy()).prod(axis=1) for actions in (noise, noise - moved)]
    ratio = torch.from_numpy(density[1] / density[0])
    expected = -(2.0 * ratio[0] + (1.0 + CLIP) - ratio[2]) / 3.0
    torch.testing.assert_close(proximal_loss(moved, noise, advantage), expected)


@given(st.floats(-8.0, 8.0), st.sampled_from([-1.0, 1.0]))
def test_what_saturates_can_be_unlearnt(at: float, push: float) -> None:
    """The slope is the tangent's, but never so small that a pedal stays down for good."""
    sums = torch.tensor([at], dtype=torch.float64, requires_grad=True)
    means = Saturating.apply(sums)
    assert means.item() == pytest.approx(np.tanh(at))
    (slope,) = torch.autograd.grad(push * means.sum(), sums)
    own = 1.0 - np.tanh(at) ** 2
    outward = push * at < 0.0  # a loss with this slope falls that way
    assert push * slope.item() == pytest.approx(
        own if outward and abs(np.tanh(at)) > UTMOST else max(own, LEAST_SLOPE)
    )


DEVIATION = (0.04, 0.015)


def learner() -> Actor:
    widths = (5, 16, 2)
    layers = [
        (drawn(i, a, b).astype(np.float32) * 0.3, np.zeros(b, np.float32))
        for i, (a, b) in enumerate(pairwise(widths))
    ]
    return Actor(Mlp(tuple(layers), "relu", "tanh"))


def driving(network: Callable[[np.ndarray], np.ndarray]) -> Policy:
    return StatelessPolicy(ObservationSpec(), network)


def some(work: Actor) -> Driven:
    """Actions of which those with less steering brought more."""
    seen, noise = drawn(7, 500, 5).astype(np.float32), drawn(8, 500, 2).astype(np.float32)
    memory = np.zeros((len(seen), 0), np.float32)
    return Driven(seen, memory, work.network(seen), noise, -noise[:, 1], np.full_like(noise, np.nan))


def test_the_policy_moves_to_what_brought_more() -> None:
    work = learner()
    driven = some(work)
    for _ in range(5):
        improve(work, [driven], DEVIATION, 1e-4, 8192, np.random.default_rng(0))
    moved = (work.network(driven.seen) - driven.means) / DEVIATION
    assert moved[:, 1].mean() < -0.02
    assert abs(moved[:, 0].mean()) < 0.5 * abs(moved[:, 1].mean())


def test_the_policy_moves_to_what_the_teacher_does_and_stays_elsewhere() -> None:
    work, origin = learner(), learner().network
    driven = some(work)
    driven.lesson[:100] = 0.5
    driven.seen[:100] += 10.0
    for _ in range(100):
        study(work, driving(origin), [driven], 2e-3, 256, np.random.default_rng(0))
    before, after = origin(driven.seen), work.network(driven.seen)
    assert np.abs(after - 0.5)[:100].mean() < 0.1 * np.abs(before - 0.5)[:100].mean()
    assert np.abs(after - before)[100:].mean() < 0.1 * np.abs(after - before)[:100].mean()


def test_who_has_moved_goes_back_to_where_it_was_before_its_lessons() -> None:
    work, origin = learner(), learner().network
    driven = some(work)
    for _ in range(5):
        improve(work, [driven], DEVIATION, 1e-3, 64, np.random.default_rng(0))
    apart = np.abs(work.network(driven.seen) - origin(driven.seen)).mean()
    driven.lesson[:50] = origin(driven.seen[:50])
    for _ in range(25):
        study(work, driving(origin), [driven], 1e-3, 64, np.random.default_rng(0))
    assert np.abs(work.network(driven.seen) - origin(driven.seen)).mean() < 0.2 * apart


def test_without_lessons_nothing_is_learnt() -> None:
    work = learner()
    assert study(work, driving(work.network), [some(work)], 1e-3, 64, np.random.default_rng(0)) == 0


@pytest.mark.parametrize("steps", [0, 1])
def test_going_on_from_its_tensors_is_the_same(steps: int) -> None:
    work, other = learner(), learner()
    driven = some(work)
    for _ in range(steps):
        improve(work, [driven], DEVIATION, 1e-3, 8192, np.random.default_rng(0))
    other.load(work.tensors())
    for each in (work, other):
        improve(each, [driven], DEVIATION, 1e-3, 8192, np.random.default_rng(1))
    assert np.array_equal(work.network(driven.seen), other.network(driven.seen))
    with pytest.raises(ValueError, match=r"parameter\.0' is missing"):
        other.load({})
    with pytest.raises(ValueError, match=r"parameter\.0"):
        other.load({**work.tensors(), "parameter.0": torch.zeros(1)})
