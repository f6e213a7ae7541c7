"""Rollouts: races in which some cars are driven, and learnt from, by the policy in training."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import repeat
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from nathlon.policies.environments.opponents import OpponentWrapper, load_opponents
from nathlon.policies.policy import Policy
from nathlon.policies.training.coached import SHARE, Coached
from nathlon.policies.training.config import Rollouts, TrainingConfig
from nathlon.policies.training.demonstration import Demonstrators
from nathlon.policies.training.mistakes import Mistakes
from nathlon.policies.training.pairs import Pair
from nathlon.policies.training.population import Population
from nathlon.policies.training.rewards import Reward, Rewards
from nathlon.sim.episode import Episodes
from nathlon.sim.errors import InputError
from nathlon.sim.instruments import Instruments
from nathlon.sim.scenario import Scenario, load_scenario

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


def scenario_of(rollouts: Rollouts, pair: Pair) -> Scenario:
    """The scenario of the races, with the grip of the pair, and what the rollouts have instead of its own."""
    scenario = pair.conditions(load_scenario(rollouts.scenario))
    delay = rollouts.perception_delay_s
    if isinstance(delay, tuple) and len(delay) != scenario.cars:
        raise InputError(
            f"rollouts {rollouts.scenario}: perception_delay_s has {len(delay)} numbers, "
            f"expected one, or one for each of the scenario's {scenario.cars} cars"
        )
    own = rollouts.model_dump(include={"perception_delay_s", "wear_rate", "fuel_rate"}, exclude_none=True)
    return scenario.model_copy(update=own)


def tells_pace(scenario: Scenario) -> bool:
    """Whether speed in it tells of circuit and car: alone, on tyres that last, and not on the way back."""
    spun = getattr(scenario.start, "spun_share", 0.0)
    return scenario.cars == 1 and not scenario.wear_rate and not spun


def learners_of(rollouts: Rollouts, cars: int) -> NDArray[np.int64]:
    """Indices of the learner's cars in each race of so many cars."""
    if rollouts.learners > cars:
        raise InputError(
            f"rollouts {rollouts.scenario}: learners is {rollouts.learners}, "
            f"expected at most the scenario's {cars} cars"
        )
    if rollouts.places is None:
        return np.unique(np.linspace(cars - 1, 0, rollouts.learners).round().astype(np.int64))
    if max(rollouts.places) > cars:
        raise InputError(
            f"rollouts {rollouts.scenario}: places has {max(rollouts.places)}, "
            f"expected at most the scenario's {cars}"
        )
    return np.sort(np.array(rollouts.places) - 1)


class Rollout:
    """Side-by-side races of one scenario; a race starts anew when its learners are through.

    Attributes:
        episodes: the races themselves.
        laps: lap times driven, s, to be emptied by the reader, as the following.
        driven_s, off_course_s: time driven by the learner's cars, and that off course, s.
    """

    def __init__(
        self, config: TrainingConfig, rollouts: Rollouts, pair: Pair, rng: np.random.Generator
    ) -> None:
        """Races at their start.

        Args:
            config: of which the rollouts are a part.
            rollouts: scenario, learners and opponents.
            pair: circuit and car.
            rng: draws starts and opponents.

        Raises:
            InputError: if the scenario has fewer cars than learners, or nobody drives the others.
        """
        scenario = scenario_of(rollouts, pair)
        episodes = Episodes(pair.circuit, pair.car, scenario, rollouts.races, stuck_s=STUCK_S)
        learners = learners_of(rollouts, episodes.scenario.cars)
        opponents = (rollouts.opponents or config.opponents) if len(learners) < scenario.cars else ()
        self._population = Population(opponents, pair)
        self.episodes, self._learners = episodes, learners
        self._env = OpponentWrapper(
            episodes, learners.tolist(), config.observation.spec(), self._population.policies
        )
        self._hidden = (
            episodes.watch(config.observation.critic_spec(), self._env.races, self._env.cars)
            if config.vision
            else None
        )
        self._demonstrators = Demonstrators(
            load_opponents([pair.wise(name) for name in rollouts.demonstrators], pair.circuit, pair.car),
            episodes,
            self._env.races,
            self._env.cars,
        )
        world = episodes.world
        self._reward = Reward(config.reward, Instruments(world.track, world.car, episodes.step_s))
        self._mistakes = Mistakes(episodes, learners)
        self._coached = Coached(episodes, config.coached if episodes.scenario.cars == 1 else (), rng)
        self._again = rollouts.mistakes
        self._rng = rng
        self.laps: list[float] = []
        self.driven_s = self.off_course_s = 0.0
        self._start(list(range(rollouts.races)))
        # The first episodes are of different length, so that races do not restart all at once.
        episodes.limit_s *= rng.uniform(0.2, 1.0, rollouts.races)

    @property
    def slots(self) -> int:
        """Cars that the learner drives."""
        return len(self._env.cars)

    @property
    def tells_pace(self) -> bool:
        """Whether the learner's speed tells of circuit and car."""
        return tells_pace(self.episodes.scenario)

    @property
    def demonstrated(self) -> bool:
        """Whether demonstrators drive the learner's cars."""
        return bool(self._demonstrators)

    @property
    def observation(self) -> Array:
        """What the learner's cars see, (slots, size) float32; with a camera (slots,) records."""
        return self._env.seen

    @property
    def hidden(self) -> Array:
        """What the learner's critics see instead, (slots, size) float32; size is 0 if they see the same."""
        return self._hidden.seen if self._hidden else np.zeros((self.slots, 0), np.float32)

    def meet(self, current: Policy | None, past: Sequence[Path]) -> None:
        """Let the opponents `self` and `past` be what they are called.

        Args:
            current: the policy in training; None leaves `self` as it is.
            past: checkpoints of the run so far.

        Raises:
            InputError: if a checkpoint cannot be read.
        """
        if not self._env.others:
            return
        for index in self._population.meet(current, past, self._rng):
            self._env.replace(index, self._population.policies[index])

    def _start(self, races: list[int]) -> None:
        if self._env.others:
            who = self._population.draw(len(races) * self._env.others, self._rng)
            self._env.seat(races, who.reshape(len(races), -1))
        again = {
            race: self._mistakes.draw(self._rng)
            for race in races
            if len(self._mistakes) and self._rng.random() < self._again
        }
        if len(self._coached):
            again |= {
                race: self._coached.draw(self._rng)
                for race in races
                if race not in again and self._rng.random() < SHARE
            }
        self._demonstrators.forget(races)
        self._env.start(races, repeat(self._rng, len(races)), again)
        self._mistakes.restart(races)
        self.episodes.limit_s[races] = self.episodes.world.time[races] + self.episodes.scenario.time_s

    def step(self, action: Array) -> tuple[Step, dict[str, Rewards]]:
        """Advance all races by one step with the learner's actions, (slots, 2), or the demonstrators'.

        Returns:
            the step, and the components of its reward by name, each (slots,).
        """
        mine, episodes = (self._env.races, self._env.cars), self.episodes
        before, after = episodes.world.state.copy(), episodes.world.state
        if self.demonstrated:
            action = self._demonstrators.act(self._rng)
        self._env.step(action)
        everyone = self._reward.components(before, after, episodes.contacts, episodes.contact_races)
        components = {name: value[mine] for name, value in everyone.items()}
        reward = self._reward.total(components).astype(np.float32)
        valid, ending = before["driving"][mine], episodes.endings[mine]
        terminated = valid & (ending == "stuck")
        truncated = valid & ((ending == "time_up") | (ending == "finished"))
        self._count(valid, before["laps"][mine])
        if self._again:
            self._mistakes.watch()
        step = Step(action, reward, self.observation, terminated, truncated, valid)
        over = (episodes.endings[:, self._learners] != "").all(axis=1)
        if over.any():
            self._start(np.flatnonzero(over).tolist())
        return step, components

    def _count(self, valid: Flags, laps_before: NDArray[np.int64]) -> None:
        state = self.episodes.world.state[self._env.races, self._env.cars]
        timed = valid & (state["laps"] > laps_before) & np.isfinite(state["last_lap_s"])
        self.laps.extend(state["last_lap_s"][timed])
        self.driven_s += self.episodes.step_s * int(valid.sum())
        self.off_course_s += self.episodes.step_s * int((valid & state["off_course"]).sum())
