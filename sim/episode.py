"""One run of a scenario from start to end: what the environments of all libraries share."""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium.spaces import Box
from numpy.typing import NDArray

from sim.car import load_car
from sim.observation import ObservationSpec
from sim.scenario import load_scenario
from sim.track import load_track
from sim.world import World

STUCK_S = 15.0
"""A car at rest for so long is out of the race."""


def end_runs(world: World, endings: NDArray[np.str_], time_s: float) -> None:
    """Note how runs ended in the last step, and take cars that are stuck or out of time off the circuit.

    Args:
        world: the world after a step.
        endings: (races, cars) str, changed in place from '' to 'finished', 'stuck' or 'time_up'.
        time_s: time at which a run ends for all, s.
    """
    state = world.state
    running = endings == ""
    finished = running & ~state["driving"]
    stuck = running & ~finished & (state["stationary_s"] > STUCK_S)
    # The time is a sum of steps, so it may fall short of the limit by rounding.
    late = running & ~finished & ~stuck & (world.time >= time_s - 1e-9)[:, None]
    endings[finished], endings[stuck], endings[late] = "finished", "stuck", "time_up"
    state["driving"] &= ~(stuck | late)


class Episode:
    """A world of one race, started again and again.

    Attributes:
        observation_spec: what is seen of it.
        cars: number of cars.
        world: the world, read it freely; its only race is the episode.
    """

    def __init__(self, circuit: str, car: str, scenario: str, observation: ObservationSpec | None) -> None:
        """An episode yet to be started.

        Raises:
            InputError: if a name is unknown or a file is wrong.
        """
        self.observation_spec = observation or ObservationSpec()
        self._scenario = load_scenario(scenario)
        self._track = load_track(circuit)
        self.cars = self._scenario.cars
        self.world = World(self._track, load_car(car), 1, self.cars)
        self._endings = np.full((1, self.cars), "", dtype="U8")

    @property
    def endings(self) -> NDArray[np.str_]:
        """How each car's run ended: 'finished', 'stuck' or 'time_up'; '' while it drives. (cars,)"""
        return self._endings[0]

    def observation_space(self) -> Box[np.float32]:
        """Space of one car's observation. Standardised, but not bounded: a spinning car leaves any range."""
        return Box(-np.inf, np.inf, (self.observation_spec.size,), np.float32)

    def action_space(self) -> Box[np.float32]:
        """Space of one car's action: throttle (+) or brake (-), steering (+ is left)."""
        return Box(-1.0, 1.0, (2,), np.float32)

    def start(self, rng: np.random.Generator) -> None:
        """Put all cars at a start drawn from the scenario."""
        self.world.reset(0, self._scenario.place(self._track, rng))
        self._endings[:] = ""

    def step(self, actions: NDArray[np.float32]) -> NDArray[np.float64]:
        """Advance by one agent step, 0.1 s.

        Args:
            actions: (cars, 2); those of cars that no longer drive are ignored.

        Returns:
            (cars,) reward: metres of centre line gained in the step, none while off course.

        Raises:
            ValueError: if an action is not finite.
        """
        faulty = np.flatnonzero(~np.isfinite(actions).all(axis=1))
        if len(faulty):
            raise ValueError(
                f"the action of car {faulty[0]} is {actions[faulty[0]]}, expected finite numbers"
            )
        cars = self.world.state[0]
        before = cars["progress"].copy()
        self.world.step(np.asarray(actions, np.float64)[None])
        end_runs(self.world, self._endings, self._scenario.time_s)
        return np.where(cars["off_course"], 0.0, cars["progress"] - before)

    def observe(self) -> NDArray[np.float32]:
        """Standardised observations of all cars, (cars, size)."""
        race = np.zeros(self.cars, np.int64)
        return self.world.observe(self.observation_spec, race, np.arange(self.cars))

    def infos(self) -> list[dict[str, Any]]:
        """What a log would note of each car; a time that has not been driven is None.

        The place is that on the road: finishers by their time, then the others by progress.
        """
        cars = self.world.state[0]
        place = np.empty(self.cars, np.int64)
        finish_s = np.where(self.endings == "finished", cars["finish_s"], np.inf)
        place[np.lexsort((-cars["progress"], finish_s))] = np.arange(1, self.cars + 1)
        return [
            {
                "place": int(place[i]),
                "progress_m": float(car["progress"]),
                "laps": int(car["laps"]),
                "last_lap_s": _driven(car["last_lap_s"]),
                "best_lap_s": _driven(car["best_lap_s"]),
                "finish_s": _driven(car["finish_s"]),
                "off_course": bool(car["off_course"]),
                "wall_contact": bool(car["wall_contact"]),
                "car_contact": bool(car["car_contact"]),
                "ending": str(self.endings[i]),
            }
            for i, car in enumerate(cars)
        ]


def _driven(seconds: np.float64) -> float | None:
    return float(seconds) if np.isfinite(seconds) else None
