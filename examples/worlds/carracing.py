"""Gymnasium's CarRacing: one seat, and so no tournament; the picture is made small and grey.

nathlon evaluate runs/carracing-1 --world examples/worlds/carracing.py:world --out runs/carracing-1-selected
"""

from typing import Any

import gymnasium
import numpy as np
from gymnasium.spaces import Box

from nathlon import GymnasiumWorld

STEPS, HOLD = 100, 8


class Small(gymnasium.Wrapper[Any, Any, Any, Any]):
    """Grey pictures of 12 x 12, and every action held for 8 frames."""

    def __init__(self, environment: gymnasium.Env[Any, Any]) -> None:
        super().__init__(environment)
        self.observation_space = Box(0.0, 1.0, (144,), np.float32)

    def reset(self, **kwargs: Any) -> Any:
        """As of Env."""
        seen, info = super().reset(**kwargs)
        return _small(seen), info

    def step(self, action: Any) -> Any:
        """As of Env."""
        total = 0.0
        for _ in range(HOLD):
            seen, reward, terminated, truncated, info = super().step(action)
            total += float(reward)
            if terminated or truncated:
                break
        return _small(seen), total, terminated, truncated, info


def _small(picture: Any) -> Any:
    road = picture[:84, :84].mean(axis=2, dtype=np.float32) / 255  # without the instruments below
    return road.reshape(12, 7, 12, 7).mean(axis=(1, 3)).ravel()


def drive() -> Any:
    """CarRacing with five actions: nothing, left, right, throttle, brake."""
    return Small(gymnasium.make("CarRacing-v3", continuous=False, render_mode="rgb_array"))


world = GymnasiumWorld(
    {"drive": drive},
    packages=("gymnasium", "box2d"),
    most_steps=STEPS,
    step_s=HOLD / 50,
)
