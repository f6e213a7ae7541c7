"""Level-based foraging, whose environments hand on lists: a seat is a place in the list.

pip install lbforaging
python -m examples.worlds.train foraging runs/foraging-1
nathlon evaluate runs/foraging-1 --world examples/worlds/foraging.py:world --out runs/foraging-1-selected

`Listed` fits other simulators of this kind as well, such as rware: `Tuple` spaces, and a list of observations
and of rewards.
"""

from __future__ import annotations

from typing import Any

import gymnasium

from nathlon import PettingZooWorld


class Listed:
    """An environment of lists as a ParallelEnv."""

    def __init__(self, environment: Any) -> None:
        self._environment = environment
        self._seen, self._done = environment.observation_space, environment.action_space
        self.possible_agents = [f"player_{number}" for number in range(len(self._done))]
        self.agents: list[str] = []

    def observation_space(self, seat: str) -> Any:
        """As of ParallelEnv; so is the following."""
        return self._seen[self.possible_agents.index(seat)]

    def action_space(self, seat: str) -> Any:
        return self._done[self.possible_agents.index(seat)]

    def reset(self, seed: int | None = None, options: Any = None) -> Any:
        observations, info = self._environment.reset(seed=seed)
        self.agents = self.possible_agents
        return self._by_seat(observations), self._of_all(info)

    def step(self, actions: dict[str, Any]) -> Any:
        listed = [actions[seat] for seat in self.possible_agents]
        observations, rewards, ended, cut, info = self._environment.step(listed)
        if ended or cut:
            self.agents = []
        told = self._by_seat(observations), self._by_seat(rewards)
        return *told, self._of_all(ended), self._of_all(cut), self._of_all(info)

    def _by_seat(self, listed: Any) -> dict[str, Any]:
        return dict(zip(self.possible_agents, listed, strict=True))

    def _of_all(self, value: Any) -> dict[str, Any]:
        return dict.fromkeys(self.possible_agents, value)


def foraging() -> Listed:
    """A team of two and two foods: one alone picks up the light ones, both together the others."""
    import lbforaging  # noqa: F401  # makes its environments known

    return Listed(gymnasium.make("Foraging-5x5-2p-2f-v3", disable_env_checker=True))


world = PettingZooWorld(
    {"foraging": foraging},
    sides=[["player_0", "player_1"]],
    packages=("lbforaging", "gymnasium"),
    most_steps=50,
)
