"""Instruction: races in which a teacher says what it would do in the place of each car of a policy.

DAgger (Ross et al., AISTATS 2011): the policy drives, so that it is told what to do where it comes to. At
first the teacher drives some of the cars itself, with a little noise: wrecks teach nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures.process import BrokenProcessPool
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from nathlon.policies.environments.opponents import OpponentWrapper
from nathlon.policies.policy import Observations, Policy
from nathlon.policies.sources import DRIVER
from nathlon.policies.training.config import Rollouts, TrainingConfig
from nathlon.policies.training.demonstration import NOISE
from nathlon.policies.training.mistakes import Mistakes, out_of_control
from nathlon.policies.training.pairs import Pair
from nathlon.policies.training.population import Population
from nathlon.policies.training.processes import start_processes
from nathlon.policies.training.rollout import STUCK_S, learners_of, scenario_of
from nathlon.policies.training.teacher import Teachers
from nathlon.sim.episode import Episodes
from nathlon.sim.errors import InputError

LASTING_S = 0.5
"""Time in which a disturbance falls to a third."""

Array = NDArray[np.float32]


class Class(NamedTuple):
    """Races to be driven under instruction.

    Attributes:
        rollouts: of the configuration.
        pair: circuit and car.
        pace: share of its speed at which the teacher drives.
        taught: share of the cars that the teacher drives.
        seed: of all that is drawn.
    """

    rollouts: Rollouts
    pair: Pair
    pace: float
    taught: float
    seed: int


class Taught(NamedTuple):
    """What was seen and said, of each step of each car.

    Attributes:
        seen: (steps, cars, ..) observations.
        memory: (steps, cars, m) float32, what the policy remembered of what was before.
        said: (steps, cars, 2) float32, the teacher's actions; nan where nobody was asked.
        shown: (steps, cars, ..) what the teacher saw.
        driving: (steps, cars) whether the car drove.
        begun: (steps, cars) whether it began anew with this step.
    """

    seen: Observations
    memory: Array
    said: Array
    shown: Observations
    driving: NDArray[np.bool_]
    begun: NDArray[np.bool_]


class Notes(NamedTuple):
    """What is kept of a class.

    Attributes:
        rows: arrays by name, with a row for each step of each car that drove.
        speed: mean progress on the course of the cars that the policy drove, m/s; nan without any.
    """

    rows: dict[str, NDArray[Any]]
    speed: float


class School:
    """Holds classes, one after another or in processes of its own; what is noted is the same."""

    def __init__(self, config: TrainingConfig) -> None:
        """Processes, as many workers as the configuration has; without any, this one drives."""
        self._config = config
        self._processes = start_processes(config.workers) if config.workers else None

    def teach(
        self, classes: Sequence[Class], policy: Policy, note: Callable[[Taught], dict[str, NDArray[Any]]]
    ) -> Iterator[Notes]:
        """What comes of each of the classes, in their order.

        Args:
            classes: to be held.
            policy: is taught.
            note: the rows that are kept of what was driven; a function of a module.

        Raises:
            InputError: if the races cannot be made, or a process has ended.
        """
        teach = partial(instruct, self._config, policy, note)
        try:
            yield from self._processes.map(teach, classes) if self._processes else map(teach, classes)
        except BrokenProcessPool:
            raise InputError("imitation: a worker process has ended, expected it to drive") from None

    def close(self) -> None:
        """End the processes."""
        if self._processes is not None:
            self._processes.shutdown(cancel_futures=True)


def instruct(
    config: TrainingConfig,
    policy: Policy,
    note: Callable[[Taught], dict[str, NDArray[Any]]],
    planned: Class,
) -> Notes:
    """Drive the races of a class.

    The driver's own memory, of how far it has moved aside, would decide what it says off its line, and no
    policy sees it. So in races of one car, where nobody is moved aside for, it has none.

    Args:
        config: of which the rollouts are a part; it imitates.
        policy: is taught.
        note: the rows that are kept of what was driven.
        planned: the class.

    Raises:
        InputError: if the races cannot be made.
    """
    assert config.imitation is not None, "it imitates"
    rng, rollouts, pair = np.random.default_rng(planned.seed), planned.rollouts, planned.pair
    scenario = scenario_of(rollouts, pair)
    patience_s = rollouts.patience_s or config.imitation.patience_s
    stuck_s = max(STUCK_S, patience_s or 0.0)
    episodes = Episodes(pair.circuit, pair.car, scenario, rollouts.races, stuck_s=stuck_s)
    learners = learners_of(rollouts, scenario.cars)
    opponents = (rollouts.opponents or config.opponents) if len(learners) < scenario.cars else ()
    population = Population(opponents, pair)
    spec = config.observation.spec()
    if spec.planned and config.imitation.teacher == DRIVER:
        spec = replace(spec, plan_pace=planned.pace)
    env = OpponentWrapper(episodes, learners.tolist(), spec, population.policies)
    if env.others:
        who = population.draw(rollouts.races * env.others, rng)
        env.seat(range(rollouts.races), who.reshape(rollouts.races, env.others))
    teachers = Teachers(config.imitation, rollouts.racer, planned.pace, pair, env)
    disturbance = config.imitation.disturbance * pair.grip
    lesson = _Lesson(env, teachers, policy, planned.taught, disturbance, learners, rollouts.mistakes, rng)
    for _ in range(round(config.imitation.length_s / episodes.step_s)):
        lesson.step()
        if patience_s is not None:
            lesson.begin_anew(patience_s)
    return Notes(note(lesson.drive), lesson.speed)


class _Lesson:
    """Races in which a policy drives and teachers look on."""

    def __init__(
        self,
        env: OpponentWrapper,
        teachers: Teachers,
        policy: Policy,
        taught: float,
        disturbance: float,
        learners: NDArray[np.int64],
        again: float,
        rng: np.random.Generator,
    ) -> None:
        self._env, self._teachers, self._policy, self._rng = env, teachers, policy, rng
        self._mistakes, self._again = Mistakes(env.episodes, learners), again
        cars = len(env.cars)
        self._memory = policy.initial_memory(cars)
        self._noted: list[Taught] = []
        self._begun = np.ones(cars, np.bool_)
        self._astray_s, self._gone = np.zeros(cars), np.zeros(cars)
        self._disturbed = np.where(np.arange(cars) % 2, disturbance, 0.0)[:, None]
        self._push = np.zeros((cars, 2))
        self._start(np.arange(len(env.episodes.endings)))
        self._led = rng.random(cars) < taught

    def _start(self, races: NDArray[np.int64]) -> None:
        env, episodes = self._env, self._env.episodes
        seeds = self._rng.integers(2**63, size=len(races)).tolist()
        again = {
            race: self._mistakes.draw(self._rng)
            for race in races.tolist()
            if len(self._mistakes) and self._rng.random() < self._again
        }
        env.start(races.tolist(), map(np.random.default_rng, seeds), again)
        self._mistakes.restart(races.tolist())
        episodes.world.state["finish"], episodes.limit_s[:] = np.inf, np.inf
        anew = np.flatnonzero(np.isin(env.races, races))
        self._memory[anew] = self._policy.initial_memory(len(anew))
        self._teachers.forget(anew)
        self._begun[anew], self._astray_s[anew] = True, 0.0

    @property
    def _cars(self) -> NDArray[np.void]:
        return self._env.episodes.world.state[self._env.races, self._env.cars]

    def step(self) -> None:
        """Drive on, and note what is seen and said."""
        env, before = self._env, self._cars.copy()
        if not env.others:
            self._teachers.forget(np.arange(len(env.cars)))
        shown, advice = self._teachers.look(self._led)
        noise = self._rng.normal(0.0, NOISE, advice.shape).astype(np.float32)
        acted, memory = self._policy.act(env.seen, self._memory)
        actions = np.where(self._led[:, None], advice + noise, acted)
        if self._disturbed.any():
            actions = actions + self._pushed()
        known = env.seen.copy(), self._memory.copy(), advice.copy(), shown
        self._noted.append(Taught(*known, before["driving"], self._begun.copy()))
        self._memory, self._begun[:] = memory, False
        env.step(np.clip(actions, -1.0, 1.0))
        self._gone += self._cars["progress"] - before["progress"]
        if self._again:
            self._mistakes.watch()

    def _pushed(self) -> NDArray[np.float64]:
        """What is added to the actions, (n, 2): noise of which most is left a step later."""
        kept = np.exp(-self._env.episodes.step_s / LASTING_S)
        fresh = self._rng.normal(size=self._push.shape) * self._disturbed
        self._push = kept * self._push + np.sqrt(1.0 - kept**2) * fresh
        return self._push

    def begin_anew(self, patience_s: float) -> None:
        """Start the races again in which all cars of the policy have been out of control for so long."""
        cars, env = self._cars, self._env
        self._astray_s = np.where(out_of_control(cars), self._astray_s + env.episodes.step_s, 0.0)
        through = (self._astray_s >= patience_s) | ~cars["driving"]
        waiting = np.bincount(env.races[~through], minlength=len(env.episodes.endings))
        over = np.flatnonzero(waiting == 0)
        if len(over):
            self._start(over)

    @property
    def drive(self) -> Taught:
        """All that was noted."""
        return Taught(*map(np.stack, zip(*self._noted, strict=True)))

    @property
    def speed(self) -> float:
        """Mean progress of the cars that the policy drove, m/s; nan without any."""
        gone = self._gone[~self._led]
        length_s = len(self._noted) * self._env.episodes.step_s
        return float(gone.mean()) / length_s if len(gone) else float("nan")
