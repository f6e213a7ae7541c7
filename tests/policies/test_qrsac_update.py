"""One update of QR-SAC against its definition and an independent implementation of it."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
import torch
from torch import Tensor, nn
from torch.distributions import Normal, TransformedDistribution
from torch.distributions.transforms import TanhTransform

from nathlon.policies.qrsac.dropout import dropout_factors
from nathlon.policies.qrsac.networks import squashed_normal
from nathlon.policies.qrsac.update import State, Update, annealed, quantile_huber_loss
from tests.support.qrsac import ACTION, OBSERVATION, ROWS, batches, config, learner, noise_of, state_of

CPU = torch.device("cpu")


def plain_loss(estimates: Tensor, targets: Tensor) -> Tensor:
    """The quantile Huber loss of one critic (n, m), pair by pair as Dabney et al. write it."""
    total = torch.zeros(())
    count = estimates.shape[1]
    for j in range(count):
        level = (2 * j + 1) / (2 * count)
        for i in range(targets.shape[1]):
            huber = nn.functional.huber_loss(estimates[:, j], targets[:, i], reduction="none")
            weight = (level - (targets[:, i] < estimates[:, j]).float()).abs()
            total = total + (weight * huber).mean() / targets.shape[1]
    return total


def test_quantile_loss_and_gradient_are_those_of_the_definition() -> None:
    random = torch.Generator().manual_seed(0)
    estimates = (2.0 * torch.randn(2, 7, 5, generator=random)).requires_grad_()
    targets = 2.0 * torch.randn(7, 4, generator=random)
    expected = plain_loss(estimates[0], targets) + plain_loss(estimates[1], targets)
    (slope,) = torch.autograd.grad(expected, estimates)
    loss, gradient = quantile_huber_loss(estimates.detach(), targets)
    torch.testing.assert_close(loss, expected.detach())
    torch.testing.assert_close(gradient, slope)


def test_log_density_is_that_of_a_squashed_normal() -> None:
    random = torch.Generator().manual_seed(0)
    outputs = 0.5 * torch.randn(50, 2 * ACTION, generator=random, dtype=torch.float64)
    noise = torch.randn(50, ACTION, generator=random, dtype=torch.float64)
    actions, log_density = squashed_normal(outputs, noise)
    mean, log_std = outputs.chunk(2, -1)
    reference = TransformedDistribution(Normal(mean, log_std.exp()), [TanhTransform()])
    expected = reference.log_prob(actions).sum(-1)  # type: ignore[no-untyped-call]
    torch.testing.assert_close(log_density, expected, rtol=1e-8, atol=1e-8)


def test_covariance_is_clipped() -> None:
    noise = torch.ones(1, 1)
    for log_std, least in ((50.0, 2.0), (-50.0, -20.0)):
        action, density = squashed_normal(torch.tensor([[0.0, log_std]]), noise)
        expected, its_density = squashed_normal(torch.tensor([[0.0, least]]), noise)
        assert action.equal(expected)
        assert density.equal(its_density)
        assert torch.isfinite(density).all()


def test_each_target_uses_the_critic_with_the_smaller_mean_there() -> None:
    update = Update(OBSERVATION, ACTION, config(alpha=0.3))
    state = state_of(learner())
    target = torch.randn(state.target.shape, generator=torch.Generator().manual_seed(0))
    state = state._replace(critic=torch.full_like(target, torch.nan), target=target)
    (batch,), noise = batches(1), noise_of(2)
    outputs = update.policy(state.policy, batch.next_observation)
    action, log_density = squashed_normal(outputs, noise.next_action)
    both = update.returns(state.target, batch.next_observation, action)
    chosen = set()
    for row, found in enumerate(update.targets(state, update.pace(0, CPU).alpha, batch, noise)):
        critic = int(both[:, row].mean(-1).argmin())
        chosen.add(critic)
        soft = both[critic, row] - 0.3 * log_density[row]
        torch.testing.assert_close(found, batch.reward[row] + batch.discount[row] * soft)
    assert chosen == {0, 1}


def test_a_true_end_leaves_only_the_reward() -> None:
    update = Update(OBSERVATION, ACTION, config(alpha=5.0))
    batch = batches(1)[0]._replace(discount=torch.zeros(ROWS))
    targets = update.targets(state_of(learner()), torch.tensor(5.0), batch, noise_of(2))
    assert targets.equal(batch.reward[:, None].expand(-1, 6))


def module(inputs: int, outputs: int) -> nn.ModuleList:
    widths = (inputs, 8, 12, outputs)
    return nn.ModuleList(nn.Linear(*pair) for pair in pairwise(widths))


def forward(layers: nn.ModuleList, inputs: Tensor, kept: Tensor | None = None) -> Tensor:
    factors = torch.split(kept, [8, 12], -1) if kept is not None else (torch.ones(()),) * 2
    for layer, factor in zip(layers[:-1], factors, strict=True):
        inputs = torch.relu(layer(inputs)) * factor
    return layers[-1](inputs)


def fill(layers: nn.ModuleList, tensors: list[Tensor]) -> None:
    for layer, weight, bias in zip(layers, tensors[::2], tensors[1::2], strict=True):
        layer.load_state_dict({"weight": weight.T, "bias": bias.flatten()})


@pytest.mark.parametrize("bound", [0.05, 1000.0])
def test_updates_equal_those_of_modules_and_optimisers(bound: float) -> None:
    """The same updates with torch.nn, torch.optim.Adam and clip_grad_norm_."""
    settings = config(gradient_norm=bound, alpha=0.2, polyak=0.1)
    update = Update(OBSERVATION, ACTION, settings)
    state = state_of(learner())
    policy = module(OBSERVATION, 2 * ACTION)
    critics, targets = ([module(OBSERVATION + ACTION, 6) for _ in range(2)] for _ in range(2))
    fill(policy, update.policy.tensors(state.policy))
    for copies in (critics, targets):
        for i, layers in enumerate(copies):
            fill(layers, [tensor[i] for tensor in update.critics.tensors(state.critic)])
    critic_parameters = [p for layers in critics for p in layers.parameters()]
    critic_adam = torch.optim.Adam(critic_parameters, lr=settings.critic_rate)
    policy_adam = torch.optim.Adam(policy.parameters(), lr=settings.policy_rate)

    for i, batch in enumerate(batches(4)):
        noise = noise_of(i)
        with torch.no_grad():
            state, metrics = update(state, update.pace(i, CPU), batch, noise)
            action, log_density = squashed_normal(forward(policy, batch.next_observation), noise.next_action)
            inputs = torch.cat((batch.next_observation, action), -1)
            both = torch.stack([forward(layers, inputs) for layers in targets])
            smaller = both[both.mean(-1).argmin(0), torch.arange(ROWS)]
            samples = batch.reward[:, None] + batch.discount[:, None] * (smaller - 0.2 * log_density[:, None])
        inputs = torch.cat((batch.observation, batch.action), -1)
        loss = plain_loss(forward(critics[0], inputs), samples) + plain_loss(
            forward(critics[1], inputs), samples
        )
        critic_adam.zero_grad()
        torch.autograd.backward(loss)
        norm = nn.utils.clip_grad_norm_(critic_parameters, bound)
        critic_adam.step()

        assert noise.seed is not None
        kept = dropout_factors(noise.seed, (ROWS, 20), settings.dropout)
        action, log_density = squashed_normal(forward(policy, batch.observation, kept), noise.action)
        inputs = torch.cat((batch.observation, action), -1)
        value = torch.stack([forward(layers, inputs).mean(-1) for layers in critics]).amin(0)
        policy_loss = (0.2 * log_density - value).mean()
        policy_adam.zero_grad()
        torch.autograd.backward(policy_loss)
        policy_adam.step()
        with torch.no_grad():
            for critic, target in zip(critics, targets, strict=True):
                for new, old in zip(critic.parameters(), target.parameters(), strict=True):
                    old.lerp_(new, settings.polyak)

        torch.testing.assert_close(metrics["critic_loss"], loss.detach())
        torch.testing.assert_close(metrics["policy_loss"], policy_loss.detach())
        torch.testing.assert_close(metrics["entropy"], -log_density.mean().detach())
        torch.testing.assert_close(metrics["gradient_norm"], norm)
        assert bool(norm > bound) == (bound < 1.0)

    for copies, parameters in ((critics, state.critic), (targets, state.target)):
        for i, layers in enumerate(copies):
            expected = module(OBSERVATION + ACTION, 6)
            fill(expected, [tensor[i] for tensor in update.critics.tensors(parameters)])
            torch.testing.assert_close(layers.state_dict(), expected.state_dict(), rtol=1e-4, atol=1e-5)
    expected = module(OBSERVATION, 2 * ACTION)
    fill(expected, update.policy.tensors(state.policy))
    torch.testing.assert_close(policy.state_dict(), expected.state_dict(), rtol=1e-4, atol=1e-5)


def settled(state: State, critics: list[nn.ModuleList], update: Update) -> list[Tensor]:
    """Fills the modules with the critics of a state; returns their parameters."""
    for i, layers in enumerate(critics):
        fill(layers, [tensor[i] for tensor in update.critics.tensors(state.critic)])
    return [parameter for layers in critics for parameter in layers.parameters()]


def test_without_distribution_it_is_soft_actor_critic() -> None:
    """Half the mean squared error to the smaller target value, and the step that Adam makes on it."""
    settings = config(distributional=False, gradient_norm=1e6, alpha=0.2)
    update = Update(OBSERVATION, ACTION, settings)
    state = state_of(learner(distributional=False))
    target = torch.randn(state.target.shape, generator=torch.Generator().manual_seed(0))
    state = state._replace(target=target)
    critics, targets = ([module(OBSERVATION + ACTION, 1) for _ in range(2)] for _ in range(2))
    parameters = settled(state, critics, update)
    settled(state._replace(critic=target), targets, update)
    adam = torch.optim.Adam(parameters, lr=settings.critic_rate)
    (batch,), noise = batches(1), noise_of(2)
    with torch.no_grad():
        new, metrics = update(state, update.pace(0, CPU), batch, noise)
        outputs = update.policy(state.policy, batch.next_observation)
        action, log_density = squashed_normal(outputs, noise.next_action)
        inputs = torch.cat((batch.next_observation, action), -1)
        first, second = (forward(layers, inputs)[:, 0] for layers in targets)
        soft = torch.minimum(first, second) - 0.2 * log_density
        sought = batch.reward + batch.discount * soft
    assert (first < second).any()
    assert (first > second).any()
    inputs = torch.cat((batch.observation, batch.action), -1)
    loss = torch.stack([0.5 * (forward(layers, inputs)[:, 0] - sought).square().mean() for layers in critics])
    torch.autograd.backward(loss.sum())
    torch.testing.assert_close(metrics["critic_loss"], loss.sum().detach())
    slopes = [parameter.grad for parameter in parameters if parameter.grad is not None]
    torch.testing.assert_close(metrics["gradient_norm"], nn.utils.get_total_norm(slopes))
    adam.step()
    for i, layers in enumerate(critics):
        expected = module(OBSERVATION + ACTION, 1)
        fill(expected, [tensor[i] for tensor in update.critics.tensors(new.critic)])
        torch.testing.assert_close(layers.state_dict(), expected.state_dict())


def test_layer_norm_is_that_of_torch() -> None:
    """Values of the critics and the norm of their gradient with torch.nn.LayerNorm; the policy has none."""
    update = Update(OBSERVATION, ACTION, config(layer_norm=True, gradient_norm=1e6))
    state = state_of(learner(layer_norm=True))
    critics = [module(OBSERVATION + ACTION, 6) for _ in range(2)]
    parameters = settled(state, critics, update)
    networks = []
    for first, second, last in critics:
        norms = (nn.LayerNorm(width, elementwise_affine=False) for width in (8, 12))
        networks.append(nn.Sequential(first, next(norms), nn.ReLU(), second, next(norms), nn.ReLU(), last))
    (batch,), noise = batches(1), noise_of(2)
    inputs = torch.cat((batch.observation, batch.action), -1)
    expected = torch.stack([network(inputs) for network in networks])
    found = update.returns(state.critic, batch.observation, batch.action)
    torch.testing.assert_close(found, expected.detach())
    samples = update.targets(state, update.pace(0, CPU).alpha, batch, noise)
    _, metrics = update(state, update.pace(0, CPU), batch, noise)
    loss = plain_loss(expected[0], samples) + plain_loss(expected[1], samples)
    slopes = torch.autograd.grad(loss, parameters)
    torch.testing.assert_close(metrics["critic_loss"], loss.detach())
    torch.testing.assert_close(metrics["gradient_norm"], nn.utils.get_total_norm(slopes))
    policy = module(OBSERVATION, 2 * ACTION)
    fill(policy, update.policy.tensors(state.policy))
    outputs = update.policy(state.policy, batch.observation)
    torch.testing.assert_close(outputs, forward(policy, batch.observation).detach())


def test_what_is_annealed_falls_by_half_a_cosine_and_stays() -> None:
    made = [0, 25, 50, 75, 100, 130]
    quarter = 0.5 - np.sqrt(0.125)
    left = np.array([1.0, 1.0 - 0.9 * quarter, 0.55, 0.1 + 0.9 * quarter, 0.1, 0.1])
    np.testing.assert_allclose([annealed(3.0, 0.1, count, 100) for count in made], 3.0 * left)
    assert annealed(3.0, 1.0, 50, 100) == 3.0


def test_an_update_uses_the_rates_of_its_time() -> None:
    """After half of a run, the step of a learner with the constant rates of that time."""
    falling = Update(OBSERVATION, ACTION, config(final_rates=0.1), updates=20)
    constant = Update(OBSERVATION, ACTION, config(critic_rate=5.5e-3, policy_rate=5.5e-3))
    state = state_of(learner())
    (batch,), noise = batches(1), noise_of(2)
    with torch.no_grad():
        (found, _), (expected, _) = (
            each(state, each.pace(10, CPU), batch, noise) for each in (falling, constant)
        )
    for name in ("critic", "policy"):
        assert not getattr(found, name).equal(getattr(state, name))
        torch.testing.assert_close(getattr(found, name), getattr(expected, name))


def test_an_update_uses_alpha_of_its_time() -> None:
    falling = Update(OBSERVATION, ACTION, config(alpha=0.4, final_alpha=0.5), updates=20)
    constant = Update(OBSERVATION, ACTION, config(alpha=0.3))
    state = state_of(learner())
    (batch,), noise = batches(1), noise_of(2)
    with torch.no_grad():
        (_, found), (_, expected) = (
            each(state, each.pace(10, CPU), batch, noise) for each in (falling, constant)
        )
    torch.testing.assert_close(found, expected)
