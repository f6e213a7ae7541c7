"""One update of QR-SAC, and the learner that holds its state.

Wurman et al., "Outracing champion Gran Turismo drivers with deep reinforcement learning", Nature 602
(2022), Methods; the quantile loss is that of Dabney et al., "Distributional reinforcement learning with
quantile regression" (AAAI 2018).
"""

from __future__ import annotations

import logging
import shutil
from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from policies.qrsac.config import QRSACConfig
from policies.qrsac.networks import Perceptron, act, squashed_normal
from policies.replay import Batch
from sim.errors import InputError

log = logging.getLogger(__name__)

ADAM_DECAY = (0.9, 0.999)
ADAM_EPSILON = 1e-8

Metrics = dict[str, Tensor]


class State(NamedTuple):
    """All that an update changes: flat parameter vectors, Adam's moments of them, the count of updates.

    `target` follows the critics, `average` is the running mean of the policy.
    """

    policy: Tensor
    policy_mean: Tensor
    policy_square: Tensor
    critic: Tensor
    critic_mean: Tensor
    critic_square: Tensor
    target: Tensor
    average: Tensor
    step: Tensor


NETWORKS = ("policy", "critic", "target", "average")


class Noise(NamedTuple):
    """The random numbers of one update.

    Attributes:
        action: (n, a) standard normal, for the actions of the policy update.
        next_action: (n, a) standard normal, for the actions of the targets.
        kept: (n, sum of hidden widths) dropout factors of the policy update; None without dropout.
    """

    action: Tensor
    next_action: Tensor
    kept: Tensor | None


class Pace(NamedTuple):
    """The scalars of one update, float32 tensors.

    They are made outside the compiled graph: within it they would be computed anew, powers and cosines, for
    each vector of parameters.

    Attributes:
        alpha: weight of the entropy bonus.
        critic, policy: Adam's step sizes, corrected for the start of its mean at zero.
        square: what Adam's mean square is divided by, for its start at zero, after the root is taken.
    """

    alpha: Tensor
    critic: Tensor
    policy: Tensor
    square: Tensor


def quantile_huber_loss(estimates: Tensor, targets: Tensor) -> tuple[Tensor, Tensor]:
    """Quantile Huber loss with threshold 1 over all pairs of estimates and targets, and its gradient.

    It is averaged over the targets and the batch and *summed* over the quantiles estimated and the
    critics, as Dabney et al. do: the gradient of one quantile then does not shrink as quantiles are added.
    The bound on the gradient's norm refers to this sum.

    Args:
        estimates: (critics, n, m), the quantiles at (2j + 1) / 2m for j = 0 .. m - 1.
        targets: (n, m), samples of the distribution sought.

    Returns:
        the loss, and its gradient with respect to the estimates (critics, n, m). It is written out because
        automatic differentiation stores several numbers for each pair, which costs more than the networks.
    """
    count = estimates.shape[-1]
    levels = (torch.arange(count, device=estimates.device) + 0.5) / count
    difference = targets[:, None, :] - estimates[..., None]
    clipped = difference.clamp(-1.0, 1.0)
    weighted = clipped * torch.where(difference < 0.0, 1.0 - levels[:, None], levels[:, None])
    loss = (weighted * (difference - 0.5 * clipped)).mean((1, 3)).sum()
    return loss, -weighted.mean(-1) / len(targets)


def squared_loss(estimates: Tensor, targets: Tensor) -> tuple[Tensor, Tensor]:
    """Half the squared error, averaged over the batch and summed over the critics, and its gradient.

    Args:
        estimates: (critics, n, 1).
        targets: (n, 1).

    Returns:
        the loss, and its gradient with respect to the estimates.
    """
    error = estimates - targets
    return 0.5 * error.square().mean((1, 2)).sum(), error / len(targets)


def fast_precision(device: torch.device) -> torch.dtype:
    """The float format in which the device multiplies matrices fastest: float32 or bfloat16."""
    if device.type == "cuda":
        fast = torch.cuda.is_bf16_supported(including_emulation=False)
    else:
        fast = bool(torch.cpu.get_capabilities().get("avx512_bf16"))
    return torch.bfloat16 if fast else torch.float32


def annealed(value: float, final: float, made: Tensor, updates: int | None) -> Tensor | float:
    """A number that falls by half a cosine, and then stays.

    Args:
        value: at the beginning.
        final: share of it that is left at the end; 1 is for one that never changes.
        made: count of updates so far.
        updates: after which the end is reached; None is for numbers that never change.
    """
    if final == 1.0 or updates is None:
        return value
    fallen = 0.5 - 0.5 * torch.cos(torch.pi * (made / updates).clamp(max=1.0))
    return value * (1.0 - (1.0 - final) * fallen)


def _adam(
    parameters: Tensor, mean: Tensor, square: Tensor, gradient: Tensor, size: Tensor, scale: Tensor
) -> tuple[Tensor, Tensor, Tensor]:
    first, second = ADAM_DECAY
    mean = first * mean + (1.0 - first) * gradient
    square = second * square + (1.0 - second) * gradient.square()
    return parameters - size * mean / (square.sqrt() / scale + ADAM_EPSILON), mean, square


class Update:
    """The update as a pure function of tensors, so that one graph can hold all of it."""

    def __init__(
        self,
        observation_size: int,
        action_size: int,
        config: QRSACConfig,
        precision: torch.dtype = torch.float32,
        updates: int | None = None,
    ) -> None:
        self.config = config
        self._updates = updates
        outputs = config.quantiles if config.distributional else 1
        inputs = observation_size + action_size
        self.policy = Perceptron((observation_size, *config.hidden, 2 * action_size), precision=precision)
        self.critics = Perceptron(
            (inputs, *config.hidden, outputs), (2,), layer_norm=config.layer_norm, precision=precision
        )
        self._loss = quantile_huber_loss if config.distributional else squared_loss

    def returns(self, critics: Tensor, observation: Tensor, action: Tensor) -> Tensor:
        """Both critics' quantiles (their means for plain SAC) of the return, (2, n, m)."""
        inputs = torch.cat((observation, action), -1)
        return self.critics(critics, inputs.expand(2, -1, -1))

    def pace(self, made: Tensor) -> Pace:
        """The scalars of the update that follows those made."""
        config = self.config
        first, second = ADAM_DECAY
        step = made + 1.0
        correction = 1.0 / (1.0 - torch.pow(first, step))
        rates = (
            annealed(rate, config.final_rates, made, self._updates) * correction
            for rate in (config.critic_rate, config.policy_rate)
        )
        alpha = annealed(config.alpha, config.final_alpha, made, self._updates) * torch.ones_like(made)
        scalars = (alpha, *rates, torch.sqrt(1.0 - torch.pow(second, step)))
        return Pace(*(scalar.to(torch.float32) for scalar in scalars))

    def targets(self, state: State, alpha: Tensor, batch: Batch, noise: Noise) -> Tensor:
        """Samples (n, m) of R + discount * (Z_k(s', a') - alpha log pi(a' | s')).

        k is, for each sample, the target critic with the smaller mean there; the entropy enters at the
        last step only. The policy runs in evaluation mode (no dropout).
        """
        outputs = self.policy(state.policy, batch.next_observation)
        action, log_density = squashed_normal(outputs, noise.next_action)
        first, second = self.returns(state.target, batch.next_observation, action)
        smaller = torch.where((first.mean(-1) <= second.mean(-1))[:, None], first, second)
        soft = smaller - alpha * log_density[:, None]
        return batch.reward[:, None] + batch.discount[:, None] * soft

    def policy_loss(
        self, policy: Tensor, critics: Tensor, alpha: Tensor, batch: Batch, noise: Noise
    ) -> tuple[Tensor, Tensor]:
        """The mean of alpha log pi - min Q, and the mean of log pi; the policy runs with dropout."""
        outputs = self.policy(policy, batch.observation, noise.kept)
        action, log_density = squashed_normal(outputs, noise.action)
        value = self.returns(critics, batch.observation, action).mean(-1).amin(0)
        return (alpha * log_density - value).mean(), log_density.mean()

    def __call__(self, state: State, pace: Pace, batch: Batch, noise: Noise) -> tuple[State, Metrics]:
        """The state after one update of critics, policy (against the new critics) and targets."""
        config = self.config
        step = state.step + 1.0

        targets = self.targets(state, pace.alpha, batch, noise)
        estimates, pull_back, *_ = torch.func.vjp(
            lambda critics: self.returns(critics, batch.observation, batch.action), state.critic
        )
        critic_loss, slope = self._loss(estimates, targets)
        (gradient,) = pull_back(slope)
        norm = gradient.square().sum().sqrt()
        gradient = gradient * (config.gradient_norm / norm.clamp(min=config.gradient_norm))
        critic, critic_mean, critic_square = _adam(
            state.critic, state.critic_mean, state.critic_square, gradient, pace.critic, pace.square
        )

        gradient, (policy_loss, log_density) = torch.func.grad_and_value(self.policy_loss, has_aux=True)(
            state.policy, critic, pace.alpha, batch, noise
        )
        policy, policy_mean, policy_square = _adam(
            state.policy, state.policy_mean, state.policy_square, gradient, pace.policy, pace.square
        )

        target = torch.lerp(state.target, critic, config.polyak)
        # The mean of all so far, until there are enough.
        share = torch.clamp(1.0 / step, min=config.averaging).to(policy.dtype)
        average = torch.lerp(state.average, policy, share)
        metrics = {
            "critic_loss": critic_loss,
            "policy_loss": policy_loss,
            "mean_q": estimates.mean(),
            "entropy": -log_density,
            "gradient_norm": norm,
        }
        new = State(
            policy, policy_mean, policy_square, critic, critic_mean, critic_square, target, average, step
        )
        return new, metrics


def _compiled(update: Update) -> Callable[[State, Pace, Batch, Noise], tuple[State, Metrics]]:
    if not any(map(shutil.which, ("g++", "c++", "clang++"))):
        log.warning("no C++ compiler found: QR-SAC runs uncompiled, at about half the speed")
        return update
    return torch.compile(update.__call__, fullgraph=True, dynamic=False)


class QRSAC:
    """Quantile-regression soft actor-critic for actions in [-1, 1]."""

    def __init__(
        self,
        observation_size: int,
        action_size: int,
        config: QRSACConfig,
        generator: torch.Generator,
        compiled: bool = True,
        updates: int | None = None,
    ) -> None:
        """A learner with fresh networks on the generator's device.

        Args:
            observation_size: length of an observation.
            action_size: length of an action.
            config: hyperparameters.
            generator: the source of all randomness, advanced by updates and stochastic actions.
            compiled: whether to compile the update, if a C++ compiler is found; the first update then takes
                half a minute and a batch must always have the same size.
            updates: of the whole run, after which rates and alpha have fallen to their final shares.

        Raises:
            InputError: if something is to fall and the updates of the run are not given.
        """
        if updates is None and min(config.final_rates, config.final_alpha) < 1.0:
            name = "final_rates" if config.final_rates < 1.0 else "final_alpha"
            raise InputError(f"QR-SAC: {name} is below 1, which needs the count of updates of the run")
        self.config = config
        self.action_size = action_size
        self._generator = generator
        precision = (
            fast_precision(generator.device)
            if config.precision == "auto"
            else getattr(torch, config.precision)
        )
        self._update = Update(observation_size, action_size, config, precision, updates)
        self._run = _compiled(self._update) if compiled else self._update
        policy = self._update.policy.initial(generator)
        critic = self._update.critics.initial(generator)
        self._state = State(
            policy=policy,
            policy_mean=torch.zeros_like(policy),
            policy_square=torch.zeros_like(policy),
            critic=critic,
            critic_mean=torch.zeros_like(critic),
            critic_square=torch.zeros_like(critic),
            target=critic.clone(),
            average=policy.clone(),
            step=torch.zeros((), dtype=torch.float64, device=generator.device),
        )

    def update(self, batch: Batch) -> Metrics:
        """Learns from one batch.

        Returns:
            scalar tensors: critic_loss, policy_loss, mean_q (of the batch, before the update), entropy (of
            the policy, an estimate by its samples), gradient_norm (of both critics, before clipping).
        """
        with torch.no_grad():
            pace = self._update.pace(self._state.step)
            self._state, metrics = self._run(self._state, pace, batch, self._noise(len(batch.reward)))
        return metrics

    def _noise(self, count: int) -> Noise:
        action, next_action = self._normal(count), self._normal(count)
        if self.config.dropout == 0.0:
            return Noise(action, next_action, None)
        keep = 1.0 - self.config.dropout
        shape = (count, sum(self.config.hidden))
        uniform = torch.rand(shape, generator=self._generator, device=self._generator.device)
        return Noise(action, next_action, (uniform < keep) / keep)

    def _normal(self, count: int) -> Tensor:
        shape = (count, self.action_size)
        return torch.randn(shape, generator=self._generator, device=self._generator.device)

    @property
    def policy_network(self) -> Perceptron:
        """The policy as a function of its parameters, in full precision."""
        return replace(self._update.policy, precision=torch.float32)

    @property
    def policy_parameters(self) -> Tensor:
        """Parameters (p,) of the policy on the CPU; later updates leave them as they are."""
        return self._state.policy.cpu()

    @property
    def finite(self) -> bool:
        """Whether all parameters and moments are finite numbers."""
        return all(bool(tensor.isfinite().all()) for tensor in self._state)

    def act(self, observations: NDArray[np.float32], stochastic: bool) -> NDArray[np.float32]:
        """Actions (n, a) of the present policy drawn from the learner's generator, or of the mean policy."""
        if stochastic:
            return act(self._update.policy, self._state.policy, observations, self._generator)
        return act(self._update.policy, self._state.average, observations, None)

    def policy_tensors(self) -> dict[str, NDArray[np.float32]]:
        """The mean policy's weights (in, out) and biases (out,) by layer: `0.weight`, `0.bias`, `1.weight` ..

        The last layer gives the means, then the logarithms of the standard deviations.
        """
        tensors = self._update.policy.tensors(self._state.average)
        return {
            f"{i // 2}.{'bias' if i % 2 else 'weight'}": (tensor[0] if i % 2 else tensor).cpu().numpy()
            for i, tensor in enumerate(tensors)
        }

    def state_dict(self) -> dict[str, Tensor]:
        """All that an exact resume needs, the generator's state included, as named tensors."""
        return {**self._state._asdict(), "generator": self._generator.get_state()}

    def load_state_dict(self, tensors: dict[str, Tensor]) -> None:
        """Goes on from what `state_dict` of a learner of the same shape returned.

        Raises:
            InputError: naming the tensor that is missing, unknown or of another shape or type.
        """
        self._check(tensors)
        self._generator.set_state(tensors["generator"].cpu())
        self._state = State(*(tensors[name].to(self._generator.device) for name in State._fields))

    def load_networks(self, tensors: dict[str, Tensor]) -> None:
        """Takes policy, critics and targets from what `state_dict` of a learner of the same shape returned.

        Adam's moments, the count of updates and the generator stay as they are.

        Raises:
            InputError: naming the tensor that is missing, unknown or of another shape or type.
        """
        self._check(tensors)
        networks = {name: tensors[name].to(self._generator.device) for name in NETWORKS}
        self._state = self._state._replace(**networks)

    def _check(self, tensors: dict[str, Tensor]) -> None:
        expected = self.state_dict()
        if set(tensors) != set(expected):
            name = sorted(set(tensors) ^ set(expected))[0]
            raise InputError(
                f"training state: tensor {name!r} is {'missing' if name in expected else 'unknown'}"
            )
        for name, old in expected.items():
            new = tensors[name]
            if new.shape != old.shape or new.dtype != old.dtype:
                raise InputError(
                    f"training state: tensor {name!r} is {tuple(new.shape)} {new.dtype}, "
                    f"expected {tuple(old.shape)} {old.dtype}"
                )
