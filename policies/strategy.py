"""Strategists: who decides when a car stops, and what is done to it then."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import accumulate
from typing import Annotated, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, field_validator

from nathlon.sim.car import load_compounds
from nathlon.sim.data_file import Section
from nathlon.sim.scenario import MOST_LAPS
from nathlon.sim.world import Service


class PitWall(NamedTuple):
    """What a strategist knows when its car begins a lap.

    Attributes:
        car: index in the race.
        laps: of the race; None where it is not driven in laps.
        lap: laps that the car has completed.
        ends_lap: laps that it will have completed when it comes back from a stop at the next entry.
        wear: (4,) of its tyres, 1 is worn out.
        fuel_kg: in its tank.
        last_lap_s: of all cars (cars,), nan before a lap.
        gap_s: of all cars (cars,) to the leader at the last timing line, nan for those a lap behind.
        laps_done: of all cars (cars,) int64.
        stops: of all cars (cars,) int64.
    """

    car: int
    laps: int | None
    lap: int
    ends_lap: int
    wear: NDArray[np.float64]
    fuel_kg: float
    last_lap_s: NDArray[np.float64]
    gap_s: NDArray[np.float64]
    laps_done: NDArray[np.int64]
    stops: NDArray[np.int64]


class Strategist(Protocol):
    """Decides for one car at a time; it keeps nothing between calls, so that it can serve any number."""

    def start(self, laps: int | None) -> Service:
        """With what the car starts a race of so many laps."""
        ...

    def decide(self, wall: PitWall) -> Service | None:
        """What is to be done at the next stop; None to drive on."""
        ...


class Stint(Section):
    """What is driven on one set of tyres.

    Attributes:
        laps: until the stop; the last stint lasts to the end, whatever it says.
        compound: of the tyres, new; None for those that the car starts with, or has on.
        fuel_kg: in the tank at its beginning; None for a full one at the start, and to add none at a stop.
    """

    laps: Annotated[int, Field(ge=1, le=MOST_LAPS)]
    compound: str | None = None
    fuel_kg: Annotated[float, Field(ge=0, le=1e5)] | None = None

    @field_validator("compound")
    @classmethod
    def _known(cls, compound: str | None) -> str | None:
        if compound is not None and compound not in load_compounds():
            raise ValueError(f"expected one of {', '.join(load_compounds())}")
        return compound

    @property
    def service(self) -> Service:
        """What is done to the car before it."""
        return Service(self.compound, self.fuel_kg)


class StintPlan:
    """A strategist with a plan: after each stint it stops, and never otherwise."""

    def __init__(self, stints: Sequence[Stint]) -> None:
        """A plan of one stint or more."""
        self._stints = stints
        self._ends = list(accumulate(stint.laps for stint in stints))

    def start(self, laps: int | None) -> Service:
        """See `Strategist.start`."""
        return self._stints[0].service

    def decide(self, wall: PitWall) -> Service | None:
        """See `Strategist.decide`; a stop that was missed is due in the next lap."""
        stint = int(wall.stops[wall.car])
        over = wall.laps is not None and wall.ends_lap >= wall.laps
        # A plan for a longer race would have it stop, and stand, just before the finish.
        if over or stint + 1 >= len(self._stints) or wall.ends_lap < self._ends[stint]:
            return None
        return self._stints[stint + 1].service
