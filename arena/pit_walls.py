"""The pit walls of a world: strategists that are asked whenever their car begins a lap."""

from __future__ import annotations

import json
import logging
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from nathlon.arena.stints import DrivenStint, written
from nathlon.arena.team import Absent
from nathlon.arena.watch import Watch
from nathlon.policies.policy import Policy
from nathlon.policies.sources.composite import Composite
from nathlon.policies.sources.strategist import StrategistError
from nathlon.policies.strategy import PitWall, Strategist
from nathlon.sim.physics.pit_lane import ENTERING, ON_ROAD, REJOINING
from nathlon.sim.service import Service
from nathlon.sim.timing import gaps
from nathlon.sim.weather import Weather
from nathlon.sim.world import World

log = logging.getLogger(__name__)

ARRAYS = "_begun", "_stops", "_inside"
"""Attributes with a number or flag of each car."""
PLACES = 3
"""Decimals of seconds that are kept of a stop."""


class Advised(NamedTuple):
    """A car that has a strategist; all others are indices, those of match and entrant for the watch."""

    race: int
    car: int
    match: int
    entrant: int
    strategist: Strategist


class _Begun(NamedTuple):
    """A stint under way, and what stood on the clocks of the car when it began."""

    compound: str
    laps: int
    stood_s: float
    lane_s: float


def strategist_of(policy: Policy | Absent, usual: Strategist | None) -> Strategist | None:
    """Who decides when a policy's cars stop: its own strategist, or else the usual one of the scenario."""
    own = policy.strategist if isinstance(policy, Composite) else None
    return own or usual


class PitWalls:
    """All strategists of a world, and what their cars drive between stops."""

    def __init__(
        self, world: World, laps: int | None, advised: Iterable[Advised], watch: Watch, notes: str = ""
    ) -> None:
        """Fit the cars as their strategists have them start, unless their races go on.

        Args:
            world: whose cars are at their start.
            laps: of its races.
            advised: who has a strategist; of two for a car the last.
            watch: told before a strategist is asked.
            notes: as of `notes`, of races that go on; empty at their start.
        """
        self._world, self._laps, self._watch = world, laps, watch
        self._advised = {(one.race, one.car): one for one in advised}
        self._at_fault: list[tuple[int, int]] = []
        shape = world.state.shape
        self._begun = np.full(shape, -1.0)
        self._stops, self._inside = np.zeros(shape, np.int64), np.zeros(shape, bool)
        self._compounds = [
            [world.first_compound(world.model(race, car)) for car in range(shape[1])]
            for race in range(shape[0])
        ]
        self._asked: dict[tuple[int, int], str | None] = {}
        self._driven: dict[tuple[int, int], list[DrivenStint]] = {}
        self._stint: dict[tuple[int, int], _Begun] = {}
        if notes:
            self._recall(notes)
            return
        for (race, car), one in self._advised.items():
            service = self._ask(one, start=True) or Service()
            world.fit(race, car, service)
            self._asked[race, car] = service.compound
            self._fitted(race, car)
            self._driven[race, car] = []
            self._stint[race, car] = _Begun(self._compounds[race][car], 0, 0.0, 0.0)

    @property
    def notes(self) -> str:
        """All that is kept, as JSON."""
        arrays = {name: getattr(self, name).tolist() for name in ARRAYS}
        cars = [[*at, self._asked[at], self._driven[at], self._stint[at]] for at in self._driven]
        return json.dumps({**arrays, "compounds": self._compounds, "cars": cars})

    def _recall(self, notes: str) -> None:
        kept = json.loads(notes)
        for name in ARRAYS:
            getattr(self, name)[:] = kept[name]
        self._compounds = kept["compounds"]
        for race, car, asked, driven, stint in kept["cars"]:
            self._asked[race, car] = asked
            self._driven[race, car] = [DrivenStint(*one) for one in driven]
            self._stint[race, car] = _Begun(*stint)

    def listen(self) -> list[tuple[int, int]]:
        """Ask the strategists of cars that began a lap in the last step, the first too, and tell the cars.

        Whoever begins it on the way to the box is asked after the service.

        Returns:
            race and car of those whose strategist has failed since the last call.
        """
        if self._advised:
            self._ask_all()
        at_fault, self._at_fault = self._at_fault, []
        return at_fault

    def hand_over(self, to: Advised) -> None:
        """Have another strategist decide about a car from now on; what was asked for before is forgotten.

        It is asked at once, or after the service if the car is on its way to the box.
        """
        at = to.race, to.car
        if self._advised.get(at) == to:
            return
        self._advised[at] = to
        self._begun[at] = -1.0
        self._driven.setdefault(at, [])
        self._stint.setdefault(at, _Begun(self._compounds[to.race][to.car], 0, 0.0, 0.0))

    def _ask_all(self) -> None:
        self._note_stops()
        state = self._world.state
        laps = np.floor(state["progress"] / self._world.track.length)
        began = laps > self._begun
        if not began.any():
            return
        began &= state["driving"] & (state["stage"] != ENTERING)
        self._begun[began] = laps[began]
        for (race, car), one in self._advised.items():
            if began[race, car]:
                service = self._ask(one)
                self._world.ask_stop(race, car, service)
                self._asked[race, car] = service.compound if service else None

    def _ask(self, one: Advised, start: bool = False) -> Service | None:
        """What a strategist, who may be a user's own code, has done to a car; nothing where it fails.

        The pace is told to the car.
        """
        wall = self._wall(one.race, one.car)
        self._watch.ask(one.match, one.entrant, start)
        try:
            service = one.strategist.start(wall) if start else one.strategist.decide(wall)
            self._world.ask_pace(one.race, one.car, one.strategist.pace(wall))
            return service
        except StrategistError as error:
            log.warning("%s: its car is out", error)
            self._at_fault.append((one.race, one.car))
            return None
        finally:
            self._watch.work()

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
        if not (inside.any() or self._inside.any()):
            return
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
            tank_kg=float(self._world.parameters_of(race, car).fuel_capacity),
            penalty_s=cars["penalty_s"].copy(),
            time_s=float(self._world.time[race]),
            cars_per_km=np.count_nonzero(cars["driving"]) / (track.length / 1000.0),
            film_mm=float(cars["film"][car]),
            rain_mm_h=self._world.rain_mm_h(race),
            forecast=self._forecast(race),
        )

    def _forecast(self, race: int) -> tuple[Weather, ...]:
        """The weathers that may come and agree with the rain until now, their chances adding up to 1."""
        world = self._world
        weather = world.conditions.weather
        if not weather:
            return ()
        came = weather[world.state["sky"][race, 0]]
        time_s, lap = float(world.time[race]), world.leader_lap(race)
        left = [one for one in weather if one.agrees(came, time_s, lap)]
        whole = sum(one.chance for one in left)
        return tuple(one.model_copy(update={"chance": one.chance / whole}) for one in left)
