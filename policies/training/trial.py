"""Trials: races in groups that leave the same start, driven by one policy with differing noise.

What goes wrong is driven again by groups of its own, from shortly before, with bolder noise: it happens too
seldom to be learnt from otherwise, and too much alike.

Where cars are lost, noise of their own does not show the way back. A teacher says what to do there, if there
is one. Then each race has a start of its own: lessons want many places, not many tries.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from nathlon.policies.checkpoint import open_checkpoint
from nathlon.policies.environments.opponents import OpponentWrapper
from nathlon.policies.policy import Observations, Policy
from nathlon.policies.training.advantage import advantages, discounted
from nathlon.policies.training.config import Rollouts, TrainingConfig
from nathlon.policies.training.failures import Failure, Failures
from nathlon.policies.training.pairs import Pair
from nathlon.policies.training.population import Population
from nathlon.policies.training.rewards import CONTACTS, Reward
from nathlon.policies.training.rollout import STUCK_S, learners_of, scenario_of, tells_pace
from nathlon.policies.training.teacher import Teacher
from nathlon.sim.episode import Episodes
from nathlon.sim.instruments import Instruments

GROUP = 32
"""Races that leave the same start."""
HORIZON_S, AGAIN_S = 60.0, 25.0
"""Driven from a start, and again from before a failure."""
DISCOUNT = 0.985
"""Of a step: what follows within seven seconds counts, which is a bend and the straight after it."""
CONTACT_DISCOUNT = 0.95
"""The same of what contacts with cars cost: what was done in the two seconds before has led there."""
UNTOLD_S = 13.0
"""At the end, where too little follows to tell what an action brings."""
BOLDNESS, KEPT = 2.0, 0.8
"""Of the noise of those who drive again: in deviations, and the share of it that is left a step later."""
MOTION = ("x", "y", "yaw", "world_velocity_x", "world_velocity_y", "yaw_rate", "steering", "shifting")

Array = NDArray[np.float32]


class Driven(NamedTuple):
    """What was done in a trial, a row for each step of each car.

    Attributes:
        seen: (n, ..) observations.
        memory: (n, m) float32, what was remembered of what was before.
        means: (n, 2) float32, actions without noise.
        noise: (n, 2) float32, of the actions, in deviations; where it was bolder, over the square of the
            boldness, since that is what the gradient of its density goes by.
        advantage: (n,) float32, in deviations; nought with a teacher.
        lesson: (n, 2) float32, what the teacher would have done; nan where nobody asks.
    """

    seen: Observations
    memory: Array
    means: Array
    noise: Array
    advantage: Array
    lesson: Array


class Drive(NamedTuple):
    """What came of a trial.

    Attributes:
        driven: from the starts, and again if anything went wrong.
        reward: mean of a car from the starts, without discount.
        speed: mean progress on the course from the starts, m/s.
        steps: driven by the policy's cars, all together.
        cars: that the policy drove from the starts.
        alone: whether they drove alone and on the road, so that their speed tells of the pair.
    """

    driven: tuple[Driven, ...]
    reward: float
    speed: float
    steps: int
    cars: int
    alone: bool


class Trial:
    """Races of one scenario of a configuration."""

    def __init__(
        self, config: TrainingConfig, rollouts: Rollouts, pair: Pair, starts: int, checkpoint: Path
    ) -> None:
        """Races yet to be started.

        Args:
            config: of which the rollouts are a part.
            rollouts: scenario, learners and opponents.
            pair: circuit and car.
            starts: how many differing ones.
            checkpoint: drives where `self` and `past` do.

        Raises:
            InputError: if the races cannot be made.
        """
        scenario = scenario_of(rollouts, pair)
        self._deviation = np.array(config.polish.deviation, np.float32)
        self._starts, self._again = starts, round(rollouts.mistakes * starts)
        self._episodes = Episodes(pair.circuit, pair.car, scenario, starts * GROUP, 1, STUCK_S)
        learners = learners_of(rollouts, scenario.cars)
        opponents = (rollouts.opponents or config.opponents) if len(learners) < scenario.cars else ()
        self._population = Population(opponents, pair)
        policy = open_checkpoint(checkpoint)
        self._population.meet(policy, (checkpoint,), np.random.default_rng(0))  # nothing to choose from
        self._env = OpponentWrapper(
            self._episodes, learners.tolist(), policy.observation_spec, self._population.policies
        )
        weights = config.reward.model_copy(update={"steering": 0.0})
        world = self._episodes.world
        self._reward = Reward(weights, Instruments(world.track, world.car, self._episodes.step_s))
        self._cars, self._alone = len(self._env.races), tells_pace(scenario)
        teacher = config.polish.teacher
        self._teacher = Teacher(teacher, pair, self._env) if teacher else None

    def drive(self, policy: Policy, rng: np.random.Generator) -> Drive:
        """Drive all races once, with noise; then some again, from moments before what went wrong.

        Args:
            policy: drives, as its actions are without noise.
            rng: draws starts, opponents, noise, and what is driven again.
        """
        self._start(rng)
        failures = Failures(self._episodes, self._env.races, self._env.cars, rng) if self._again else None
        first = self._drive(HORIZON_S, policy, rng, failures=failures)
        again = failures.draw(self._again) if failures else []
        if not again:
            return first
        self._start_again(again)
        more = self._drive(AGAIN_S, policy, rng, BOLDNESS, KEPT)
        return first._replace(driven=first.driven + more.driven, steps=first.steps + more.steps)

    def _drive(
        self,
        length_s: float,
        policy: Policy,
        rng: np.random.Generator,
        boldness: float = 1.0,
        kept: float = 0.0,
        failures: Failures | None = None,
    ) -> Drive:
        """All races for so long, as they stand."""
        step_s = self._episodes.step_s
        length, until = round(length_s / step_s), round((length_s - UNTOLD_S) / step_s)
        shape = (length, self._cars)
        seen = np.empty((length, *self._env.seen.shape), self._env.seen.dtype)
        now = policy.initial_memory(self._cars)
        memory = np.empty((length, *now.shape), np.float32)
        means, lessons = np.empty((*shape, 2), np.float32), np.full((*shape, 2), np.nan, np.float32)
        noise = lasting(rng.standard_normal((*shape, 2), np.float32), kept)
        rewards, charges, driving = np.empty(shape), np.empty(shape), np.empty(shape, np.bool_)
        motion = np.empty((*shape, len(MOTION)))
        begun = self._progress
        for step in range(length):
            cars = self._episodes.world.state[self._env.races, self._env.cars]
            motion[step] = np.stack([cars[name] for name in MOTION], axis=-1)
            driving[step] = cars["driving"]
            seen[step], memory[step] = self._env.seen, now
            means[step], now = policy.act(self._env.seen, now)
            if self._teacher:
                lessons[step] = self._teacher.lesson(cars)
            rewards[step], charges[step] = self._step(
                np.clip(means[step] + boldness * self._deviation * noise[step], -1.0, 1.0)
            )
            if failures:
                failures.watch()
        reward = float((rewards + charges).sum(axis=0).mean())
        told = driving[:until]
        if self._teacher:
            advantage = np.zeros(int(told.sum()))
        else:
            returns, charges = discounted(rewards, DISCOUNT), discounted(charges, CONTACT_DISCOUNT)
            advantage = advantages(*(self._grouped(each[:until]) for each in (returns, charges, motion)))
            advantage = np.moveaxis(advantage, -1, 1).reshape(told.shape)[told]
            advantage /= np.maximum(advantage.std(), np.finfo(np.float32).tiny)
        seen, memory = seen[:until][told], memory[:until][told]
        means, noise, lessons = (each[:until][told] for each in (means, noise, lessons))
        driven = Driven(seen, memory, means, noise / boldness, advantage.astype(np.float32), lessons)
        speed = float((self._progress - begun).mean()) / length_s
        return Drive((driven,), reward, speed, int(driving.sum()), self._cars, self._alone)

    @property
    def _progress(self) -> NDArray[np.float64]:
        """Of the policy's cars, (cars,), m."""
        return self._episodes.world.state["progress"][self._env.races, self._env.cars]

    def _grouped(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """(steps, cars, ..) as (steps, starts and their cars, group, ..)."""
        steps, cars, *more = values.shape
        return np.swapaxes(values.reshape(steps, GROUP, cars // GROUP, *more), 1, 2)

    def _start(self, rng: np.random.Generator) -> None:
        others = self._env.others
        if others:
            who = self._population.draw(self._starts * others, rng).reshape(self._starts, others)
            self._env.seat(range(GROUP * self._starts), np.tile(who, (GROUP, 1)))
        differing = GROUP * self._starts if self._teacher else self._starts
        seeds = np.resize(rng.integers(2**63, size=differing), GROUP * self._starts).tolist()
        self._env.start(range(len(seeds)), map(np.random.default_rng, seeds))
        self._forget()
        self._episodes.world.state["finish"] = np.inf  # so that who is faster goes farther, not home
        self._episodes.limit_s[:] = np.inf

    def _start_again(self, failures: Sequence[Failure]) -> None:
        """Have a group begin at each of the moments, at most one a start; the other races stand still."""
        which = np.arange(GROUP * self._starts) % self._starts
        races = np.flatnonzero(which < len(failures))
        if self._env.others:
            self._env.seat(races, self._env.seated([failures[which[race]].race for race in races]))
        moments = {int(race): failures[which[race]].moment for race in races}
        self._episodes.world.state["driving"] = False
        self._env.start(list(moments), map(np.random.default_rng, moments), moments)
        self._forget()
        self._episodes.limit_s[:] = np.inf

    def _forget(self) -> None:
        if self._teacher:
            self._teacher.forget(np.arange(self._cars))

    def _step(self, actions: Array) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Rewards of a step with actions (cars, 2), without contacts and of these alone, (cars,) each."""
        episodes = self._episodes
        before, after = episodes.world.state.copy(), episodes.world.state
        self._env.step(actions)
        components = self._reward.components(before, after, episodes.contacts, episodes.contact_races)
        charged = {name: components.pop(name) for name in CONTACTS}
        rewards, charges = (
            np.where(before["driving"], self._reward.total(part), 0.0)[self._env.races, self._env.cars]
            for part in (components, charged)
        )
        return rewards, charges


def lasting(noise: Array, kept: float) -> Array:
    """Noise (steps, ..) of which a share is left a step later, and the deviation is the same."""
    drawn = math.sqrt(1.0 - kept * kept) * noise
    lasts = noise.copy()
    for step in range(1, len(noise)):
        lasts[step] = kept * lasts[step - 1] + drawn[step]
    return lasts
