"""Rollouts: races in which some cars are driven, and learnt from, by the policy in training."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from policies.load import load_policy
from policies.policy import Policy
from policies.training.config import Rollouts, TrainingConfig
from policies.training.rewards import Rewards, Transition, total
from sim.car import load_car
from sim.errors import InputError
from sim.scenario import load_scenario
from sim.track import load_track
from sim.world import AGENT_DT, World

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


@dataclass
class Opponent:
    """A policy and the cars that it drives."""

    policy: Policy
    races: NDArray[np.int64]
    cars: NDArray[np.int64]
    memory: Array

    def act(self, world: World) -> Array:
        """Actions of its cars."""
        seen = world.observe(self.policy.observation_spec, self.races, self.cars)
        actions, self.memory = self.policy.act(seen, self.memory)
        return actions

    def forget(self, race: int) -> None:
        """Start the memory of its cars in a race afresh."""
        mine = self.races == race
        self.memory[mine] = self.policy.initial_memory(int(mine.sum()))


class Rollout:
    """Side-by-side races of one scenario; a race starts anew when it is over."""

    def __init__(self, config: TrainingConfig, rollouts: Rollouts, rng: np.random.Generator) -> None:
        """Races at their start.

        Raises:
            InputError: if the scenario has fewer cars than learners, or nobody drives the others.
        """
        self.scenario = load_scenario(rollouts.scenario)
        cars, races = self.scenario.cars, rollouts.races
        if rollouts.learners > cars:
            raise InputError(
                f"rollouts {rollouts.scenario}: learners is {rollouts.learners}, "
                f"expected at most the scenario's {cars} cars"
            )
        self._rng = rng
        self._spec = config.observation.spec()
        self._weights = config.reward
        self._track = load_track(config.circuit)
        self.world = World(self._track, load_car(config.car), races, cars)
        learners = np.unique(np.linspace(cars - 1, 0, rollouts.learners).round().astype(np.int64))
        grid = np.stack(np.meshgrid(np.arange(races), learners, indexing="ij")).reshape(2, -1)
        self._races, self._cars = grid
        others = np.setdiff1d(np.arange(cars), learners)
        self._opponents = self._seat(config, rollouts, np.stack(np.meshgrid(np.arange(races), others)))
        # The first episodes are of different length, so that races do not restart all at once.
        self._limit = rng.uniform(0.2, 1.0, races) * self.scenario.time_s
        self.laps: list[float] = []
        self.driven_s = self.off_course_s = 0.0
        for race in range(races):
            self._restart(race)
        self.observation = self._observe()

    @property
    def slots(self) -> int:
        """Cars that the learner drives."""
        return len(self._races)

    def _seat(self, config: TrainingConfig, rollouts: Rollouts, seats: NDArray[np.int64]) -> list[Opponent]:
        races, cars = seats.reshape(2, -1)
        if len(races) and not rollouts.opponents:
            raise InputError(
                f"rollouts {rollouts.scenario}: opponents is empty, expected someone for {len(races)} cars"
            )
        seated = []
        for turn, name in enumerate(rollouts.opponents):
            policy = load_policy(name, config.circuit, config.car)
            mine = slice(turn, None, len(rollouts.opponents))
            memory = policy.initial_memory(len(races[mine]))
            seated.append(Opponent(policy, races[mine], cars[mine], memory))
        return [opponent for opponent in seated if len(opponent.races)]

    def _restart(self, race: int) -> None:
        self.world.reset(race, self.scenario.place(self._track, self._rng))
        for opponent in self._opponents:
            opponent.forget(race)

    def _observe(self) -> Array:
        return self.world.observe(self._spec, self._races, self._cars)

    def step(self, action: Array) -> tuple[Step, dict[str, Rewards]]:
        """Advance all races by one step with the learner's actions, (slots, 2).

        Returns:
            the step, and the components of its reward by name, each (slots,).
        """
        world, mine = self.world, (self._races, self._cars)
        everybody = np.zeros((*world.state.shape, 2), np.float32)
        everybody[mine] = action
        for opponent in self._opponents:
            everybody[opponent.races, opponent.cars] = opponent.act(world)
        valid = world.state["driving"][mine].copy()
        laps_before = world.state["laps"][mine].copy()
        transition = Transition(world)
        world.step(everybody)
        components = {name: value[mine] for name, value in transition.components().items()}
        reward = total(components, self._weights).astype(np.float32)

        stuck = world.state["stationary_s"] > STUCK_S
        world.state["driving"] &= ~stuck
        terminated = stuck[mine] & valid
        driving = world.state["driving"][mine]
        finished = valid & ~driving & ~terminated
        over = (world.time >= self._limit)[self._races]
        self._count(valid, laps_before)
        next_observation = self._observe()
        step = Step(action, reward, next_observation, terminated, (over & valid) | finished, valid)
        self._restart_finished()
        self.observation = self._observe()
        return step, components

    def _restart_finished(self) -> None:
        mine = np.zeros(self.world.state.shape, np.bool_)
        mine[self._races, self._cars] = self.world.state["driving"][self._races, self._cars]
        for race in np.flatnonzero((self.world.time >= self._limit) | ~mine.any(axis=1)):
            self._limit[race] = self.scenario.time_s
            self._restart(int(race))

    def _count(self, valid: Flags, laps_before: NDArray[np.int64]) -> None:
        state = self.world.state[self._races, self._cars]
        timed = valid & (state["laps"] > laps_before) & np.isfinite(state["last_lap_s"])
        self.laps.extend(state["last_lap_s"][timed])
        self.driven_s += AGENT_DT * int(valid.sum())
        self.off_course_s += AGENT_DT * int((valid & state["off_course"]).sum())
