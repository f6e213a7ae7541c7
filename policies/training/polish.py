"""Polishing: the last layer of a trained policy is moved by evolution strategies.

Salimans et al., "Evolution strategies as a scalable alternative to reinforcement learning" (2017). In each
round candidates, pairs of opposite changes to the weights, all drive the same races; what they earn there, by
rank, says in which direction to move. Nothing is estimated but by driving: critics do not tell apart actions
that are worth a few thousandths of a lap.

The races are those of a training configuration, in its proportions but for demonstrations, and what counts is
its reward, summed over `HORIZON_S` without discount. Only the price on swinging the steering does not: it is
there because critics do not see what that costs.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.stats import rankdata

from policies.checkpoint import (
    NetworkPolicy,
    checkpoint_id,
    load_checkpoint,
    read_checkpoint,
    save_checkpoint,
)
from policies.heat import Heat
from policies.mlp import Mlp
from policies.replay_tables import apportion
from policies.training.config import Rollouts, TrainingConfig
from policies.training.evaluation import LapEvaluation, evaluate_laps
from policies.training.polish_state import PolishState, load_state, save_state, write_curve
from policies.training.population import Population
from policies.training.rewards import Reward
from policies.training.rollout import STUCK_S, learners_of, scenario_of
from sim.episode import Episodes
from sim.errors import InputError

CANDIDATES = 64
RACES = 8
"""Of each candidate in a round."""
HORIZON_S = 60.0
DEVIATION = np.array([0.02, 0.0075])
"""Of the candidates' pedals and steering from the policy's, before they are squashed."""
RATE, FINAL_RATE = 0.1, 0.01
"""Of Adam, in spreads of the candidates' weights, at first and at the end; it falls by half a cosine."""
CHECKPOINT_EVERY = 25

Array = NDArray[np.float64]
Act = Callable[[NDArray[np.float32]], NDArray[np.float32]]


class Trial:
    """Races of one scenario of a configuration, the same ones for every candidate."""

    def __init__(
        self, config: TrainingConfig, rollouts: Rollouts, count: int, checkpoint: Path, threads: int
    ) -> None:
        """Races yet to be started.

        Args:
            config: of which the rollouts are a part.
            rollouts: scenario, learners and opponents; `self` and `past` are the policy as it was.
            count: races of each candidate.
            checkpoint: what is polished.
            threads: on which the world works.

        Raises:
            InputError: if the races cannot be made.
        """
        self._count = count
        self._episodes = Episodes(
            config.circuit, config.car, scenario_of(rollouts), count * CANDIDATES, threads, STUCK_S
        )
        self._length = round(HORIZON_S / self._episodes.step_s)
        learners = learners_of(rollouts, self._episodes.scenario.cars)
        self._population = Population(rollouts.opponents or config.opponents, config.circuit, config.car)
        policy = load_checkpoint(checkpoint)
        self._population.meet(policy, (checkpoint,), np.random.default_rng(0))  # nothing to choose from
        self._heat = Heat(
            self._episodes, learners.tolist(), policy.observation_spec, self._population.policies
        )
        weights = config.reward.model_copy(update={"steering": 0.0})
        self._reward = Reward(weights, self._episodes.world.track)

    @property
    def scenario(self) -> str:
        """Name of the scenario."""
        return self._episodes.scenario.name

    @property
    def steps(self) -> int:
        """Steps of the candidates' cars in a round, all together."""
        return len(self._heat.races) * self._length

    def earn(self, act: Act, rng: np.random.Generator) -> Array:
        """What each candidate earns in each of its cars, (CANDIDATES, cars).

        Args:
            act: actions (n, 2) for observations (n, size), those of the first candidate's cars first.
            rng: draws starts and opponents.
        """
        self._start(rng)
        state, mine = self._episodes.world.state, (self._heat.races, self._heat.cars)
        state["finish"] = np.inf  # so that who is faster goes farther, not home
        self._episodes.limit_s[:] = np.inf
        earned = np.zeros(len(self._heat.races))
        for _ in range(self._length):
            before = state.copy()
            self._heat.step(act(self._heat.seen))
            components = self._reward.components(
                before, state, self._episodes.contacts, self._episodes.contact_races
            )
            earned += np.where(before["driving"], self._reward.total(components), 0.0)[mine]
        return earned.reshape(CANDIDATES, -1)

    def _start(self, rng: np.random.Generator) -> None:
        others = self._heat.others
        if others:
            who = self._population.draw(self._count * others, rng).reshape(self._count, others)
            self._heat.seat(range(CANDIDATES * self._count), np.tile(who, (CANDIDATES, 1)))
        seeds = rng.integers(2**63, size=self._count).tolist() * CANDIDATES
        self._heat.start(range(len(seeds)), map(np.random.default_rng, seeds))


class Round(NamedTuple):
    """Where polishing stands: rounds done, and the mean reward a race of the last one's candidates."""

    rounds: int
    reward: float


class Polish:
    """A checkpoint in the course of being polished, in a folder of its own.

    Attributes:
        rounds: those done.
    """

    def __init__(
        self, checkpoint: Path, config: TrainingConfig, folder: Path, rounds: int, seed: int
    ) -> None:
        """Polishing at its beginning, or where it stopped in the folder.

        Args:
            checkpoint: the policy.
            config: what it drives, and what counts.
            folder: for checkpoints, curve and state.
            rounds: of the whole.
            seed: of all that is drawn.

        Raises:
            InputError: if the checkpoint cannot be read or is for another circuit or car, the races cannot be
                made, or the folder holds something else.
        """
        self.card, self._tensors = read_checkpoint(checkpoint)
        self._network = load_checkpoint(checkpoint).network
        for name in ("circuit", "car"):
            if getattr(config, name) != getattr(self.card, name):
                raise InputError(
                    f"{checkpoint}: {name} is {getattr(self.card, name)}, expected {getattr(config, name)}, "
                    "as in the training configuration"
                )
        self._folder, self._total, self._seed = folder, rounds, seed
        own = [rollouts for rollouts in config.rollouts if not rollouts.demonstrators]
        if not own:
            raise InputError(f"{checkpoint}: all rollouts of the training configuration are demonstrations")
        counts = apportion(RACES, [rollouts.share or 1.0 for rollouts in own])
        self._trials = [
            Trial(config, rollouts, count, checkpoint, os.cpu_count() or 1)
            for rollouts, count in zip(own, counts, strict=True)
            if count
        ]
        self._facts = {
            "checkpoint": checkpoint_id(checkpoint),
            "configuration": config.model_dump_json(),
            "rounds": str(rounds),
            "seed": str(seed),
        }
        weight, _ = self._network.layers[-1]
        self._state = load_state(folder, self._facts, weight.shape) or PolishState.initial(weight.shape)

    @property
    def rounds(self) -> int:
        """Rounds done."""
        return int(self._state.rounds[0])

    def run(self, on_round: Callable[[Round], None]) -> None:
        """All rounds to the end, or until KeyboardInterrupt; what is done is kept either way.

        Raises:
            InputError: if a file cannot be written.
        """
        spread = DEVIATION / self._features_norm()
        while self.rounds < self._total:
            reward = self._round(spread)
            if self.rounds % CHECKPOINT_EVERY == 0 or self.rounds == self._total:
                self._checkpoint(reward)
            save_state(self._folder, self._state, self._facts)
            on_round(Round(self.rounds, reward))

    def _features_norm(self) -> float:
        """That of what the last layer weighs, as the policy drives; few odd moments do not count."""
        norms = []

        def act(seen: NDArray[np.float32]) -> NDArray[np.float32]:
            norms.append(np.linalg.norm(self._network.features(seen), axis=1))
            return self._network(seen)

        for trial in self._trials:
            trial.earn(act, self._rng(0))
        return float(np.median(np.concatenate(norms)))

    def _rng(self, turn: int) -> np.random.Generator:
        return np.random.default_rng([self._seed, turn])

    def _round(self, spread: Array) -> float:
        """Move the weights once, with candidates so far around; their mean reward a race."""
        state, rng = self._state, self._rng(self.rounds + 1)
        noise = rng.standard_normal((CANDIDATES // 2, *state.change.shape))
        noise = np.concatenate([noise, -noise])
        act = self._candidates(state.change + noise * spread)
        earned = np.concatenate([trial.earn(act, rng) for trial in self._trials], axis=1)
        done = self.rounds / self._total
        rate = FINAL_RATE + (RATE - FINAL_RATE) * (0.5 + 0.5 * np.cos(np.pi * done))
        self._state = state.moved(ascent(earned, noise), rate * spread)
        return float(earned.mean())

    def _candidates(self, changes: Array) -> Act:
        """Drives the cars of candidate after candidate, each with its change (units, 2) to the weights."""
        weight, bias = self._network.layers[-1]
        weights = (weight + changes).astype(np.float32)

        def act(seen: NDArray[np.float32]) -> NDArray[np.float32]:
            features = self._network.features(seen)
            sums = features.reshape(len(weights), -1, features.shape[1]) @ weights
            return np.tanh(sums + bias).reshape(len(seen), -1)

        return act

    def _checkpoint(self, reward: float) -> None:
        tensors = dict(self._tensors)
        last = f"{len(self.card.hidden)}.weight"
        tensors[last] = tensors[last].copy()
        tensors[last][:, : self._state.change.shape[1]] += self._state.change.astype(np.float32)
        scenarios = (*self.card.scenarios, *(trial.scenario for trial in self._trials))
        card = self.card.model_copy(
            update={
                "algorithm": f"{self.card.algorithm}, polished",
                "scenarios": tuple(dict.fromkeys(scenarios)),
                "transitions": self.card.transitions
                + self.rounds * sum(trial.steps for trial in self._trials),
                "created_by": {**self.card.created_by, "nathlon": version("nathlon")},
            }
        )
        path = self._folder / "checkpoints" / f"round-{self.rounds:05d}.safetensors"
        try:
            save_checkpoint(path, tensors, card)
        except OSError as error:
            raise InputError(f"{path}: cannot be written: {error.strerror}") from None
        laps = self._laps(NetworkPolicy(card, "", tensors).network)
        self._state = self._state.noted(reward, laps)
        write_curve(self._folder, self._state)

    def _laps(self, network: Mlp) -> LapEvaluation:
        return evaluate_laps(self.card.circuit, self.card.car, self.card.observation, network, self._seed)


def ascent(earned: Array, noise: Array) -> Array:
    """The direction in which candidates earn more, of the shape of one's noise.

    Args:
        earned: (candidates, races); in each race only their order counts.
        noise: (candidates, ..), standard normal.
    """
    worth = (rankdata(earned, axis=0) - 0.5 * (len(earned) + 1)).mean(axis=1) / len(earned)
    return np.tensordot(worth, noise, axes=1) / len(earned)
