"""Polishing: a trained policy goes on without critics, by what driving shows its actions to bring.

In each round many cars leave the same starts and drive with noise of their own. What each earns more than
others of its group is laid to its actions (`nathlon.policies.training.advantage`), and the policy moves
towards those that brought more (`nathlon.policies.training.proximal`).

With a teacher it learns from this one alone instead (`nathlon.policies.training.lessons`): each race has a
start of its own, and what it earns does not count.

The races are those of a training configuration, in its proportions but for demonstrations; what went wrong in
them is driven again in the shares of its `mistakes`. What counts is its reward, but for the price on swinging
the steering: it is there because critics do not see what that costs.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from nathlon.policies.checkpoint import (
    SeeingPolicy,
    checkpoint_id,
    open_checkpoint,
    read_checkpoint,
    save_checkpoint,
)
from nathlon.policies.policy import Policy, StatelessPolicy
from nathlon.policies.replay_buffer.tables import apportion
from nathlon.policies.training.actor import Actor
from nathlon.policies.training.config import TrainingConfig
from nathlon.policies.training.evaluation import evaluate_laps, mean_laps
from nathlon.policies.training.lessons import study
from nathlon.policies.training.pairs import PairDraw, ready_pairs
from nathlon.policies.training.polish_state import CURVE, PolishState, load_state, save_state, write_curve
from nathlon.policies.training.proximal import improve
from nathlon.policies.training.seeing_actor import SeeingActor
from nathlon.policies.training.state import STATE_FILE
from nathlon.policies.training.trial import Driven
from nathlon.policies.training.trial_pool import TrialPool, TrialSetup
from nathlon.sim.errors import InputError
from nathlon.sim.scenario import load_scenario
from nathlon.sim.whole_file import writing

STARTS = 16
"""Differing ones in a round."""
SIDE_BY_SIDE = 4
"""Of these on one pair in one trial."""
FINAL_RATE = 0.05
"""Share of Adam's rate that is left at the end; it falls by half a cosine."""
AVERAGED = 0.1
"""Weight of the last round in the average that is a checkpoint; the first ten rounds count alike."""
CHECKPOINT_EVERY = 10
POLISHED = ", polished"
"""What a card says behind its algorithm, once, however often it was."""


class Round(NamedTuple):
    """Where polishing stands: rounds done, and the mean reward of a car in the last one."""

    rounds: int
    reward: float


class Polish:
    """A checkpoint in the course of being polished, in a folder of its own.

    Attributes:
        rounds: those done.
        updates: of the policy in them.
        transitions: driven for them.
    """

    def __init__(
        self, checkpoint: Path, config: TrainingConfig, folder: Path, rounds: int, seed: int
    ) -> None:
        """Polishing at its beginning, or where it stopped in the folder.

        Args:
            checkpoint: the policy.
            config: what it drives, and what counts.
            folder: for checkpoints, curve and state.
            rounds: in all.
            seed: of all that is drawn.

        Raises:
            InputError: if the checkpoint cannot be read or is for another circuit or car, or the folder holds
                something else.
        """
        self.card, self._tensors = read_checkpoint(checkpoint)
        for name in ("circuit", "car"):
            if getattr(config, name) != getattr(self.card, name):
                raise InputError(
                    f"{checkpoint}: {name} is {getattr(self.card, name)}, expected {getattr(config, name)}, "
                    "as in the training configuration"
                )
        self._path, self._config = checkpoint, config
        self._folder, self._total, self._seed = folder, rounds, seed
        own = [rollouts for rollouts in config.rollouts if not rollouts.demonstrators]
        if not own:
            raise InputError(f"{checkpoint}: all rollouts of the training configuration are demonstrations")
        counts = apportion(STARTS, [rollouts.share or 1.0 for rollouts in own])
        self._races = [(rollouts, count) for rollouts, count in zip(own, counts, strict=True) if count]
        self._facts = {
            "checkpoint": checkpoint_id(checkpoint),
            "configuration": config.model_dump_json(exclude={"workers"}),
            "rounds": str(rounds),
            "seed": str(seed),
        }
        self._weights: NDArray[np.float64] | None = None
        self._origin = open_checkpoint(checkpoint)
        self._actor = (
            SeeingActor(self.card, self._tensors)
            if isinstance(self._origin, SeeingPolicy)
            else Actor(self._origin.network)
        )
        self.rounds = self.updates = self.transitions = 0
        self._curve = np.zeros((0, len(CURVE)))
        state = load_state(folder, self._facts)
        if state:
            self.rounds, self.updates, self.transitions = state.rounds, state.updates, state.transitions
            self._curve = state.curve
            try:
                self._actor.load(state.learner)
            except ValueError as error:
                raise InputError(f"{folder / STATE_FILE}: {error}") from None
            self._weights = state.weights

    def run(
        self, on_round: Callable[[Round], None], on_pair: Callable[[int, int], None] = lambda *_: None
    ) -> None:
        """All rounds to the end, or until KeyboardInterrupt; what is done is kept either way.

        Args:
            on_round: told of each round that is done.
            on_pair: told how many pairs of a variety are ready, and of how many.

        Raises:
            InputError: if the races cannot be made or a file cannot be written.
        """
        pairs, self._evaluated = ready_pairs(self._folder, self._config, on_pair)
        self._draw = PairDraw(pairs, self._weights)
        pool = TrialPool(self._config, self._path)
        try:
            self._rounds(pool, on_round)
        finally:
            pool.close()

    def _rounds(self, pool: TrialPool, on_round: Callable[[Round], None]) -> None:
        while self.rounds < self._total:
            reward = self._round(pool)
            if self.rounds % CHECKPOINT_EVERY == 0 or self.rounds == self._total:
                self._checkpoint(reward)
            save_state(
                self._folder,
                PolishState(
                    self.rounds,
                    self.updates,
                    self.transitions,
                    self._actor.tensors(),
                    self._draw.weights,
                    self._curve,
                ),
                self._facts,
            )
            on_round(Round(self.rounds, reward))

    def _round(self, pool: TrialPool) -> float:
        """Drive, and improve on it; the mean reward of a car."""
        rng = np.random.default_rng([self._seed, self.rounds])
        plans = self._plans(rng)
        drives = list(pool.drive(plans, self._policy))
        for plan, drive in zip(plans, drives, strict=True):
            if drive.alone:
                self._draw.note(plan.pair, drive.speed)
        driven = [each for drive in drives for each in drive.driven]
        left = 0.5 + 0.5 * math.cos(math.pi * self.rounds / self._total)
        rate = self._config.polish.rate * (FINAL_RATE + (1.0 - FINAL_RATE) * left)
        self.updates += self._learn(driven, rate, rng)
        self.rounds += 1
        self._actor.average(max(1.0 / self.rounds, AVERAGED))
        self.transitions += sum(drive.steps for drive in drives)
        return float(np.average([drive.reward for drive in drives], weights=[drive.cars for drive in drives]))

    @property
    def _policy(self) -> Policy:
        """As it is, to drive with."""
        if isinstance(self._actor, SeeingActor):
            return self._actor.policy
        return StatelessPolicy(self.card.observation, self._actor.network)

    def _learn(self, driven: Sequence[Driven], rate: float, rng: np.random.Generator) -> int:
        settings = self._config.polish
        if settings.teacher:
            return study(self._actor, self._origin, driven, rate, settings.batch, rng)
        return improve(self._actor, driven, settings.deviation, rate, settings.batch, rng)

    def _plans(self, rng: np.random.Generator) -> list[TrialSetup]:
        """The trials of a round; of a variety each start is on a pair of its own."""
        together = 1 if self._config.variety else SIDE_BY_SIDE
        return [
            TrialSetup(rollouts, self._draw.draw(rng), min(together, count - first), int(rng.integers(2**63)))
            for rollouts, count in self._races
            for first in range(0, count, together)
        ]

    def _checkpoint(self, reward: float) -> None:
        tensors = dict(self._tensors)
        for name, layer in self._actor.averages():
            tensors[name] = tensors[name].copy()
            tensors[name][..., : layer.shape[-1]] = layer  # the last one's deviations are left alone
        scenarios = (
            *self.card.scenarios,
            *(load_scenario(rollouts.scenario).name for rollouts, _ in self._races),
        )
        card = self.card.model_copy(
            update={
                "algorithm": self.card.algorithm.removesuffix(POLISHED) + POLISHED,
                "scenarios": tuple(dict.fromkeys(scenarios)),
                "step": self.card.step + self.updates,
                "transitions": self.card.transitions + self.transitions,
                "created_by": {**self.card.created_by, "nathlon": version("nathlon")},
            }
        )
        path = self._folder / "checkpoints" / f"round-{self.rounds:05d}.safetensors"
        with writing(path):
            save_checkpoint(path, tensors, card)
        policy = open_checkpoint(path)
        laps = mean_laps(evaluate_laps(pair, policy, self._seed) for pair in self._evaluated)
        row = [[self.rounds, card.step, card.transitions, reward, laps.lap_s, laps.off_course_share]]
        self._curve = np.concatenate([self._curve, row])
        write_curve(self._folder, CURVE, self._curve)
