"""A strategist that plans the rest of the race anew whenever its car begins a lap."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from nathlon.policies.stint_model import CompoundLaps, StintModel, service_s
from nathlon.policies.strategy import PitWall
from nathlon.sim.rules import PitParameters
from nathlon.sim.world import Service

SPARE_KG = 2.0
"""More fuel in a stint than its laps took in practice."""
LEAST_SPARE_KG = 0.5
"""With less than this at the end of a stint a car is taken not to reach it."""
AHEAD = 60
"""Laps for which it plans where a race has no number of laps."""


class NextStint(NamedTuple):
    """What is driven from a stop on.

    Attributes:
        compound: of the tyres.
        laps: until the next stop, or to the end.
        fuel_kg: in the tank at its beginning.
        seconds: what is left of the race takes, the stop included.
    """

    compound: str
    laps: int
    fuel_kg: float
    seconds: float

    @property
    def service(self) -> Service:
        """What is done to the car at that stop."""
        return Service(self.compound, self.fuel_kg)


class StintPlanner:
    """Weighs every lap in which the next stop may be, by its model and the actual tyres and fuel.

    What comes after that stop is the fastest there is by dynamic programming. Other cars are not reckoned
    with. It keeps nothing that its answers depend on.
    """

    def __init__(self, model: StintModel) -> None:
        """A strategist with a model of its car's laps."""
        self._model = model
        self._compounds = {compound.name: compound for compound in model.compound}
        self._stints = [
            self._stint(compound, laps)
            for compound in model.compound
            for laps in range(1, len(compound.lap_s) + 1)
        ]
        self._rest = lru_cache(maxsize=8)(self._plan_all)

    def start(self, wall: PitWall) -> Service:
        """See `nathlon.policies.strategy.Strategist.start`."""
        laps = wall.laps or AHEAD
        rest = self._rest(laps, wall.pit, wall.tank_kg)
        first = min(self._ways(laps, wall.tank_kg, rest), key=_seconds, default=None)
        return Service(self._model.compound[0].name) if first is None else first.service

    def decide(self, wall: PitWall) -> Service | None:
        """See `nathlon.policies.strategy.Strategist.decide`."""
        if wall.last_lap:
            return None
        laps = wall.laps - wall.lap if wall.laps else AHEAD
        rest = self._rest(laps if wall.laps is None else wall.laps, wall.pit, wall.tank_kg)
        soonest = wall.ends_lap - wall.lap
        taken_s, left_kg = self._drive_on(wall, laps)
        best_s, best = np.inf, None
        for driven in range(soonest, laps):
            after = rest[laps - driven]
            # A stop at once is always possible, also for a car that will not reach its entry.
            if after is None or (left_kg[driven] < LEAST_SPARE_KG and driven > soonest):
                continue
            whole_s = taken_s[driven] + self._with_fuel(after, max(left_kg[driven], 0.0), wall.pit)
            if whole_s < best_s:
                best_s, best = whole_s, after if driven == soonest else None
        if left_kg[laps] >= LEAST_SPARE_KG and taken_s[laps] <= best_s:
            return None
        return best.service if best else None

    def fuel_for(self, compound: str, left: int, pit: PitParameters, tank_kg: float) -> float:
        """Fuel for the fastest stint on a compound with so many laps to go, kg; a full tank if none lasts."""
        rest = self._rest(left, pit, tank_kg)
        ways = (way for way in self._ways(left, tank_kg, rest) if way.compound == compound)
        best = min(ways, key=_seconds, default=None)
        return tank_kg if best is None else best.fuel_kg

    def _drive_on(self, wall: PitWall, laps: int) -> tuple[list[float], list[float]]:
        """What 0, 1... `laps` more laps without a stop take, s, and leave in the tank, kg."""
        compound = self._compounds.get(wall.compounds[wall.car], self._model.compound[0])
        lap_s, used_kg = compound.laps(compound.age(float(wall.wear.mean())), laps)
        used = np.concatenate([[0.0], np.cumsum(used_kg)])
        fuel_kg = wall.fuel_kg - used
        taken = np.cumsum(lap_s + self._model.fuel_s_kg * np.maximum(fuel_kg[:-1], 0.0))
        return [0.0, *taken.tolist()], fuel_kg.tolist()

    def _with_fuel(self, after: NextStint, left_kg: float, pit: PitParameters) -> float:
        """What the rest takes from a stop on at which something is left in the tank, s."""
        more = max(left_kg - after.fuel_kg, 0.0)
        added, usual = max(after.fuel_kg - left_kg, 0.0), after.fuel_kg - SPARE_KG
        differs_s = self._stop_s(added, pit) - self._stop_s(usual, pit)
        return after.seconds + differs_s + self._model.fuel_s_kg * more * after.laps

    def _plan_all(self, laps: int, pit: PitParameters, tank_kg: float) -> list[NextStint | None]:
        """The fastest stint after a stop with 0, 1... `laps` laps to go; None where no tank lasts."""
        rest: list[NextStint | None] = [None]
        for left in range(1, laps + 1):
            ways = (
                way._replace(seconds=way.seconds + self._stop_s(way.fuel_kg - SPARE_KG, pit))
                for way in self._ways(left, tank_kg, rest)
            )
            rest.append(min(ways, key=_seconds, default=None))
        return rest

    def _stop_s(self, added_kg: float, pit: PitParameters) -> float:
        return self._model.stop_s + service_s(pit, True, added_kg)

    def _ways(self, left: int, tank_kg: float, rest: Sequence[NextStint | None]) -> Iterator[NextStint]:
        """All stints that can be driven next with so many laps to go, without a stop before them."""
        for stint in self._stints:
            if stint.laps > left or stint.fuel_kg > tank_kg:
                continue
            then = rest[left - stint.laps]
            if then is None and stint.laps < left:
                continue
            yield stint._replace(seconds=stint.seconds + (then.seconds if then else 0.0))

    def _stint(self, compound: CompoundLaps, laps: int) -> NextStint:
        """One on new tyres, without the stop before it and what comes after."""
        lap_s, used_kg = np.array(compound.lap_s[:laps]), np.array(compound.used_kg[:laps])
        fuel_kg = round(float(used_kg.sum()) + SPARE_KG, 1)
        carried = fuel_kg - (np.cumsum(used_kg) - used_kg)
        seconds = float(lap_s.sum() + self._model.fuel_s_kg * carried.sum())
        return NextStint(compound.name, laps, fuel_kg, seconds)


def _seconds(stint: NextStint) -> float:
    return stint.seconds
