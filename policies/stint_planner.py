"""A strategist that plans the rest of the race anew whenever its car begins a lap."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from nathlon.policies.stint_model import StintModel, in_water, with_treads
from nathlon.policies.stint_search import NextStint, Rest, StintSearch
from nathlon.policies.strategy import AtFullPace, PitWall
from nathlon.sim.rules import PitParameters
from nathlon.sim.service import Service
from nathlon.sim.weather import Weather, films_ahead

LEAST_SPARE_KG = 0.5
"""With less than this at the end of a stint a car is taken not to reach it."""
AHEAD = 60
"""Laps for which it plans where a race has no number of laps."""


class _Outlook(NamedTuple):
    """What may come: with which chance, and the fastest stints there."""

    chance: float
    search: StintSearch
    rest: Rest


class _DrivingOn(NamedTuple):
    """What a car has before it that does not stop now, from here on.

    Attributes:
        entry_s: until it could.
        entry_kg: in the tank then.
        end_s: to the end of the race without a stop.
        later_s: the same with a stop in a later lap, the fastest.
    """

    entry_s: float
    entry_kg: float
    end_s: float
    later_s: float


class StintPlanner(AtFullPace):
    """Weighs every lap in which the next stop may be, by its model and the actual tyres and fuel.

    What comes after that stop is the fastest there is by dynamic programming. Where it may rain, each weather
    of the forecast counts by its chance: a stop now is for the same tyres in all of them, and what comes
    later is reckoned as if the weather were known by then. Other cars are not reckoned with. It keeps nothing
    that its answers depend on.
    """

    def __init__(self, model: StintModel) -> None:
        """A strategist with a model of its car's laps."""
        self._model, self._treaded = model, with_treads(model)
        self._searched = lru_cache(maxsize=8)(self._search)

    def start(self, wall: PitWall) -> Service:
        """See `nathlon.policies.strategy.Strategist.start`."""
        laps = wall.laps or AHEAD
        outlooks = self._outlooks(wall, laps)
        first = {
            name: [outlook.search.first(laps, outlook.rest, name) for outlook in outlooks]
            for name in self._choices(outlooks)
        }
        taken_s = {
            name: _mean(outlooks, [stint.seconds if stint else np.inf for stint in stints])
            for name, stints in first.items()
        }
        return _service(first[min(taken_s, key=taken_s.__getitem__)]) or Service(self._model.compound[0].name)

    def decide(self, wall: PitWall) -> Service | None:
        """See `nathlon.policies.strategy.Strategist.decide`."""
        if wall.last_lap:
            return None
        laps = wall.laps - wall.lap if wall.laps else AHEAD
        left = laps - (wall.ends_lap - wall.lap)
        outlooks = self._outlooks(wall, laps)
        on = [self._drive_on(wall, outlook, laps) for outlook in outlooks]
        stop_s = {
            name: _mean(
                outlooks,
                [
                    way.entry_s + outlook.search.seconds(left, way.entry_kg, outlook.rest, name)
                    for outlook, way in zip(outlooks, on, strict=True)
                ],
            )
            for name in self._choices(outlooks)
        }
        best = min(stop_s, key=stop_s.__getitem__)
        later_s = _mean(outlooks, [min(way.end_s, way.later_s) for way in on])
        if stop_s[best] > later_s or stop_s[best] >= _mean(outlooks, [way.end_s for way in on]):
            return None
        fuel_kg = max(on[0].entry_kg, 0.0)
        return _service(
            [outlook.search.after_stop(left, fuel_kg, outlook.rest, best) for outlook in outlooks]
        )

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

    def _search(
        self, laps: int, pit: PitParameters, tank_kg: float, treaded: bool = False
    ) -> tuple[StintSearch, Rest]:
        search = StintSearch(self._treaded if treaded else self._model, pit, tank_kg)
        return search, search.rest(laps)

    def _outlooks(self, wall: PitWall, laps: int) -> list[_Outlook]:
        """What the road may be in so many laps to go: one that is dry where no water is forecast."""
        if not wall.forecast:
            return [_Outlook(1.0, *self._searched(wall.laps or AHEAD, wall.pit, wall.tank_kg))]
        outlooks = [self._outlook(wall, weather, laps) for weather in wall.forecast]
        same = all(outlook.search is outlooks[0].search for outlook in outlooks)
        return [outlooks[0]._replace(chance=1.0)] if same else outlooks

    def _outlook(self, wall: PitWall, weather: Weather, laps: int) -> _Outlook:
        names = [compound.name for compound in self._treaded.compound]
        new_s = np.array([compound.lap_s[0] for compound in self._treaded.compound])
        films = films_ahead(
            weather,
            wall.film_mm,
            wall.cars_per_km,
            wall.time_s,
            int(wall.laps_done.max()) + 1,
            laps,
            lambda film_mm: float((new_s * in_water(names, film_mm)).min()),
        )
        dry = self._searched(wall.laps or AHEAD, wall.pit, wall.tank_kg, True)
        wet = np.flatnonzero(films.any(axis=1))
        if not len(wet):
            return _Outlook(weather.chance, *dry)
        longer = np.vstack([in_water(names, films).mean(axis=1), np.ones(len(names))])[::-1]
        by_compound = dict(zip(names, longer.T, strict=True))
        search = StintSearch(self._treaded, wall.pit, wall.tank_kg, by_compound)
        return _Outlook(weather.chance, search, search.rest(laps, dry[1][: laps - int(wet[-1])]))

    def _choices(self, outlooks: Sequence[_Outlook]) -> list[str | None]:
        """What may be fitted now, not knowing which road comes; None for what is fastest on the only one."""
        return [None] if len(outlooks) == 1 else [compound.name for compound in self._treaded.compound]

    def _drive_on(self, wall: PitWall, outlook: _Outlook, laps: int) -> _DrivingOn:
        """What so many laps to go take on the tyres that the car has, up to the next stop or the end."""
        model = self._treaded if wall.forecast else self._model
        known = {compound.name: compound for compound in model.compound}
        compound = known.get(wall.compounds[wall.car], model.compound[0])
        dry_s, used_kg = compound.laps(compound.age(float(wall.wear.mean())), laps)
        used = np.concatenate([[0.0], np.cumsum(used_kg)])
        left_kg = wall.fuel_kg - used
        lap_s = outlook.search.lap_s(compound.name, dry_s, laps)
        taken = np.cumsum(lap_s + self._model.fuel_s_kg * np.maximum(left_kg[:-1], 0.0))
        taken_s, soonest, later_s = [0.0, *taken.tolist()], wall.ends_lap - wall.lap, np.inf
        for driven in range(soonest + 1, laps):
            # A stop at once is always possible, also for a car that will not reach its entry.
            if left_kg[driven] < LEAST_SPARE_KG:
                break
            rest_s = outlook.search.seconds(laps - driven, float(left_kg[driven]), outlook.rest)
            later_s = min(later_s, taken_s[driven] + rest_s)
        end_s = taken_s[laps] if left_kg[laps] >= LEAST_SPARE_KG else np.inf
        return _DrivingOn(taken_s[soonest], float(left_kg[soonest]), end_s, later_s)


def _mean(outlooks: Sequence[_Outlook], seconds: Sequence[float]) -> float:
    """What is expected of something that takes so long on each road."""
    return float(sum(outlook.chance * one for outlook, one in zip(outlooks, seconds, strict=True)))


def _service(stints: Sequence[NextStint | None]) -> Service | None:
    """What is done to the car before stints on the same tyres, with fuel for any; None if there are none."""
    known = [stint for stint in stints if stint]
    return Service(known[0].compound, max(stint.fuel_kg for stint in known)) if known else None
