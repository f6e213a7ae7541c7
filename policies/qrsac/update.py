"""One update of QR-SAC as a function of tensors.

Wurman et al., "Outracing champion Gran Turismo drivers with deep reinforcement learning", Nature 602
(2022), Methods; the quantile loss is that of Dabney et al., "Distributional reinforcement learning with
quantile regression" (AAAI 2018).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import torch
from torch import Tensor

from nathlon.policies.qrsac.config import QRSACConfig
from nathlon.policies.qrsac.dropout import dropout_factors
from nathlon.policies.qrsac.gradients import gradient_and_value, pulled_back
from nathlon.policies.qrsac.networks import Perceptron, squashed_normal
from nathlon.policies.qrsac.recurrent import RecurrentNetwork
from nathlon.policies.replay_buffer.passages import PassageBatch, Windows
from nathlon.policies.replay_buffer.table import Batch

ADAM_DECAY = (0.9, 0.999)
ADAM_EPSILON = 1e-8

Metrics = dict[str, Tensor]
Minibatch = Batch | PassageBatch


class State(NamedTuple):
    """All that an update changes: flat parameter vectors and Adam's moments of them.

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


class Noise(NamedTuple):
    """The random numbers of one update.

    Attributes:
        action: (n, a) standard normal, for the actions of the policy update.
        next_action: (n, a) standard normal, for the actions of the targets.
        seed: (2,) int32, of the units dropped in the policy update; None without dropout.
    """

    action: Tensor
    next_action: Tensor
    seed: Tensor | None


class Pace(NamedTuple):
    """The scalars of one update, float32 tensors.

    They are made outside the compiled graph: within it they would be computed anew, powers and cosines, for
    each vector of parameters.

    Attributes:
        alpha: weight of the entropy bonus.
        critic, policy: Adam's step sizes, corrected for the start of its mean at zero.
        square: what Adam's mean square is divided by, for its start at zero, after the root is taken.
        average: share of the policy that is mixed into its running mean, which is the mean of all so far
            until there are enough.
    """

    alpha: Tensor
    critic: Tensor
    policy: Tensor
    square: Tensor
    average: Tensor


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
    levels = (torch.arange(count, device=estimates.device) + 0.5) * (1.0 / count)
    # This has a compiled graph write the targets down: they come of so much that it would write down all the
    # pairs instead, which are far more.
    targets = targets.as_strided(targets.shape, targets.stride())
    difference = targets[..., None] - estimates[..., None, :]
    clipped = difference.clamp(-1.0, 1.0)
    weighted = clipped * torch.where(difference < 0.0, 1.0 - levels, levels)
    # Over the targets first, as the gradient: both are then one pass over the pairs.
    losses = (weighted * (difference - 0.5 * clipped)).mean(-2)
    return losses.mean(1).sum(), -weighted.mean(-2) / len(targets)


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


def annealed(value: float, final: float, made: int, updates: int | None) -> float:
    """A number that falls by half a cosine, and then stays.

    Args:
        value: at the beginning.
        final: share of it that is left at the end; 1 is for one that never changes.
        made: count of updates so far.
        updates: after which the end is reached; None is for numbers that never change.
    """
    if final == 1.0 or updates is None:
        return value
    fallen = 0.5 - 0.5 * math.cos(math.pi * min(made / updates, 1.0))
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
        facts: int = 0,
    ) -> None:
        self.config = config
        self._updates = updates
        outputs = config.quantiles if config.distributional else 1
        encoder: tuple[int, ...] = ()
        seen = observation_size
        if config.encoder:
            encoder, seen = (facts, *config.encoder), observation_size - facts + config.encoder[-1]
        self.policy = Perceptron((seen, *config.hidden, 2 * action_size), encoder, precision=precision)
        self.critics = Perceptron(
            (seen + action_size, *config.hidden, outputs), encoder, (2,), config.layer_norm, precision
        )
        self._loss = quantile_huber_loss if config.distributional else squared_loss

    def returns(self, critics: Tensor, observation: Tensor, action: Tensor) -> Tensor:
        """Both critics' quantiles (their means for plain SAC) of the return, (2, n, m)."""
        return self.critics(critics, observation.expand(2, -1, -1), action.expand(2, -1, -1))

    def pace(self, made: int, device: torch.device) -> Pace:
        """The scalars of the update that follows those made."""
        config = self.config
        first, second = ADAM_DECAY
        step = made + 1
        correction = 1.0 - first**step
        scalars = (
            annealed(config.alpha, config.final_alpha, made, self._updates),
            annealed(config.critic_rate, config.final_rates, made, self._updates) / correction,
            0.0
            if made < config.policy_waits
            else annealed(config.policy_rate, config.final_rates, made, self._updates) / correction,
            math.sqrt(1.0 - second**step),
            max(1.0 / step, config.averaging),
        )
        return Pace(*torch.tensor(scalars, device=device).unbind())

    def targets(self, state: State, alpha: Tensor, batch: Minibatch, noise: Noise) -> Tensor:
        """Samples (n, m) of R + discount * (Z_k(s', a') - alpha log pi(a' | s')).

        k is, for each sample, the target critic with the smaller mean there; the entropy enters at the
        last step only. The policy runs in evaluation mode (no dropout).
        """
        action, log_density = squashed_normal(self._later(state.policy, batch), noise.next_action)
        first, second = self.returns(state.target, batch.next_observation, action)
        smaller = torch.where((first.mean(-1) <= second.mean(-1))[:, None], first, second)
        soft = smaller - alpha * log_density[:, None]
        return batch.reward[:, None] + batch.discount[:, None] * soft

    def policy_loss(
        self, policy: Tensor, critics: Tensor, alpha: Tensor, batch: Minibatch, noise: Noise
    ) -> tuple[Tensor, Tensor]:
        """The mean of alpha log pi - min Q, and the mean of log pi; the policy runs with dropout."""
        outputs = self._now(policy, batch, self._kept(noise.seed, len(batch.reward)))
        action, log_density = squashed_normal(outputs, noise.action)
        value = self.returns(critics, batch.observation, action).mean(-1).amin(0)
        return (alpha * log_density - value).mean(), log_density.mean()

    def _now(self, policy: Tensor, batch: Minibatch, kept: Tensor | None) -> Tensor:
        """The policy's outputs (n, 2a) at the beginning of the transitions."""
        return self.policy(policy, batch.observation, kept=kept)

    def _later(self, policy: Tensor, batch: Minibatch) -> Tensor:
        """The policy's outputs (n, 2a) at their end, without dropout."""
        return self.policy(policy, batch.next_observation)

    def _kept(self, seed: Tensor | None, count: int) -> Tensor | None:
        if seed is None:
            return None
        return dropout_factors(seed, (count, sum(self.config.hidden)), self.config.dropout)

    def __call__(self, state: State, pace: Pace, batch: Minibatch, noise: Noise) -> tuple[State, Metrics]:
        """The state after one update of critics, policy (against the new critics) and targets."""
        config = self.config
        targets = self.targets(state, pace.alpha, batch, noise)
        estimates, pull_back = pulled_back(
            lambda critics: self.returns(critics, batch.observation, batch.action), state.critic
        )
        critic_loss, slope = self._loss(estimates, targets)
        gradient = pull_back(slope)
        norm = gradient.square().sum().sqrt()
        gradient = gradient * (config.gradient_norm / norm.clamp(min=config.gradient_norm))
        critic, critic_mean, critic_square = _adam(
            state.critic, state.critic_mean, state.critic_square, gradient, pace.critic, pace.square
        )

        gradient, (policy_loss, log_density) = gradient_and_value(
            lambda policy: self.policy_loss(policy, critic, pace.alpha, batch, noise), state.policy
        )
        policy, policy_mean, policy_square = _adam(
            state.policy, state.policy_mean, state.policy_square, gradient, pace.policy, pace.square
        )

        target = torch.lerp(state.target, critic, config.polyak)
        average = torch.lerp(state.average, policy, pace.average)
        metrics = {
            "critic_loss": critic_loss,
            "policy_loss": policy_loss,
            "mean_q": estimates.mean(),
            "entropy": -log_density,
            "gradient_norm": norm,
        }
        new = State(policy, policy_mean, policy_square, critic, critic_mean, critic_square, target, average)
        return new, metrics

    def in_place(self, state: State, pace: Pace, batch: Minibatch, noise: Noise) -> Metrics:
        """One update that overwrites the state.

        Fresh memory for every update of wide networks costs more than their optimiser: the system must
        clear it and hand it out page by page.
        """
        new, metrics = self(state, pace, batch, noise)
        for old, fresh in zip(state, new, strict=True):
            old.copy_(fresh)
        return metrics


def windows_of(config: QRSACConfig) -> Windows:
    """How passages are cut."""
    return Windows(config.passage, config.recalled, config.n_step, config.gamma)


def passages_of(config: QRSACConfig) -> int:
    """How many passages have the transitions of a minibatch."""
    return max(config.batch // (config.passage - config.recalled), 1)


class PassageUpdate(Update):
    """The update of a policy that remembers, and that need not see what its critics see.

    The policy goes through whole passages, so that its memory learns what to keep; its critics know all that
    matters of each step (asymmetric actor-critic: Pinto et al., RSS 2018).
    """

    def __init__(
        self,
        observation_size: int,
        action_size: int,
        config: QRSACConfig,
        network: RecurrentNetwork,
        precision: torch.dtype = torch.float32,
        updates: int | None = None,
    ) -> None:
        """As `Update`; the critics take observation_size numbers, the policy is the network."""
        super().__init__(observation_size, action_size, config, precision, updates)
        self.network, self._windows = network, windows_of(config)

    def _now(self, policy: Tensor, batch: Minibatch, kept: Tensor | None) -> Tensor:
        assert isinstance(batch, PassageBatch), "it learns from passages"
        windows = self._windows
        seen = [part[:, : windows.length] for part in batch.seen]
        if kept is not None:
            kept = kept.view(len(batch.memory), -1, kept.shape[-1])
        return self.network(policy, seen, batch.memory, windows.recalled, kept).flatten(0, 1)

    def _later(self, policy: Tensor, batch: Minibatch) -> Tensor:
        assert isinstance(batch, PassageBatch), "it learns from passages"
        windows = self._windows
        outputs = self.network(policy, batch.seen, batch.memory, windows.recalled)
        return outputs[:, torch.from_numpy(windows.lasts - windows.recalled)].flatten(0, 1)
