"""Masks of actions reach those who act: from infos, from observations, and from the environment."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.spaces import Box, Dict, Discrete

from nathlon import GymnasiumWorld
from nathlon.arena.worlds.player import _allowed

SEEN = Box(-1.0, 1.0, (2,), np.float32)
MASKS = [[1, 0, 1], [0, 1, 1], [1, 1, 0]]


class Counting(gymnasium.Env[Any, Any]):
    """Three steps, each with its mask."""

    action_space = Discrete(3)

    def __init__(self, told: str) -> None:
        self.told, self.steps = told, 0
        masked = Dict({"observation": SEEN, "action_mask": Box(0, 1, (3,), np.int8)})
        self.observation_space = masked if told == "observation" else SEEN

    def reset(self, *, seed: int | None = None, options: Any = None) -> Any:
        self.steps = 0
        return self._seen()

    def step(self, action: Any) -> Any:
        self.steps += 1
        seen, info = self._seen()
        return seen, 0.0, self.steps == 3, False, info

    def _seen(self) -> Any:
        mask, plain = np.array(MASKS[self.steps % 3], np.int8), np.zeros(2, np.float32)
        seen = {"observation": plain, "action_mask": mask} if self.told == "observation" else plain
        return seen, {"action_mask": mask} if self.told == "info" else {}


class Asked(Counting):
    """It is asked for its masks."""

    def action_masks(self) -> Any:
        return np.array(MASKS[self.steps % 3], bool)


class Noting:
    """A player that notes the masks that it is shown."""

    def __init__(self) -> None:
        self.masks: list[Any] = []

    def act(self, observation: Any, mask: Any = None) -> Any:
        allowed = _allowed(observation, mask)
        self.masks.append(None if allowed is None else allowed.astype(int).tolist())
        return 0


@pytest.mark.parametrize("told", ["info", "observation", "environment", "nobody"])
def test_masks_reach_those_who_act(told: str) -> None:
    def make() -> Any:
        environment = Asked(told) if told == "environment" else Counting(told)
        return gymnasium.wrappers.TimeLimit(environment, 9)

    player = Noting()
    GymnasiumWorld({"counting": make}).play("counting", [player], 0)
    assert player.masks == (MASKS if told != "nobody" else [None] * 3)
