"""A race lap by lap: what strategists can be tried on by the thousand, without cars that are driven."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from nathlon.policies.stint_model import CompoundLaps, StintModel, service_s
from nathlon.policies.strategy import PitWall
from nathlon.sim.rules import PitParameters
from nathlon.sim.service import Service

NOISE_S = 0.3
"""Standard deviation of a lap."""
FOLLOWS_S = 0.8
"""Behind a car that it cannot pass, a car follows so closely."""
PASSES_S = 0.7
"""By how much a car's lap must be faster to pass."""
GRID_S = 0.3
"""From one starting place to the next."""
OUT_S = 600.0
"""What a race takes longer for a car that runs out of fuel, and is out."""

Floats = NDArray[np.float64]


class LapRace:
    """One race of cars with the same stint model, each with a pace of its own.

    Attributes:
        laps: of the race.
        lap: that all cars have completed.
        time_s: (cars,) when they did.
        wear: (cars,) of their tyres.
        fuel_kg: (cars,).
        out: (cars,) bool, without fuel.
        stops: (cars,) int64.
        compounds: of their tyres.
    """

    def __init__(
        self,
        model: StintModel,
        laps: int,
        pit: PitParameters,
        tank_kg: float,
        pace_s: Sequence[float],
        rng: np.random.Generator,
        noise_s: float = NOISE_S,
    ) -> None:
        """Cars on the grid with full tanks and the model's first compound.

        Args:
            model: of the laps.
            laps: of the race.
            pit: what a stop takes.
            tank_kg: fuel in a full tank.
            pace_s: what each car takes longer than the model, s a lap; from pole on.
            rng: of the laps' noise.
            noise_s: its standard deviation.
        """
        cars = len(pace_s)
        self.laps, self.lap = laps, 0
        self._model, self._pit, self._tank_kg, self._rng = model, pit, tank_kg, rng
        self._noise_s = noise_s
        self._pace_s = np.array(pace_s)
        self._by_name = {compound.name: compound for compound in model.compound}
        self.time_s = GRID_S * np.arange(cars, dtype=np.float64)
        self.wear, self.fuel_kg = np.zeros(cars), np.full(cars, tank_kg)
        self.out, self.stops = np.zeros(cars, bool), np.zeros(cars, np.int64)
        self.compounds = [model.compound[0].name] * cars
        self._last_lap_s = np.full(cars, np.nan)

    def fit(self, car: int, service: Service) -> None:
        """Have a car start as its strategist says."""
        self.compounds[car] = service.compound or self.compounds[car]
        if service.fuel_kg is not None:
            self.fuel_kg[car] = min(service.fuel_kg, self._tank_kg)

    def wall(self, car: int) -> PitWall:
        """What a car's strategist knows at the beginning of the next lap."""
        cars = len(self.time_s)
        return PitWall(
            car=car,
            laps=self.laps,
            lap=self.lap,
            ends_lap=self.lap + 1,
            wear=np.full(4, self.wear[car]),
            fuel_kg=float(self.fuel_kg[car]),
            last_lap_s=self._last_lap_s.copy(),
            gap_s=self.time_s - self.time_s.min(),
            compounds=tuple(self.compounds),
            laps_done=np.full(cars, self.lap),
            stops=self.stops.copy(),
            pit=self._pit,
            tank_kg=self._tank_kg,
            penalty_s=np.zeros(cars),
        )

    def drive(self, services: Sequence[Service | None]) -> Floats:
        """Drive a lap; those that are told to stop do at its end, but for the last.

        Returns:
            (cars,) what it took, stops included, s.
        """
        before, order = self.time_s.copy(), np.argsort(self.time_s, kind="stable")
        for car in range(len(before)):
            self.time_s[car] += self._alone(car)
        self._hold_up(order, before)
        if self.lap + 1 < self.laps:
            for car, service in enumerate(services):
                if service is not None and not self.out[car]:
                    self._stop(car, service)
        self.lap += 1
        self._last_lap_s = self.time_s - before
        return self._last_lap_s

    def _alone(self, car: int) -> float:
        """What a car's lap takes on a clear road, s; its tyres and fuel get less."""
        noise = self._noise_s * float(self._rng.standard_normal())
        if self.out[car]:
            return 0.0
        compound = self._by_name[self.compounds[car]]
        age = compound.age(float(self.wear[car]))
        [lap_s], [used_kg] = compound.laps(age, 1)
        if used_kg > self.fuel_kg[car]:
            self.out[car] = True
            return OUT_S
        taken = lap_s + self._model.fuel_s_kg * self.fuel_kg[car] + self._pace_s[car] + noise
        self.fuel_kg[car] -= used_kg
        self.wear[car] = _worn(compound, age + 1.0)
        return float(taken) + (self._model.start_s if self.lap == 0 else 0.0)

    def _hold_up(self, order: NDArray[np.intp], before: Floats) -> None:
        """Have cars stay behind those that they come up to and are not fast enough to pass."""
        pace = self.time_s - before
        for place, car in enumerate(order):
            for ahead in order[:place]:
                if self.out[ahead] or self.out[car] or pace[car] < pace[ahead] - PASSES_S:
                    continue
                self.time_s[car] = max(self.time_s[car], self.time_s[ahead] + FOLLOWS_S)

    def _stop(self, car: int, service: Service) -> None:
        added = max(min(service.fuel_kg or 0.0, self._tank_kg) - self.fuel_kg[car], 0.0)
        tyres = service.compound is not None
        self.time_s[car] += self._model.stop_s + float(service_s(self._pit, tyres, added))
        self.fuel_kg[car] += added
        self.stops[car] += 1
        if service.compound is not None:
            self.compounds[car], self.wear[car] = service.compound, 0.0


def _worn(compound: CompoundLaps, age: float) -> float:
    """Wear of tyres that have driven so many laps; beyond what was practised as in the last lap that was."""
    known = [0.0, *compound.wear]
    beyond = max(age - len(compound.wear), 0.0) * (known[-1] - known[-2])
    return float(np.interp(age, np.arange(len(known)), known)) + beyond
