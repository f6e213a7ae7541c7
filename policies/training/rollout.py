"""Rollouts: races in which some cars are driven, and learnt from, by the policy in training."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import repeat
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from policies.heat import Heat, load_opponents
from policies.training.config import Rollouts, TrainingConfig
from policies.training.rewards import Rewards, Transition, total
from sim.episode import Episodes
from sim.errors import InputError

STUCK_S = 5.0
"""A car at rest for so long has ended its episode: it will not get away."""

Array = NDArray[np.float32]
Flags = NDArray[np.bool_]


class Step(NamedTuple):
    """One step of the learner's cars, one row a car: what the replay buffer takes in."""

    action: Array
    reward: Array
    next_observation: Array
    terminated: Flags
    truncated: Flags
    valid: Flags


class Rollout:
    """Side-by-side races of one scenario; a race starts anew when its learners are through.

    Attributes:
        episodes: the races themselves.
        laps: lap times driven, s, to be emptied by the reader, as the following.
        driven_s, off_course_s: time driven by the learner's cars, and that off course, s.
    """

    def __init__(self, config: TrainingConfig, rollouts: Rollouts, rng: np.random.Generator) -> None:
        """Races at their start.

        Raises:
            InputError: if the scenario has fewer cars than learners, or nobody drives the others.
        """
        episodes = Episodes(config.circuit, config.car, rollouts.scenario, rollouts.races, stuck_s=STUCK_S)
        cars = episodes.scenario.cars
        if rollouts.learners > cars:
            raise InputError(
                f"rollouts {rollouts.scenario}: learners is {rollouts.learners}, "
                f"expected at most the scenario's {cars} cars"
            )
        learners = np.unique(np.linspace(cars - 1, 0, rollouts.learners).round().astype(np.int64))
        opponents = load_opponents(rollouts.opponents, config.circuit, config.car)
        self.episodes, self._learners = episodes, learners
        self._heat = Heat(episodes, learners.tolist(), config.observation.spec(), opponents)
        self._weights = config.reward
        self._rng = rng
        # The first episodes are of different length, so that races do not restart all at once.
        episodes.limit_s *= rng.uniform(0.2, 1.0, rollouts.races)
        self.laps: list[float] = []
        self.driven_s = self.off_course_s = 0.0
        self._start(range(rollouts.races))

    @property
    def slots(self) -> int:
        """Cars that the learner drives."""
        return len(self._heat.cars)

    @property
    def observation(self) -> Array:
        """What the learner's cars see, (slots, size) float32."""
        return self._heat.seen

    def _start(self, races: Sequence[int]) -> None:
        self._heat.start(races, repeat(self._rng, len(races)))

    def step(self, action: Array) -> tuple[Step, dict[str, Rewards]]:
        """Advance all races by one step with the learner's actions, (slots, 2).

        Returns:
            the step, and the components of its reward by name, each (slots,).
        """
        mine, world = (self._heat.races, self._heat.cars), self.episodes.world
        valid = world.state["driving"][mine]
        laps_before = world.state["laps"][mine]
        transition = Transition(world)
        self._heat.step(action)
        components = {name: value[mine] for name, value in transition.components().items()}
        reward = total(components, self._weights).astype(np.float32)
        ending = self.episodes.endings[mine]
        terminated = valid & (ending == "stuck")
        truncated = valid & ((ending == "time_up") | (ending == "finished"))
        self._count(valid, laps_before)
        step = Step(action, reward, self.observation, terminated, truncated, valid)
        self._restart_finished()
        return step, components

    def _restart_finished(self) -> None:
        over = (self.episodes.endings[:, self._learners] != "").all(axis=1)
        if over.any():
            self.episodes.limit_s[over] = self.episodes.scenario.time_s
            self._start(np.flatnonzero(over).tolist())

    def _count(self, valid: Flags, laps_before: NDArray[np.int64]) -> None:
        state = self.episodes.world.state[self._heat.races, self._heat.cars]
        timed = valid & (state["laps"] > laps_before) & np.isfinite(state["last_lap_s"])
        self.laps.extend(state["last_lap_s"][timed])
        self.driven_s += self.episodes.step_s * int(valid.sum())
        self.off_course_s += self.episodes.step_s * int((valid & state["off_course"]).sum())
