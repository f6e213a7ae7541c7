"""Teachers: policies that say what they would do in the place of a car.

Imitation asks at every step, polishing where a car is lost. A policy that has come to brake where it is lost
never finds the way back by noise of its own: all of its group stand still alike. So a teacher's actions are
imitated there (DAgger, Ross et al., AISTATS 2011): the policy drives, and is told at each step what the
teacher would do.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from nathlon.policies.apart import load_guest
from nathlon.policies.driver.shown_plan import show_plans
from nathlon.policies.environments.opponents import OpponentWrapper
from nathlon.policies.planning import decide
from nathlon.policies.policy import Batch, Observations
from nathlon.policies.sources import DRIVER
from nathlon.policies.training.config import ImitationSettings
from nathlon.policies.training.mistakes import ASTRAY_RAD
from nathlon.policies.training.pairs import Pair

SLOW_M_S = 10.0
"""Speed up to which a car may be lost: who is faster has not stopped sliding yet."""
AHEAD_M, BEHIND_M = 40.0, 15.0
"""Along the road between centres: a car races with those that are no further ahead or behind."""


def lost(cars: NDArray[np.void]) -> NDArray[np.bool_]:
    """Which cars (CAR_STATE of any shape) crawl, and face away from the road, are off it or at a wall."""
    slow = np.hypot(cars["velocity_x"], cars["velocity_y"]) < SLOW_M_S
    return slow & (facing_away(cars) | cars["off_course"] | cars["wall_contact"])


def facing_away(cars: NDArray[np.void]) -> NDArray[np.bool_]:
    """Which cars (CAR_STATE of any shape) face away from the road, at whatever speed."""
    return np.asarray(np.abs(cars["heading_error"]) > ASTRAY_RAD)


def astray(env: OpponentWrapper) -> NDArray[np.bool_]:
    """Which of the cars that are driven from outside need a rescuer, (n,)."""
    cars = env.episodes.world.state[env.races, env.cars]
    return lost(cars) | facing_away(cars)


def racing(env: OpponentWrapper) -> NDArray[np.bool_]:
    """Which of the cars that are driven from outside have another one near, (n,)."""
    world, rows = env.episodes.world, np.arange(len(env.cars))
    progress, length = world.state["progress"][env.races], world.track.length
    half = 0.5 * length
    gap = (progress - progress[rows, env.cars][:, None] + half) % length - half
    near = (gap > -BEHIND_M) & (gap < AHEAD_M) & world.state["driving"][env.races]
    near[rows, env.cars] = False
    return np.asarray(near.any(axis=1))


class Teacher:
    """Looks on from the cars that are driven from outside."""

    def __init__(self, policy: str, pair: Pair, env: OpponentWrapper) -> None:
        """A policy by its name, and the races in which it looks on.

        Raises:
            InputError: if it is not known or cannot be read.
        """
        self._policy = load_guest(pair.wise(policy), pair.circuit, pair.car)
        self._world, self._races, self._cars = env.episodes.world, env.races, env.cars
        show_plans(self._world, self._policy)
        self._memory = self._policy.initial_memory(len(self._cars))

    @property
    def remembers(self) -> bool:
        """Whether what it does depends on what was before."""
        return self._memory.shape[1] > 0

    def forget(self, cars: NDArray[np.int64]) -> None:
        """Start afresh in the place of some of the cars, (n,) indices, as their races do."""
        self._memory[cars] = self._policy.initial_memory(len(cars))

    def lesson(self, cars: NDArray[np.void]) -> Batch:
        """What it would do, (n, 2); nan for cars that are not lost.

        Args:
            cars: (n,) CAR_STATE.
        """
        lesson = np.full((len(cars), 2), np.nan, np.float32)
        asked = np.flatnonzero(lost(cars))
        if len(asked):
            lesson[asked] = self.advice(asked)
        return lesson

    def advice(self, asked: NDArray[np.int64]) -> Batch:
        """What it would do in the place of some of the cars, (n,) indices, (n, 2)."""
        return self.look(asked)[1]

    def look(self, asked: NDArray[np.int64]) -> tuple[Observations, Batch]:
        """What it sees from some of the cars, (n,) indices, and what it would do there, (n, 2)."""
        where = self._races[asked], self._cars[asked]
        seen = self._world.observe(self._policy.observation_spec, *where)
        actions, self._memory[asked] = decide(self._policy, self._world, *where, seen, self._memory[asked])
        return seen, actions


def at_pace(name: str, pace: float) -> str:
    """The name of a policy; of built-in drivers that of one at a pace, unless it names one itself."""
    kind, _, settings = name.partition(":")
    if kind != DRIVER or "pace=" in settings:
        return name
    return f"{DRIVER}:{','.join(filter(None, (f'pace={pace:g}', settings)))}"


class Teachers:
    """A teacher, and those who say in its stead what to do where it is not the one to ask."""

    def __init__(
        self, settings: ImitationSettings, racer: str | None, pace: float, pair: Pair, env: OpponentWrapper
    ) -> None:
        """Teachers by what a run says, and the races in which they look on.

        Args:
            settings: name them.
            racer: instead of the one that they name.
            pace: share of its speed at which a built-in driver teaches, where its name says nothing of pace.
            pair, env: as of `Teacher`.

        Raises:
            InputError: as `Teacher`.
        """
        self._every, self._step = settings.racer_every, 0
        self._env, self._teacher = env, Teacher(at_pace(settings.teacher, pace), pair, env)
        asked = ((racer or settings.racer, racing), (settings.rescuer, astray))
        self._others = [(Teacher(at_pace(name, pace), pair, env), where) for name, where in asked if name]

    def forget(self, cars: NDArray[np.int64]) -> None:
        """Start afresh in the place of some of the cars, (n,) indices."""
        for teacher in (self._teacher, *(other for other, _ in self._others)):
            teacher.forget(cars)

    def look(self, heeded: NDArray[np.bool_]) -> tuple[Observations, Batch]:
        """What the teacher sees from all cars, and what to do there, (n, 2); nan where nobody was asked.

        Args:
            heeded: (n,) cars that do what is said, and so need it at every step.
        """
        everybody = np.arange(len(self._env.cars))
        seen, advice = self._teacher.look(everybody)
        turn = (everybody + self._step) % self._every == 0
        self._step += 1
        for other, where in self._others:
            there = where(self._env)
            # What a teacher remembers has to be up to date; one that remembers nothing may be dear to ask.
            asked = everybody if other.remembers else np.flatnonzero(there & (turn | heeded))
            said = np.full_like(advice, np.nan)
            said[asked] = other.look(asked)[1]
            advice = np.where(there[:, None], said, advice)
        return seen, advice
