"""PettingZoo's multiwalker: one policy walks with all three walkers, who carry a package together.

nathlon evaluate runs/walkers-1 --world examples/worlds/walkers.py:world --out runs/walkers-1-selected
"""

from typing import Any

from pettingzoo.sisl import multiwalker_v9

from nathlon import Declared, PettingZooWorld

STEPS = 200


def walk() -> Any:
    """A walk that ends when somebody falls; all are rewarded alike."""
    return multiwalker_v9.parallel_env(max_cycles=STEPS, render_mode="rgb_array")


world = PettingZooWorld(
    {"walk": walk},
    sides=[["walker_0", "walker_1", "walker_2"]],
    measures={"upright": Declared(lambda seat: float(seat.steps), unit="steps")},
    packages=("pettingzoo", "box2d"),
    most_steps=STEPS,
    step_s=1 / 50,
)
