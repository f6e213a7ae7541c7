"""The PettingZoo face of the world: a race in which every car is an agent."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np
from gymnasium.spaces import Box, Space
from numpy.typing import NDArray
from pettingzoo import ParallelEnv

from nathlon.sim.episode import Episodes, action_space, in_space, info_of, observation_space
from nathlon.sim.observation import ObservationSpec
from nathlon.sim.render import RENDER_MODES, open_screen

Observations = dict[str, Any]
Infos = dict[str, dict[str, Any]]


class RaceEnv(ParallelEnv):  # type: ignore[misc]  # PettingZoo carries no types
    """A scenario as a parallel environment with the agents `car_0`, `car_1`... in starting order.

    A step is 0.1 s unless the scenario has another action rate. Observations are those of
    `nathlon.sim.observation`, standardised, float32, or dicts of these as `sensors` and of a `picture` where
    the spec has a camera; actions are throttle (+) or brake (-), and steering (+ is left), in [-1, 1]. The
    reward is the progress along the centre line during the step, m, and 0 off course. An agent is terminated
    when it has finished or is stuck (`nathlon.sim.episode.STUCK_S`), and truncated when the scenario's time
    is up.
    """

    metadata: ClassVar[dict[str, Any]] = {"name": "nathlon_race_v0", "render_modes": RENDER_MODES}

    def __init__(
        self,
        circuit: str,
        car: str,
        scenario: str,
        observation: ObservationSpec | None = None,
        render_mode: str | None = None,
    ) -> None:
        """See `nathlon.sim.parallel_env`."""
        self._episodes = Episodes(circuit, car, scenario)
        cars = self._episodes.scenario.cars
        spec = observation or ObservationSpec()
        self._view = self._episodes.watch(spec, np.zeros(cars, np.int64), np.arange(cars))
        self.possible_agents = [f"car_{i}" for i in range(cars)]
        self.agents: list[str] = []
        self.render_mode = render_mode
        self.metadata = {**self.metadata, "render_fps": 1.0 / self._episodes.step_s}  # type: ignore[misc]
        self._screen = open_screen(render_mode, self._episodes, self.possible_agents)
        self._observation_spaces = {agent: observation_space(spec) for agent in self.possible_agents}
        self._action_spaces = {agent: action_space() for agent in self.possible_agents}
        self._rng = np.random.default_rng()

    def observation_space(self, agent: str) -> Space[Any]:
        """The agent's observation space, always the same object."""
        return self._observation_spaces[agent]

    def action_space(self, agent: str) -> Box[np.float32]:
        """The agent's action space, always the same object."""
        return self._action_spaces[agent]

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observations, Infos]:
        """Start a new race.

        Args:
            seed: of the starts from here on; without it they go on from the last seed.
            options: none are known.
        """
        if seed is not None:
            self._rng = np.random.default_rng(seed)
        self._episodes.start([0], [self._rng])
        self.agents = list(self.possible_agents)
        if self._screen:
            self._screen.start()
        infos = self._infos()
        return (
            dict(zip(self.agents, map(in_space, self._view.seen), strict=True)),
            dict(zip(self.agents, infos, strict=True)),
        )

    def step(
        self, actions: dict[str, NDArray[np.float32]]
    ) -> tuple[Observations, dict[str, float], dict[str, bool], dict[str, bool], Infos]:
        """Advance the race by a step.

        Args:
            actions: (2,) by agent, of every agent in `agents`.

        Raises:
            KeyError: if an agent's action is missing.
            ValueError: if an action is not finite.
        """
        everybody = np.zeros((1, len(self.possible_agents), 2), np.float32)
        live = {agent: self.possible_agents.index(agent) for agent in self.agents}
        for agent, car in live.items():
            everybody[0, car] = actions[agent]
        rewards = self._episodes.step(everybody)[0]
        if self._screen:
            self._screen.step()
        seen, infos, endings = self._view.seen, self._infos(), self._episodes.endings[0]
        self.agents = [agent for agent, car in live.items() if endings[car] == ""]
        return (
            {agent: in_space(seen[car]) for agent, car in live.items()},
            {agent: float(rewards[car]) for agent, car in live.items()},
            {agent: bool(endings[car] in ("finished", "stuck")) for agent, car in live.items()},
            {agent: bool(endings[car] == "time_up") for agent, car in live.items()},
            {agent: infos[car] for agent, car in live.items()},
        )

    def _infos(self) -> list[dict[str, Any]]:
        facts = self._episodes.facts()
        return [info_of(facts, 0, car) for car in range(len(self.possible_agents))]

    def render(self) -> NDArray[np.uint8] | None:
        """The race from above, with the leader in the middle: (600, 800, 3) uint8, or None in a window."""
        return self._screen.render() if self._screen else None

    def close(self) -> None:
        """Close the window, if there is one."""
        if self._screen:
            self._screen.close()
