"""mpe2's simple tag: policies chase as a team, the prey is the baseline."""

from typing import Any

from mpe2 import simple_tag_v3

from nathlon import PettingZooWorld


def tag() -> Any:
    """The environment, 25 steps long."""
    return simple_tag_v3.parallel_env(max_cycles=25)


world = PettingZooWorld(
    {"tag": tag},
    sides=[["adversary_0", "adversary_1", "adversary_2"]],
    packages=("mpe2", "pettingzoo"),
    most_steps=25,
)
