"""mpe2's simple tag with both sides: an entrant has a policy to chase and one to flee, and does both in turn.

python -m examples.worlds.train pursuit runs/pursuit-1
nathlon evaluate runs/pursuit-1 --world examples/worlds/pursuit.py:world --out runs/pursuit-1-selected
"""

from typing import Any

from mpe2 import simple_tag_v3

from nathlon import PettingZooWorld

STEPS = 25
ROLES = {"chaser": ["adversary_0", "adversary_1", "adversary_2"], "prey": ["agent_0"]}


def pursuit() -> Any:
    """A hunt of 25 steps."""
    return simple_tag_v3.parallel_env(max_cycles=STEPS, render_mode="rgb_array")


world = PettingZooWorld(
    {"pursuit": pursuit},
    sides=list(ROLES.values()),
    roles=ROLES,
    packages=("mpe2", "pettingzoo"),
    most_steps=STEPS,
)
