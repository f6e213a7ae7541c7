"""The pit walls of a world: strategists that are asked whenever their car begins a lap."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from nathlon.arena.stints import DrivenStint, written
from nathlon.policies.strategy import PitWall, Strategist
from nathlon.sim.physics.pit_lane import ENTERING, ON_ROAD, REJOINING
from nathlon.sim.timing import gaps
from nathlon.sim.world import World

PLACES = 3
"""Decimals of seconds that are kept of a stop."""


class Advised(NamedTuple):
    """A car that has a strategist; `race` and `car` are indices."""

    race: int
    car: int
    strategist: Strategist


class _Begun(NamedTuple):
    """A stint under way, and what stood on the clocks of the car when it began."""

    compound: str
    laps: int
    stood_s: float
    lane_s: float


class PitWalls:
    """All strategists of a world, and what their cars drive between stops."""

    def __init__(self, world: World, laps: int | None, advised: Sequence[Advised]) -> None:
        """Fit the cars as their strategists have them start.

        Args:
            world: whose cars are at their start.
            laps: of its races.
            advised: who has a strategist.
        """
        self._world, self._laps, self._advised = world, laps, advised
        shape = world.state.shape
        self._begun = np.full(shape, -1.0)
        self._stops, self._inside = np.zeros(shape, np.int64), np.zeros(shape, bool)
        default = world.conditions.compound or world.car.tyre.compound
        self._compounds = [[default] * shape[1] for _ in range(shape[0])]
        self._asked: dict[tuple[int, int], str | None] = {}
        self._driven: dict[tuple[int, int], list[DrivenStint]] = {}
        self._stint: dict[tuple[int, int], _Begun] = {}
        for race, car, strategist in advised:
            service = strategist.start(self._wall(race, car))
            world.fit(race, car, service)
            self._asked[race, car] = service.compound
            self._fitted(race, car)
            self._driven[race, car] = []
            self._stint[race, car] = _Begun(self._compounds[race][car], 0, 0.0, 0.0)

    def listen(self) -> None:
        """Ask the strategists of cars that began a lap in the last step, the first too, and tell the cars.

        Whoever begins it on the way to the box is asked after the service.
        """
        if not self._advised:
            return
        self._note_stops()
        state = self._world.state
        laps = np.floor(state["progress"] / self._world.track.length)
        began = (laps > self._begun) & state["driving"] & (state["stage"] != ENTERING)
        if not began.any():
            return
        self._begun[began] = laps[began]
        for race, car, strategist in self._advised:
            if began[race, car]:
                service = strategist.decide(self._wall(race, car))
                self._world.ask_stop(race, car, service)
                self._asked[race, car] = service.compound if service else None

    def stints(self, races: slice) -> dict[tuple[int, int], str]:
        """What the cars with a strategist drove in some races, as RESULTS has it.

        Args:
            races: which; the first of them is race 0.

        Returns:
            column `stints` by race and car.
        """
        told = {}
        for race, car in self._driven:
            if races.start <= race < races.stop:
                begun = self._stint[race, car]
                laps = int(self._world.state["laps"][race, car]) - begun.laps
                told[race - races.start, car] = written(
                    [*self._driven[race, car], DrivenStint(begun.compound, laps)]
                )
        return told

    def _note_stops(self) -> None:
        """Keep what happened in the pit lane in the last step."""
        state = self._world.state
        inside = (state["stage"] != ON_ROAD) & (state["stage"] != REJOINING)
        served, left = state["stops"] > self._stops, self._inside & ~inside & state["driving"]
        self._stops, self._inside = state["stops"].copy(), inside
        for race, car in np.argwhere(served).tolist():
            self._fitted(race, car)
        for race, car in np.argwhere(left).tolist():
            begun, now = self._stint[race, car], state[race, car]
            ended = _Begun(
                self._compounds[race][car], int(now["laps"]), float(now["stood_s"]), float(now["lane_s"])
            )
            self._stint[race, car] = ended
            stood_s, lane_s = ended.stood_s - begun.stood_s, ended.lane_s - begun.lane_s
            self._driven[race, car].append(
                DrivenStint(
                    begun.compound, ended.laps - begun.laps, round(stood_s, PLACES), round(lane_s, PLACES)
                )
            )

    def _fitted(self, race: int, car: int) -> None:
        """Note that a car has the tyres that were asked for."""
        self._compounds[race][car] = self._asked[race, car] or self._compounds[race][car]

    def _wall(self, race: int, car: int) -> PitWall:
        cars, track = self._world.state[race], self._world.track
        done = int(cars["laps"][car])
        return PitWall(
            car=car,
            laps=self._laps,
            lap=done,
            ends_lap=done + int(track.pit_lane.entry_m > track.length / 2.0),
            wear=cars["wear"][car].copy(),
            fuel_kg=float(cars["fuel"][car]),
            last_lap_s=cars["last_lap_s"].copy(),
            gap_s=np.asarray(gaps(cars)),
            compounds=tuple(self._compounds[race]),
            laps_done=cars["laps"].copy(),
            stops=cars["stops"].copy(),
            pit=self._world.parameters.rules.pit,
            tank_kg=float(self._world.parameters.car.fuel_capacity),
        )
