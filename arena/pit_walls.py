"""The pit walls of a world: strategists that are asked whenever their car begins a lap."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from nathlon.policies.strategy import PitWall, Strategist
from nathlon.sim.timing import gaps
from nathlon.sim.world import World


class Advised(NamedTuple):
    """A car that has a strategist; `race` and `car` are indices."""

    race: int
    car: int
    strategist: Strategist


class PitWalls:
    """All strategists of a world."""

    def __init__(
        self, world: World, laps: int | None, advised: Sequence[Advised], starts: bool = True
    ) -> None:
        """Fit the cars as their strategists have them start.

        Args:
            world: whose cars are at their start.
            laps: of its races.
            advised: who has a strategist.
            starts: whether the races start; if not, they go on, and the cars stay as they are.
        """
        self._world, self._laps, self._advised = world, laps, advised
        self._begun = np.full(world.state.shape, -1.0)
        if not starts:
            self._begun = np.maximum(np.floor(world.state["progress"] / world.track.length), self._begun)
            return
        for race, car, strategist in advised:
            world.fit(race, car, strategist.start(laps))

    def listen(self) -> None:
        """Ask the strategists of cars that began a lap in the last step, the first too, and tell the cars."""
        if not self._advised:
            return
        state = self._world.state
        laps = np.floor(state["progress"] / self._world.track.length)
        began = (laps > self._begun) & state["driving"]
        self._begun = np.maximum(laps, self._begun)
        for race, car, strategist in self._advised:
            if began[race, car]:
                self._world.ask_stop(race, car, strategist.decide(self._wall(race, car)))

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
            laps_done=cars["laps"].copy(),
            stops=cars["stops"].copy(),
        )
