"""What a planner is shown: a world, and which of its cars it drives."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from nathlon.sim.blue_flags import NOBODY
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

    @property
    def grips(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Grip of the cars, and slip at its peak, as multiples of those of own tyres on dry road; (n,)."""
        state = self.world.state[self.races, self.cars]
        if not self.world.conditions.weather:
            return np.ones(len(state)), np.ones(len(state))
        first = np.array([self.world.first_grip(car) for car in self.world.models])
        return first[state["model"]] * state["tyre_grip"] * state["wet_grip"], state["wet_peak"]

    @property
    def flagged(self) -> NDArray[np.bool_]:
        """Which of the cars are shown a blue flag, (n,)."""
        return np.asarray(self.world.state["flagged_for"][self.races, self.cars] != NOBODY)

    @property
    def pace(self) -> NDArray[np.float64]:
        """Shares of their pace at which the cars are told to drive, (n,)."""
        return np.asarray(self.world.state["pace"][self.races, self.cars])
