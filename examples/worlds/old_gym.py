"""CartPole of gym 0.25 in an interpreter of its own, with numpy below 1.24: its pins are older than ours.

python -m venv old && old/bin/pip install gym==0.25.2 "numpy<1.24"
OLD_GYM=old/bin/python nathlon evaluate runs/pole --world examples/worlds/old_gym.py:world
"""

import os

from nathlon import GymnasiumWorld

world = GymnasiumWorld(
    {"pole": "old_gym_pole.py:pole"},
    python=os.environ.get("OLD_GYM", "old/bin/python"),
    packages=("gym",),
    most_steps=500,
)
