"""A strategist that plans the rest of the race anew whenever its car begins a lap."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from nathlon.policies.stint_model import StintModel
from nathlon.policies.stint_search import Rest, StintSearch
from nathlon.policies.strategy import AtFullPace, PitWall
from nathlon.sim.rules import PitParameters
from nathlon.sim.service import Service

LEAST_SPARE_KG = 0.5
"""With less than this at the end of a stint a car is taken not to reach it."""
AHEAD = 60
"""Laps for which it plans where a race has no number of laps."""


class StintPlanner(AtFullPace):
    """Weighs every lap in which the next stop may be, by its model and the actual tyres and fuel.

    What comes after that stop is the fastest there is by dynamic programming. Other cars are not reckoned
    with. It keeps nothing that its answers depend on.
    """

    def __init__(self, model: StintModel) -> None:
        """A strategist with a model of its car's laps."""
        self._model = model
        self._compounds = {compound.name: compound for compound in model.compound}
        self._searched = lru_cache(maxsize=8)(self._search)

    def start(self, wall: PitWall) -> Service:
        """See `nathlon.policies.strategy.Strategist.start`."""
        laps = wall.laps or AHEAD
        search, rest = self._searched(laps, wall.pit, wall.tank_kg)
        first = search.first(laps, rest)
        return Service(self._model.compound[0].name) if first is None else first.service

    def decide(self, wall: PitWall) -> Service | None:
        """See `nathlon.policies.strategy.Strategist.decide`."""
        if wall.last_lap:
            return None
        laps = wall.laps - wall.lap if wall.laps else AHEAD
        search, rest = self._searched(wall.laps or AHEAD, wall.pit, wall.tank_kg)
        soonest = wall.ends_lap - wall.lap
        taken_s, left_kg = self._drive_on(wall, laps)
        best_s = taken_s[laps] if left_kg[laps] >= LEAST_SPARE_KG else np.inf
        stops_now = False
        for driven in range(soonest, laps):
            # A stop at once is always possible, also for a car that will not reach its entry.
            if left_kg[driven] < LEAST_SPARE_KG and driven > soonest:
                break
            whole_s = taken_s[driven] + search.seconds(laps - driven, left_kg[driven], rest)
            if whole_s < best_s:
                best_s, stops_now = whole_s, driven == soonest
        if not stops_now:
            return None
        after = search.after_stop(laps - soonest, max(left_kg[soonest], 0.0), rest)
        return after.service if after else None

    def fuel_for(self, compound: str, left: int, fuel_kg: float, pit: PitParameters, tank_kg: float) -> float:
        """Fuel for the fastest stint on a compound with so many laps to go; a full tank if none lasts.

        Args:
            compound: of the tyres.
            left: laps to go.
            fuel_kg: with which the car comes to the stop.
            pit, tank_kg: what a stop takes, and the tank holds.

        Returns:
            kg in the tank.
        """
        search, rest = self._searched(left, pit, tank_kg)
        best = search.after_stop(left, fuel_kg, rest, compound)
        return tank_kg if best is None else best.fuel_kg

    def _search(self, laps: int, pit: PitParameters, tank_kg: float) -> tuple[StintSearch, Rest]:
        search = StintSearch(self._model, pit, tank_kg)
        return search, search.rest(laps)

    def _drive_on(self, wall: PitWall, laps: int) -> tuple[list[float], list[float]]:
        """What 0, 1... `laps` more laps without a stop take, s, and leave in the tank, kg."""
        compound = self._compounds.get(wall.compounds[wall.car], self._model.compound[0])
        lap_s, used_kg = compound.laps(compound.age(float(wall.wear.mean())), laps)
        used = np.concatenate([[0.0], np.cumsum(used_kg)])
        fuel_kg = wall.fuel_kg - used
        taken = np.cumsum(lap_s + self._model.fuel_s_kg * np.maximum(fuel_kg[:-1], 0.0))
        return [0.0, *taken.tolist()], fuel_kg.tolist()
