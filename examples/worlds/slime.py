"""slimevolleygym of 2020, a game of two for the Gym of old, in an interpreter of its own.

python3.11 -m venv old
old/bin/pip install slimevolleygym==0.1.0 gym==0.25.2 "numpy<1.24" "opencv-python-headless<4.9"
OLD_GYM=$PWD/old/bin/python python -m examples.worlds.train slime runs/slime-1
OLD_GYM=$PWD/old/bin/python nathlon evaluate runs/slime-1 --world examples/worlds/slime.py:world
"""

import os
from pathlib import Path
from typing import Any

from nathlon import PettingZooWorld

world = PettingZooWorld(
    {"volley": f"{Path(__file__).with_name('slime_game.py')}:Volley"},
    python=os.environ.get("OLD_GYM", "old/bin/python"),
    packages=("slimevolleygym", "gym"),
    episode="game",
    most_steps=1000,
    step_s=1 / 30,
)


def volley() -> Any:
    """The same game, for training here."""
    return world.made("volley")
