"""Learning with QR-SAC: a bandit with a known answer, going on after a stop, actions."""

from __future__ import annotations

import logging
from dataclasses import replace
from pathlib import Path
from statistics import median

import numpy as np
import pytest
import torch
from pydantic import ValidationError
from safetensors.torch import load, save
from torch import Tensor

from nathlon.policies.qrsac.config import QRSACConfig
from nathlon.policies.qrsac.learner import QRSAC
from nathlon.policies.qrsac.networks import Perceptron
from nathlon.policies.qrsac.update import Update
from nathlon.policies.replay_buffer.table import Batch
from nathlon.sim.errors import InputError
from tests.support.qrsac import ACTION, OBSERVATION, batches, config, learner

pytestmark = pytest.mark.takes_long


def test_bfloat16_stays_near_float32() -> None:
    """Both learners move from the same start by nearly the same way; parameters stay float32.

    In the median of some seeds: in one of them the lower critic may be the other one.
    """
    apart: dict[str, list[float]] = {"policy": [], "critic": [], "target": []}
    for seed in range(5):
        full, fast = (
            learner(seed, precision=precision, hidden=(64, 64), critic_rate=1e-3, policy_rate=1e-3)
            for precision in ("float32", "bfloat16")
        )
        start = full.state_dict()
        for batch in batches(20):
            full.update(batch)
            fast.update(batch)
        ends, others = full.state_dict(), fast.state_dict()
        for name, shares in apart.items():
            shares.append(float((ends[name] - others[name]).norm() / (ends[name] - start[name]).norm()))
            assert others[name].dtype == torch.float32
    assert all(0.0 < median(shares) < 0.1 for shares in apart.values())


def test_bfloat16_tells_large_returns_apart() -> None:
    """Returns near 100, where bfloat16 has every other half, come within a fraction of that of float32's."""
    generator = torch.Generator().manual_seed(1)
    full = Perceptron((12, 256, 256, 32), (2,), layer_norm=True)
    parameters = full.initial(generator)
    weight, _ = full.tensors(parameters)[-2:]
    weight.add_(1.0)
    inputs = torch.randn((512, 12), generator=generator).expand(2, -1, -1)
    exact = full(parameters, inputs)
    assert 64.0 < exact.median() < 128.0
    error = replace(full, precision=torch.bfloat16)(parameters, inputs) - exact
    assert 0.0 < error.square().mean().sqrt() < 0.05


def test_annealing_goes_on_after_a_resume() -> None:
    changes = {"updates": 6, "final_rates": 0.1, "final_alpha": 0.1}
    whole, first = (learner(**changes) for _ in range(2))  # type: ignore[arg-type]
    for batch in batches(6):
        whole.update(batch)
    for batch in batches(6)[:3]:
        first.update(batch)
    second = learner(seed=99, **changes)  # type: ignore[arg-type]
    second.load_state_dict(load(save(first.state_dict())))
    for batch in batches(6)[3:]:
        second.update(batch)
    assert all(tensor.equal(second.state_dict()[name]) for name, tensor in whole.state_dict().items())


@pytest.mark.parametrize("name", ["final_rates", "final_alpha"])
def test_annealing_without_an_end_is_refused(name: str) -> None:
    with pytest.raises(InputError, match=f"{name} is below 1, which needs the count of updates of the run"):
        learner(**{name: 0.1})  # type: ignore[arg-type]


@pytest.mark.parametrize(("column", "wrong"), [("reward", np.nan), ("observation", np.inf)])
def test_numbers_that_are_not_finite_show_in_the_metrics(column: str, wrong: float) -> None:
    qrsac = learner()
    first, second = batches(2)
    assert np.isfinite([float(value) for value in qrsac.update(first).values()]).all()
    getattr(second, column)[3] = wrong
    assert not np.isfinite([float(value) for value in qrsac.update(second).values()]).all()


def huber_quantile(level: float, chance: float) -> float:
    """Where the expected quantile Huber loss is least if the return is 10 with that chance and else 0."""
    if level <= 1.0 - chance:
        return chance * level / ((1.0 - chance) * (1.0 - level))
    return 10.0 - (1.0 - chance) * (1.0 - level) / (chance * level)


def test_a_bandit_is_learnt() -> None:
    """The return is 10 with chance 0.3 on the left and 0.8 on the right, else 0."""
    settings = QRSACConfig(hidden=(32,), quantiles=8, critic_rate=1e-2, policy_rate=3e-3)
    qrsac = QRSAC(1, 1, settings, torch.Generator().manual_seed(0), compiled=False)
    random = torch.Generator().manual_seed(1)
    blank = torch.zeros(1024, 1)
    for _ in range(300):
        action = torch.randint(2, (1024, 1), generator=random) - 0.5
        chance = torch.where(action[:, 0] < 0.0, 0.3, 0.8)
        reward = 10.0 * (torch.rand(1024, generator=random) < chance)
        qrsac.update(Batch(blank, action, reward, torch.zeros(1024), blank))
    critic = qrsac.state_dict()["critic"]
    for side, chance_of_ten in ((-0.5, 0.3), (0.5, 0.8)):
        found = Update(1, 1, settings).returns(critic, torch.zeros(1, 1), torch.full((1, 1), side))
        levels = (np.arange(8) + 0.5) / 8
        expected = torch.tensor([huber_quantile(level, chance_of_ten) for level in levels])
        torch.testing.assert_close(found.squeeze(1), expected.expand(2, 8).float(), rtol=0.0, atol=0.5)
    assert qrsac.act(np.zeros((1, 1), np.float32), stochastic=False)[0, 0] > 0.3


def test_resuming_changes_nothing() -> None:
    first = learner()
    for batch in batches(3):
        first.update(batch)
    second = learner(seed=99)
    second.load_state_dict(load(save(first.state_dict())))
    for batch in batches(3, seed=5):
        metrics, others = first.update(batch), second.update(batch)
        assert all(metrics[name].equal(others[name]) for name in metrics)
    assert all(tensor.equal(second.state_dict()[name]) for name, tensor in first.state_dict().items())
    observations = np.ones((3, OBSERVATION), np.float32)
    np.testing.assert_array_equal(first.act(observations, True), second.act(observations, True))


def test_a_state_taken_stays_as_it_was() -> None:
    qrsac = learner()
    before = qrsac.state_dict()
    copies = {name: tensor.clone() for name, tensor in before.items()}
    qrsac.update(batches(1)[0])
    assert all(tensor.equal(copies[name]) for name, tensor in before.items())


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"critic": None}, "tensor 'critic' is missing"),
        ({"other": torch.zeros(1)}, "tensor 'other' is unknown"),
        ({"policy": torch.zeros(3)}, r"tensor 'policy' is \(3,\) torch.float32, expected"),
        ({"generator": torch.zeros_like(torch.Generator().get_state())}, "tensor 'generator': "),
        ({"step": torch.zeros(())}, r"tensor 'step' is \(\) torch.float32, expected \(\) torch.float64"),
    ],
)
def test_a_foreign_state_is_refused(change: dict[str, Tensor | None], message: str) -> None:
    tensors = learner().state_dict() | change
    with pytest.raises(InputError, match=message):
        learner().load_state_dict({name: t for name, t in tensors.items() if t is not None})


def test_without_a_compiler_it_says_so_and_goes_on(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    with caplog.at_level(logging.WARNING):
        qrsac = learner(compiled=True)
    assert "no C++ compiler found" in caplog.text
    metrics, expected = (each.update(batches(1)[0]) for each in (qrsac, learner()))
    assert metrics["critic_loss"].equal(expected["critic_loss"])


def test_actions_are_made_without_dropout() -> None:
    observations = np.random.default_rng(0).standard_normal((9, OBSERVATION)).astype(np.float32)
    for stochastic in (False, True):
        with_dropout, without = (learner(dropout=share).act(observations, stochastic) for share in (0.9, 0.0))
        np.testing.assert_array_equal(with_dropout, without)
    assert with_dropout.dtype == np.float32
    assert with_dropout.shape == (9, ACTION)
    assert np.abs(with_dropout).max() <= 1.0


def test_actions_do_not_depend_on_the_precision_of_training() -> None:
    observations = np.random.default_rng(0).standard_normal((9, OBSERVATION)).astype(np.float32)
    for stochastic in (False, True):
        full, fast = (
            learner(precision=name).act(observations, stochastic) for name in ("float32", "bfloat16")
        )
        np.testing.assert_array_equal(full, fast)


def test_same_seed_same_updates() -> None:
    first, again, other = (learner(seed) for seed in (0, 0, 1))
    for batch in batches(2):
        metrics = [each.update(batch)["policy_loss"] for each in (first, again, other)]
        assert metrics[0].equal(metrics[1])
        assert not metrics[0].equal(metrics[2])


def test_policy_tensors_give_the_actions() -> None:
    qrsac = learner()
    tensors = qrsac.policy_tensors()
    assert list(tensors) == ["0.weight", "0.bias", "1.weight", "1.bias", "2.weight", "2.bias"]
    observations = np.random.default_rng(0).standard_normal((9, OBSERVATION)).astype(np.float32)
    layer = np.maximum(observations @ tensors["0.weight"] + tensors["0.bias"], 0.0)
    layer = np.maximum(layer @ tensors["1.weight"] + tensors["1.bias"], 0.0)
    mean = (layer @ tensors["2.weight"] + tensors["2.bias"])[:, :ACTION]
    np.testing.assert_allclose(np.tanh(mean), qrsac.act(observations, stochastic=False), atol=1e-6)


@pytest.mark.parametrize(
    "wrong",
    [
        {"hiden": (64,)},
        {"hidden": ()},
        {"hidden": (0,)},
        {"quantiles": 0},
        {"gamma": 1.5},
        {"alpha": float("nan")},
        {"dropout": 1.0},
        {"polyak": 0.0},
        {"critic_rate": -1e-3},
        {"precision": "float16"},
    ],
)
def test_a_wrong_configuration_is_refused(wrong: dict[str, object]) -> None:
    with pytest.raises(ValidationError, match=next(iter(wrong))):
        config(**wrong)
