"""PettingZoo's connect four: two seats that move in turn, won or lost, and nothing is measured in metres.

nathlon evaluate runs/four-1 --world examples/worlds/four.py:world --out runs/four-1-selected
"""

from typing import Any

import numpy as np
from gymnasium.spaces import Box, Discrete
from pettingzoo.classic import connect_four_v3

from nathlon import PettingZooWorld

OPENING = 4
"""Moves drawn at first: without them two policies that draw nothing would always play the same game."""


class Four:
    """Connect four as a ParallelEnv: whoever is not to move is asked too, and what it says is ignored."""

    possible_agents = ("player_0", "player_1")
    render_mode = "rgb_array"
    metadata: dict[str, Any] = {"name": "four"}  # noqa: RUF012

    def __init__(self) -> None:
        self._game, self.agents = connect_four_v3.raw_env(self.render_mode), list[str]()
        # Own discs, then the other's; a column, for which the nearest that is not full is taken.
        self.observation_space = lambda _: Box(0.0, 1.0, (84,), np.float32)
        self.action_space = lambda _: Discrete(7)

    def reset(self, seed: int | None = None, options: Any = None) -> Any:
        """As of ParallelEnv."""
        self._game.reset()
        self.agents = list(self.possible_agents)
        for column in np.random.default_rng(seed).integers(7, size=OPENING):
            self._game.step(int(column))
        return self._seen(), {agent: {} for agent in self.agents}

    def step(self, actions: dict[str, int]) -> Any:
        """As of ParallelEnv."""
        mover, agents = self._game.agent_selection, self.agents
        free = np.flatnonzero(self._game.observe(mover)["action_mask"])
        self._game.step(int(free[np.abs(free - actions[mover]).argmin()]))
        ends = {agent: bool(self._game.terminations[agent]) for agent in agents}
        self.agents = [agent for agent in agents if not ends[agent]]
        rewards = {agent: float(self._game.rewards[agent]) for agent in agents}
        return self._seen(), rewards, ends, dict.fromkeys(agents, False), {agent: {} for agent in agents}

    def render(self) -> Any:
        """As of ParallelEnv."""
        return self._game.render()

    def _seen(self) -> dict[str, Any]:
        boards = {agent: self._game.observe(agent)["observation"] for agent in self.possible_agents}
        return {agent: board.transpose(2, 0, 1).ravel().astype(np.float32) for agent, board in boards.items()}


world = PettingZooWorld(
    {"four": Four}, points="place", episode="game", packages=("pettingzoo",), most_steps=42, step_s=0.5
)
