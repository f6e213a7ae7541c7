"""Rollout workers: all rollouts of a configuration, stepped together by one acting policy."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from nathlon.policies.policy import Batch
from nathlon.policies.qrsac.networks import Perceptron, act
from nathlon.policies.training.config import TrainingConfig
from nathlon.policies.training.rewards import Rewards
from nathlon.policies.training.rollout import Rollout, Step
from nathlon.sim.observation import ObservationSpec


@dataclass
class Tally:
    """What happened in some steps of rollouts.

    Attributes:
        laps: lap times driven, s.
        steps: steps of single cars.
        driven_s, off_course_s: time driven by the learner's cars, and that off course, s.
        components: sum of each component of the reward over those steps, unweighted.
    """

    laps: list[float] = field(default_factory=list)
    steps: int = 0
    driven_s: float = 0.0
    off_course_s: float = 0.0
    components: dict[str, float] = field(default_factory=dict)

    def add(self, other: Tally) -> None:
        """Take in another tally."""
        self.laps += other.laps
        self.steps += other.steps
        self.driven_s += other.driven_s
        self.off_course_s += other.off_course_s
        for name, value in other.components.items():
            self.components[name] = self.components.get(name, 0.0) + value


class Experience(NamedTuple):
    """One step of one rollout: what its cars saw before (slots, size), and the step."""

    observation: NDArray[np.float32]
    step: Step

    @classmethod
    def join(cls, parts: Sequence[Experience]) -> Experience:
        """The experience of several rollouts as one of all their cars."""
        observations, steps = zip(*parts, strict=True)
        return cls(
            np.concatenate(observations),
            Step(*(np.concatenate(column) for column in zip(*steps, strict=True))),
        )


class CurrentPolicy:
    """The policy in training as an opponent: drives with the squashed mean of its actions."""

    id = "self"

    def __init__(self, observation_spec: ObservationSpec, network: Perceptron, parameters: Tensor) -> None:
        self.observation_spec = observation_spec
        self.parameters = parameters
        self._network = network

    def initial_memory(self, n: int) -> Batch:
        """No memory: (n, 0) float32."""
        return np.zeros((n, 0), np.float32)

    def act(self, observations: Batch, memory: Batch) -> tuple[Batch, Batch]:
        """Actions (n, 2) for observations (n, size); memory as it was."""
        return act(self._network, self.parameters, observations, None), memory


class Gathered(NamedTuple):
    """What one step of a worker brought: the experience of each rollout, and the tally of all."""

    experience: list[Experience]
    tally: Tally


class News(NamedTuple):
    """What workers are told now and then: the policy's parameters (p,), and the checkpoints so far."""

    parameters: NDArray[np.float32]
    past: tuple[Path, ...]


class RolloutWorker:
    """Steps all rollouts of a configuration."""

    def __init__(
        self, config: TrainingConfig, network: Perceptron, news: News, seed: np.random.SeedSequence
    ) -> None:
        """Rollouts at their start.

        Args:
            config: the training run.
            network: the policy that drives the learner's cars.
            news: its parameters to begin with.
            seed: of all that is drawn.

        Raises:
            InputError: if a rollout of the configuration cannot be made.
        """
        exploration, *streams = seed.spawn(1 + len(config.rollouts))
        self._generator = torch.Generator().manual_seed(int(exploration.generate_state(1)[0]))
        self._policy = CurrentPolicy(config.observation.spec(), network, torch.from_numpy(news.parameters))
        self._network = network
        self._rollouts = [
            Rollout(config, rollouts, np.random.default_rng(stream))
            for rollouts, stream in zip(config.rollouts, streams, strict=True)
        ]
        self.hear(news)

    def hear(self, news: News) -> None:
        """Act with these parameters from now on, and race against these checkpoints."""
        self._policy.parameters = torch.from_numpy(news.parameters)
        for rollout in self._rollouts:
            rollout.meet(self._policy, news.past)

    def step(self) -> Gathered:
        """Advance every rollout by one step."""
        seen = [rollout.observation for rollout in self._rollouts]
        actions = act(self._network, self._policy.parameters, np.concatenate(seen), self._generator)
        experience, tally, first = [], Tally(), 0
        for rollout, observation in zip(self._rollouts, seen, strict=True):
            step, components = rollout.step(actions[first : first + rollout.slots])
            first += rollout.slots
            experience.append(Experience(observation, step))
            tally.add(_tally(rollout, step, components))
        return Gathered(experience, tally)


def _tally(rollout: Rollout, step: Step, components: dict[str, Rewards]) -> Tally:
    """What happened in the last step of a rollout; demonstrations tell nothing of the learner."""
    laps, rollout.laps = rollout.laps, []
    driven_s, rollout.driven_s = rollout.driven_s, 0.0
    off_course_s, rollout.off_course_s = rollout.off_course_s, 0.0
    if rollout.demonstrated:
        return Tally()
    sums = {name: float(value[step.valid].sum()) for name, value in components.items()}
    return Tally(laps, int(step.valid.sum()), driven_s, off_course_s, sums)
