"""What the other interpreter imports: the game, which knows one player, with two.

Whose side the ball falls on loses a point, and after five of them the game. Both see it from their side.
"""

from __future__ import annotations

from typing import Any

import slimevolleygym  # type: ignore[import-not-found]


class Six(slimevolleygym.SlimeVolleyEnv):  # type: ignore[misc]
    """The game with six choices instead of three buttons."""

    atari_mode = True


class Volley:
    """It as a ParallelEnv."""

    possible_agents = ("left", "right")

    def __init__(self) -> None:
        self._game, self.agents = Six(), []  # type: Any, Any

    def observation_space(self, seat: str) -> Any:
        """As of ParallelEnv; so is the following."""
        return self._game.observation_space

    def action_space(self, seat: str) -> Any:
        return self._game.action_space

    def reset(self, seed: int) -> tuple[dict[str, Any], dict[str, Any]]:
        self._game.seed(seed)
        self._game.reset()
        self.agents = list(self.possible_agents)
        return self._seen(), {}

    def step(self, actions: dict[str, Any]) -> Any:
        _, reward, over, _ = self._game.step(actions["right"], actions["left"])
        ends = dict.fromkeys(self.agents, over)
        if over:
            self.agents = []
        return self._seen(), {"left": -reward, "right": reward}, ends, dict.fromkeys(ends, False), {}

    def _seen(self) -> dict[str, Any]:
        game = self._game.game
        return {"left": game.agent_left.getObservation(), "right": game.agent_right.getObservation()}
