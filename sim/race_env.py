"""The PettingZoo face of the world: a race in which every car is an agent."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np
from gymnasium.spaces import Box
from numpy.typing import NDArray
from pettingzoo import ParallelEnv

from sim.episode import Episode
from sim.observation import ObservationSpec

Observations = dict[str, NDArray[np.float32]]
Infos = dict[str, dict[str, Any]]


class RaceEnv(ParallelEnv):  # type: ignore[misc]  # PettingZoo carries no types
    """A scenario as a parallel environment with the agents `car_0`, `car_1`... in starting order.

    A step is 0.1 s. Observations are those of `sim.observation`, standardised, float32; actions are
    throttle (+) or brake (-), and steering (+ is left), in [-1, 1]. The reward is the progress
    along the centre line during the step, m, and 0 off course. An agent is terminated when it has
    finished or is stuck (`sim.episode.STUCK_S`), and truncated when the scenario's time is up.
    """

    metadata: ClassVar[dict[str, Any]] = {"name": "nathlon_race_v0", "render_modes": []}

    def __init__(
        self, circuit: str, car: str, scenario: str, observation: ObservationSpec | None = None
    ) -> None:
        """See `sim.parallel_env`."""
        self._episode = Episode(circuit, car, scenario, observation)
        self.possible_agents = [f"car_{i}" for i in range(self._episode.cars)]
        self.agents: list[str] = []
        self.render_mode = None
        self._observation_spaces = {
            agent: self._episode.observation_space() for agent in self.possible_agents
        }
        self._action_spaces = {agent: self._episode.action_space() for agent in self.possible_agents}
        self._rng = np.random.default_rng()

    def observation_space(self, agent: str) -> Box[np.float32]:
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
        self._episode.start(self._rng)
        self.agents = list(self.possible_agents)
        observations, infos = self._episode.observe(), self._episode.infos()
        return (
            dict(zip(self.agents, observations, strict=True)),
            dict(zip(self.agents, infos, strict=True)),
        )

    def step(
        self, actions: dict[str, NDArray[np.float32]]
    ) -> tuple[Observations, dict[str, float], dict[str, bool], dict[str, bool], Infos]:
        """Advance the race by 0.1 s.

        Args:
            actions: (2,) by agent, of every agent in `agents`.

        Raises:
            KeyError: if an agent's action is missing.
            ValueError: if an action is not finite.
        """
        everybody = np.zeros((len(self.possible_agents), 2), np.float32)
        live = {agent: self.possible_agents.index(agent) for agent in self.agents}
        for agent, car in live.items():
            everybody[car] = actions[agent]
        rewards = self._episode.step(everybody)
        observations, infos, endings = self._episode.observe(), self._episode.infos(), self._episode.endings
        self.agents = [agent for agent, car in live.items() if endings[car] == ""]
        return (
            {agent: observations[car] for agent, car in live.items()},
            {agent: float(rewards[car]) for agent, car in live.items()},
            {agent: bool(endings[car] in ("finished", "stuck")) for agent, car in live.items()},
            {agent: bool(endings[car] == "time_up") for agent, car in live.items()},
            {agent: infos[car] for agent, car in live.items()},
        )
