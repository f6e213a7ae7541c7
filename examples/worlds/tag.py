"""mpe2's simple tag: three policies chase as a team; the prey, whose spaces are others, is the baseline.

nathlon evaluate runs/tag-1 --world examples/worlds/tag.py:world --out runs/tag-1-selected
"""

from typing import Any

import numpy as np
from mpe2 import simple_tag_v3
from pettingzoo.utils.wrappers import BaseParallelWrapper

from nathlon import Declared, PettingZooWorld

STEPS = 25
CHASERS = ["adversary_0", "adversary_1", "adversary_2"]
PREY = slice(12, 14)
"""Where a chaser sees the prey, from itself."""


class Watched(BaseParallelWrapper):  # type: ignore[misc]
    """Tells in infos how far the prey is from the nearest chaser."""

    def step(self, actions: dict[str, Any]) -> Any:
        """As of ParallelEnv."""
        observations, rewards, ends, cuts, _ = super().step(actions)
        nearest = min(float(np.linalg.norm(observations[chaser][PREY])) for chaser in CHASERS)
        return observations, rewards, ends, cuts, {name: {"nearest": nearest} for name in rewards}


def tag() -> Any:
    """A hunt of 25 steps."""
    return Watched(simple_tag_v3.parallel_env(max_cycles=STEPS, render_mode="rgb_array"))


world = PettingZooWorld(
    {"tag": tag},
    sides=[CHASERS],
    score=lambda seat: seat.total / 10,  # catches of the whole team, each rewarded with 10
    measures={"nearest": Declared(lambda seat: seat.infos["nearest"] / seat.steps, goal="min")},
    packages=("mpe2", "pettingzoo"),
    most_steps=STEPS,
)
