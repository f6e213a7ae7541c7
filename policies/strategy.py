"""Strategists: who decides when a car stops, and what is done to it then."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import accumulate
from typing import Annotated, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, field_validator

from nathlon.sim.car import Car, load_compounds
from nathlon.sim.data_file import Section
from nathlon.sim.rules import PitParameters
from nathlon.sim.scenario import MOST_LAPS, Scenario
from nathlon.sim.service import Service
from nathlon.sim.weather import Weather, wet_share


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
        compounds: of the tyres of all cars.
        laps_done: of all cars (cars,) int64.
        stops: of all cars (cars,) int64.
        pit: what a stop takes.
        tank_kg: fuel in a full tank.
        penalty_s: that all cars (cars,) have still to serve, s.
        time_s: since the start.
        cars_per_km: that drive, on a kilometre of the circuit: they throw water off the road.
        film_mm: water on the road.
        rain_mm_h: how hard it rains.
        forecast: weathers that agree with the rain so far, with their chances; none without weather.
    """

    car: int
    laps: int | None
    lap: int
    ends_lap: int
    wear: NDArray[np.float64]
    fuel_kg: float
    last_lap_s: NDArray[np.float64]
    gap_s: NDArray[np.float64]
    compounds: tuple[str, ...]
    laps_done: NDArray[np.int64]
    stops: NDArray[np.int64]
    pit: PitParameters
    tank_kg: float
    penalty_s: NDArray[np.float64]
    time_s: float = 0.0
    cars_per_km: float = 0.0
    film_mm: float = 0.0
    rain_mm_h: float = 0.0
    forecast: tuple[Weather, ...] = ()

    @property
    def last_lap(self) -> bool:
        """Whether the race is over when the car comes back from a stop at the next entry."""
        return self.laps is not None and self.ends_lap >= self.laps


class Strategist(Protocol):
    """Decides for one car at a time; it keeps nothing between calls, so that it can serve any number."""

    def start(self, wall: PitWall) -> Service:
        """With what the car starts."""
        ...

    def decide(self, wall: PitWall) -> Service | None:
        """What is to be done at the next stop; None to drive on."""
        ...

    def pace(self, wall: PitWall) -> float:
        """Share of its own speed at which the car is to drive, within PACE; asked after the others."""
        ...


PACE = 0.5, 1.05
"""Least and greatest pace that a car can be told."""


class AtFullPace:
    """A strategist that leaves the speed to whoever drives."""

    def pace(self, wall: PitWall) -> float:
        """See `Strategist.pace`."""
        return 1.0


class Stint(Section):
    """What is driven on one set of tyres.

    Attributes:
        laps: until the stop; the last stint lasts to the end, whatever it says.
        compound: of the tyres, new; None for those that the car starts with, or has on.
        fuel_kg: in the tank at its beginning; None for a full one at the start, and to add none at a stop.
        pace: share of its own speed at which the car drives.
    """

    laps: Annotated[int, Field(ge=1, le=MOST_LAPS)]
    compound: str | None = None
    fuel_kg: Annotated[float, Field(ge=0, le=1e5)] | None = None
    pace: Annotated[float, Field(ge=PACE[0], le=PACE[1])] = 1.0

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

    def start(self, wall: PitWall) -> Service:
        """See `Strategist.start`."""
        return self._stints[0].service

    def decide(self, wall: PitWall) -> Service | None:
        """See `Strategist.decide`; a stop that was missed is due in the next lap, unless that is the last."""
        stint = int(wall.stops[wall.car])
        if wall.last_lap or stint + 1 >= len(self._stints) or wall.ends_lap < self._ends[stint]:
            return None
        return self._stints[stint + 1].service

    def pace(self, wall: PitWall) -> float:
        """See `Strategist.pace`."""
        return self._stints[min(int(wall.stops[wall.car]), len(self._stints) - 1)].pace


NO_STOPS = StintPlan((Stint(laps=1),))
"""A plan of one stint, which lasts to the end."""

WORN = 0.85
"""Wear at which a car stops that has no plan."""
HALF_WORN = 0.4
"""Wear from which it gets new tyres when it stops for fuel."""
WET = tuple(name for name, one in load_compounds().items() if one.treaded)
"""Compounds that it may be given in the rain."""
BETTER = 1.04
"""How much more other tyres must grip on the road as it is, before it stops for them."""


def suiting(film_mm: float, compounds: Sequence[str]) -> dict[str, float]:
    """The grip of compounds in water, against racing-medium on dry road."""
    known = load_compounds()
    return {
        name: known[name].grip * float(wet_share(film_mm, known[name].film_mm) if film_mm else 1.0)
        for name in compounds
    }


class WhenNeeded(AtFullPace):
    """A strategist without a plan: it stops when tyres are worn or do not suit the road, or fuel is short.

    Tyres are worn at `WORN`; fuel is short if it would not last two laps at full power. The car gets a full
    tank, and new tyres, those that suit the road best, unless its own do and are good for as long again.
    """

    def __init__(self, car: Car, compound: str, fuel_rate: float) -> None:
        """For a car that starts on a compound and burns fuel at a multiple of its own rate."""
        engine, fuel = car.engine, car.fuel
        powers = np.array(engine.rpm) * np.array(engine.torque_n_m) * 2.0 * np.pi / 60.0
        self._burnt_kg_s = fuel_rate * fuel.consumption_kg_j * float(powers.max())
        self._compounds = tuple(dict.fromkeys((compound, *WET)))

    def start(self, wall: PitWall) -> Service:
        """See `Strategist.start`."""
        return Service(self._best(wall)) if wall.forecast else Service()

    def decide(self, wall: PitWall) -> Service | None:
        """See `Strategist.decide`."""
        left = np.inf if wall.laps is None else wall.laps - wall.lap
        lap_s = float(np.nan_to_num(wall.last_lap_s[wall.car]))
        short = wall.fuel_kg < min(2.0, left) * lap_s * self._burnt_kg_s
        wear, best = float(wall.wear.max()), self._best(wall)
        unsuited = best != wall.compounds[wall.car]
        if not short and (left <= 2 or (wear <= WORN and not unsuited)):
            return None
        return Service(best if unsuited or wear > HALF_WORN else None, wall.tank_kg)

    def _best(self, wall: PitWall) -> str:
        """The compound that suits the road; the one on the car unless another is clearly better."""
        on = wall.compounds[wall.car]
        grips = suiting(wall.film_mm, (on, *(self._compounds if wall.forecast else self._compounds[:1])))
        best = max(grips, key=grips.__getitem__)
        return best if grips[best] > BETTER * grips[on] else on


def usual_strategist(scenario: Scenario, car: Car) -> Strategist | None:
    """Who decides for cars whose policies have no strategist; None where they never stop."""
    compound = scenario.compound or car.tyre.compound
    if scenario.stops_when_needed:
        return WhenNeeded(car, compound, scenario.fuel_rate)
    if scenario.stop_after is not None:
        return StintPlan([Stint(laps=scenario.stop_after), Stint(laps=1, compound=compound)])
    return None
