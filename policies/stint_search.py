"""The fastest stints of a race on a clear road: dynamic programming over laps to go and fuel in the tank."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from nathlon.policies.stint_model import CompoundLaps, StintModel, service_s
from nathlon.sim.rules import PitParameters
from nathlon.sim.service import Service

SPARE_KG = 2.0
"""More fuel in a stint than its laps took in practice."""
MARGIN_S = 3.0
"""By so much a stop must gain: models err by some seconds a stop, and who stops meets slower cars."""
CELLS = 40
"""Into which a tank is divided; between them what the rest takes is interpolated."""

Floats = NDArray[np.float64]
Rest = list[Floats | None]
"""What a race takes from a stop on with 0, 1... laps to go, (CELLS + 1,) s by the fuel with which a car comes
to it, the stop included; None where nothing can be driven so."""


class NextStint(NamedTuple):
    """What is driven from a stop on.

    Attributes:
        compound: of the tyres.
        laps: until the next stop, or to the end.
        fuel_kg: in the tank at its beginning.
        used_kg: of it.
        seconds: what is left of the race takes, the stop included, with the margin of every stop.
    """

    compound: str
    laps: int
    fuel_kg: float
    used_kg: float
    seconds: float

    @property
    def service(self) -> Service:
        """What is done to the car at that stop."""
        return Service(self.compound, self.fuel_kg)


class _Tyres(NamedTuple):
    """Laps on a new set of tyres: s each and together on dry road with an empty tank, kg used, and kg used
    before each lap, added up.
    """

    compound: str
    laps: int
    lap_s: Floats
    seconds: float
    used_kg: float
    before_kg: float

    @property
    def need_kg(self) -> float:
        """Fuel with which it is safe to begin."""
        return round(self.used_kg + SPARE_KG, 1)


class _Departures(NamedTuple):
    """Ways to drive on after a stop, without it: (n,) kg in the tank, s to the finish, and which tyres."""

    fuel_kg: Floats
    seconds: Floats
    tyres: NDArray[np.int64]


class StintSearch:
    """Finds the fastest stints of one model.

    A stint begins with what it needs, or with more where carrying fuel takes less than filling it in later.
    """

    def __init__(
        self,
        model: StintModel,
        pit: PitParameters,
        tank_kg: float,
        in_water: Mapping[str, Floats] | None = None,
    ) -> None:
        """A search where stops take what `pit` says.

        Args:
            model: of the laps.
            pit, tank_kg: what a stop takes, and the tank holds.
            in_water: by compound, (laps + 1,) by how many times longer a lap takes with 0, 1... laps to go
                when it begins; None on dry road.
        """
        self._model, self._pit, self._in_water = model, pit, in_water
        self._fuel_kg = np.linspace(0.0, tank_kg, CELLS + 1)
        sets = [_tyres(one, laps) for one in model.compound for laps in range(1, len(one.lap_s) + 1)]
        self._tyres = [tyres for tyres in sets if tyres.need_kg <= tank_kg]

    def rest(self, laps: int, known: Rest | None = None) -> Rest:
        """What is left of a race of up to so many laps, with as many stops as are fastest.

        Args:
            laps: to go.
            known: the same of fewer laps, at least of none.
        """
        rest: Rest = list(known or [np.zeros(CELLS + 1)])
        for left in range(len(rest), laps + 1):
            rest.append(self._from_stop(left, rest))
        return rest

    def rests(self, laps: int, most: int) -> list[Rest]:
        """The same with exactly 0, 1... `most` stints."""
        rests: list[Rest] = [[np.zeros(CELLS + 1), *[None] * laps]]
        for _ in range(most):
            rests.append([None, *(self._from_stop(left, rests[-1]) for left in range(1, laps + 1))])
        return rests

    def lap_s(self, compound: str, lap_s: Floats, left: int) -> Floats:
        """What laps (n,) on a compound take on this road that take some time on dry road, s.

        Args:
            compound: of the tyres.
            lap_s: (n,) on dry road.
            left: laps to go when the first begins.
        """
        if self._in_water is None:
            return lap_s
        return lap_s * self._in_water[compound][left - np.arange(len(lap_s))]

    def first(self, laps: int, rest: Rest, compound: str | None = None) -> NextStint | None:
        """The stint from the start of a race, for which the tank is filled before; None if there is none."""
        ways = self._ways(laps, rest, compound=compound)
        return None if ways is None else self._best(ways, ways.seconds)

    def after_stop(
        self, left: int, fuel_kg: float, rest: Rest, compound: str | None = None
    ) -> NextStint | None:
        """The fastest stint after a stop.

        Args:
            left: laps to go.
            fuel_kg: with which the car comes to the stop.
            rest: what comes after the stint.
            compound: of the stint, if it must be.

        Returns:
            None if there is none.
        """
        ways = self._ways(left, rest, fuel_kg, compound)
        return None if ways is None else self._best(ways, self._stopped(ways, fuel_kg))

    def seconds(self, left: int, fuel_kg: float, rest: Rest, compound: str | None = None) -> float:
        """What is left from a stop on to which a car comes with some fuel, s; inf if there is no way.

        Args:
            left, fuel_kg, rest, compound: as for `after_stop`.
        """
        known = rest[left] if compound is None else self._from_stop(left, rest, compound)
        return np.inf if known is None else float(np.interp(fuel_kg, self._fuel_kg, known))

    def _best(self, ways: _Departures, seconds: Floats) -> NextStint:
        best = int(seconds.argmin())
        tyres = self._tyres[ways.tyres[best]]
        fuel_kg = round(float(ways.fuel_kg[best]), 1)
        return NextStint(tyres.compound, tyres.laps, fuel_kg, tyres.used_kg, float(seconds[best]))

    def _from_stop(self, left: int, rest: Rest, compound: str | None = None) -> Floats | None:
        ways = self._ways(left, rest, compound=compound)
        if ways is None:
            return None
        return self._stopped(ways, self._fuel_kg[:, None]).min(axis=1)

    def _stopped(self, ways: _Departures, fuel_kg: Floats | float) -> Floats:
        """What ways take with the stop before them, s; inf where fuel would have to be taken out."""
        added = ways.fuel_kg - fuel_kg
        stop_s = self._model.stop_s + MARGIN_S + service_s(self._pit, True, np.maximum(added, 0.0))
        return np.where(added < -1e-9, np.inf, ways.seconds + stop_s)

    def _ways(
        self, left: int, rest: Rest, fuel_kg: float | None = None, compound: str | None = None
    ) -> _Departures | None:
        """All ways to drive on with so many laps to go; also with just the fuel that is there."""
        cells = self._fuel_kg if fuel_kg is None else np.append(self._fuel_kg, fuel_kg)
        fuels, seconds, numbers = [], [], []
        for number, tyres in enumerate(self._tyres):
            if tyres.laps > left or compound not in (None, tyres.compound):
                continue
            after = rest[left - tyres.laps]
            if after is None:
                continue
            fuel = np.append(cells[cells > tyres.need_kg], tyres.need_kg)
            carried = tyres.laps * fuel - tyres.before_kg
            then_s = np.interp(fuel - tyres.used_kg, self._fuel_kg, after)
            fuels.append(fuel)
            seconds.append(self._driving_s(tyres, left) + self._model.fuel_s_kg * carried + then_s)
            numbers.append(np.full(len(fuel), number))
        if not fuels:
            return None
        return _Departures(np.concatenate(fuels), np.concatenate(seconds), np.concatenate(numbers))

    def _driving_s(self, tyres: _Tyres, left: int) -> float:
        """What they take with an empty tank, begun with so many laps to go."""
        if self._in_water is None:
            return tyres.seconds
        return float(self.lap_s(tyres.compound, tyres.lap_s, left).sum())


def _tyres(compound: CompoundLaps, laps: int) -> _Tyres:
    lap_s, used_kg = np.array(compound.lap_s[:laps]), np.array(compound.used_kg[:laps])
    used = np.cumsum(used_kg)
    before_kg = float((used - used_kg).sum())
    return _Tyres(compound.name, laps, lap_s, float(lap_s.sum()), float(used[-1]), before_kg)
