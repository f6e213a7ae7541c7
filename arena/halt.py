"""A race that stands still: all that decides how it goes on."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from nathlon.policies.policy import Batch
from nathlon.sim.state import CAR_STATE, CONTACT, Races

MEMORY = "memory_"
"""What the names of arrays begin with that hold the memory of a car's policy; its index follows."""


class Halt(NamedTuple):
    """The state of a match between two legs: copies.

    Attributes:
        races: as of `World.arrays`.
        endings: (races, cars) str, how runs have ended; '' while they last.
        driven: (races, cars) float64, time until then, s.
        pit_walls: notes of `PitWalls`.
        memory: (m,) float32 of the policy of each car, by its index in the world.
    """

    races: Races
    endings: NDArray[np.str_]
    driven: NDArray[np.float64]
    pit_walls: str
    memory: Mapping[int, Batch]

    def arrays(self) -> dict[str, NDArray]:
        """All of it as arrays by name, for a file."""
        named = {MEMORY + str(car): row for car, row in self.memory.items()}
        kept = {"endings": self.endings, "driven": self.driven, "pit_walls": np.array(self.pit_walls)}
        return {**self.races._asdict(), **kept, **named}

    @classmethod
    def of(cls, arrays: Mapping[str, NDArray]) -> Halt:
        """From arrays as of `arrays`.

        Raises:
            KeyError: if one is missing.
            ValueError: if cars or contacts are not what this version keeps of them.
        """
        races = Races(**{name: arrays[name] for name in Races._fields})
        if races.cars.dtype != CAR_STATE or races.contacts.dtype != CONTACT:
            raise ValueError("cars or contacts are of another version")
        memory = {int(name.removeprefix(MEMORY)): row for name, row in arrays.items() if MEMORY in name}
        return cls(races, arrays["endings"], arrays["driven"], str(arrays["pit_walls"]), memory)
