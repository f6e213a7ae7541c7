"""Rollout workers: all rollouts of a configuration, stepped together by one acting policy."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import chain
from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from nathlon.policies.policy import Batch, Observations
from nathlon.policies.qrsac.recurrent import Network, act
from nathlon.policies.training.config import Rollouts, TrainingConfig
from nathlon.policies.training.pairs import Pair, PairDraw
from nathlon.policies.training.rollout import Step
from nathlon.policies.training.stint import RolloutStint, RolloutTally
from nathlon.sim.observation import ObservationSpec


class Experience(NamedTuple):
    """One step of one rollout.

    Attributes:
        observation: (slots, size) what its cars saw before; with a camera (slots,) records.
        step: that followed.
        hidden: (slots, c) what the critics saw before instead; c is 0 if they see the same.
        memory: (slots, m) what the policy remembered before.
    """

    observation: Observations
    step: Step
    hidden: Batch
    memory: Batch

    @classmethod
    def join(cls, parts: Sequence[Experience]) -> Experience:
        """The experience of several rollouts as one of all their cars."""
        observations, steps, hidden, memory = zip(*parts, strict=True)
        return cls(
            np.concatenate(observations),
            Step(*(np.concatenate(column) for column in zip(*steps, strict=True))),
            np.concatenate(hidden),
            np.concatenate(memory),
        )


class CurrentPolicy:
    """The policy in training as an opponent: drives with the squashed mean of its actions."""

    id = "self"

    def __init__(self, observation_spec: ObservationSpec, network: Network, parameters: Tensor) -> None:
        self.observation_spec = observation_spec
        self.parameters = parameters
        self._network = network

    def initial_memory(self, n: int) -> Batch:
        """Zeros (n, m) float32; m is 0 without a memory."""
        return np.zeros((n, self._network.memory), np.float32)

    def act(self, observations: Observations, memory: Batch) -> tuple[Batch, Batch]:
        """Actions (n, 2) for observations, and memory (n, m) after them."""
        return act(self._network, self.parameters, observations, memory, None)


class Gathered(NamedTuple):
    """What one step of a worker brought: the experience of each rollout, and the tally of all."""

    experience: list[Experience]
    tally: RolloutTally


class News(NamedTuple):
    """What workers are told now and then: the policy's parameters (p,), and the checkpoints so far."""

    parameters: NDArray[np.float32]
    past: tuple[Path, ...]


class WorkerSetup(NamedTuple):
    """What rollout workers begin with.

    Attributes:
        config: the training run.
        pairs: of circuit and car to drive.
        network: the policy that drives the learner's cars.
        news: its parameters to begin with.
        seed: of all that is drawn.
    """

    config: TrainingConfig
    pairs: Sequence[Pair]
    network: Network
    news: News
    seed: np.random.SeedSequence


class RolloutWorker:
    """Steps all rollouts of a configuration."""

    def __init__(self, setup: WorkerSetup) -> None:
        """Rollouts at their start.

        Raises:
            InputError: if a rollout of the configuration cannot be made.
        """
        config, pairs, network, news, seed = setup
        exploration, *streams = seed.spawn(1 + len(config.rollouts))
        draw = PairDraw(pairs)
        self._generator = torch.Generator().manual_seed(int(exploration.generate_state(1)[0]))
        self._policy = CurrentPolicy(config.observation.spec(), network, torch.from_numpy(news.parameters))
        self._network = network
        self._worlds = [
            [RolloutStint(config, rollouts, draw, rng) for rng in _generators(stream, rollouts)]
            for rollouts, stream in zip(config.rollouts, streams, strict=True)
        ]
        self._memory = self._policy.initial_memory(
            sum(len(stint.observation) for stint in chain(*self._worlds))
        )
        self.hear(news)

    def hear(self, news: News) -> None:
        """Act with these parameters from now on, and race against these checkpoints."""
        self._policy.parameters = torch.from_numpy(news.parameters)
        for stint in chain(*self._worlds):
            stint.meet(self._policy, news.past)

    def step(self) -> Gathered:
        """Advance every rollout by one step."""
        seen = [stint.observation for stint in chain(*self._worlds)]
        before = self._memory
        actions, self._memory = act(
            self._network, self._policy.parameters, np.concatenate(seen), before, self._generator
        )
        experience, tally, first = [], RolloutTally(), 0
        for worlds in self._worlds:
            parts = []
            for stint in worlds:
                observation, hidden = stint.observation, stint.hidden
                own = slice(first, first + len(observation))
                step, happened = stint.step(actions[own])
                first = own.stop
                parts.append(Experience(observation, step, hidden, before[own]))
                self._memory[own][step.terminated | step.truncated | ~step.valid] = 0.0
                tally.add(happened)
            experience.append(Experience.join(parts) if len(parts) > 1 else parts[0])
        return Gathered(experience, tally)


def _generators(stream: np.random.SeedSequence, rollouts: Rollouts) -> list[np.random.Generator]:
    """One for each world of the rollouts; a single one has the stream to itself."""
    streams = [stream] if rollouts.worlds == 1 else stream.spawn(rollouts.worlds)
    return [np.random.default_rng(each) for each in streams]
