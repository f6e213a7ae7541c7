"""CartPole of gym 0.25 in an interpreter of its own, with numpy below 1.24: its pins are older than ours.

python -m venv old && old/bin/pip install gym==0.25.2 "numpy<1.24"
OLD_GYM=$PWD/old/bin/python nathlon evaluate runs/old_gym-1 --world examples/worlds/old_gym.py:world
"""

import os
from typing import Any

import gymnasium

from nathlon import GymnasiumWorld

world = GymnasiumWorld(
    {"pole": "old_gym_pole.py:pole"},
    python=os.environ.get("OLD_GYM", "old/bin/python"),
    packages=("gym",),
    most_steps=500,
)


def pole() -> Any:
    """The same pole of today's Gymnasium, for training."""
    return gymnasium.make("CartPole-v1")
