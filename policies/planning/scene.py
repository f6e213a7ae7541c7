"""What a planner is shown: a world, and which of its cars it drives."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from nathlon.sim.world import World


class Scene(NamedTuple):
    """The world as it is, not to be changed, and the planner's cars in it.

    Attributes:
        world: races in which the cars drive.
        races, cars: (n,) indices of the cars.
    """

    world: World
    races: NDArray[np.int64]
    cars: NDArray[np.int64]
