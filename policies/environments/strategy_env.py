"""`nathlon/Strategy-v0`: when to stop, as an environment for learning."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from gymnasium.spaces import Box, Discrete
from numpy.typing import NDArray

from nathlon.policies.environments.lap_race import LapRace
from nathlon.policies.sources.composite import CompositeFile
from nathlon.policies.stint_model import StintModel
from nathlon.policies.stint_planner import StintPlanner
from nathlon.sim.car import load_car
from nathlon.sim.data_file import read_toml
from nathlon.sim.errors import InputError
from nathlon.sim.rules import load_rules, rule_parameters
from nathlon.sim.service import Service

Observation = NDArray[np.float32]

SHIPPED = Path(__file__).parent / "strategy.toml"
"""A planner: the champion's, in a gt3 on Lindenring in `grand_prix_stops`."""
FARTHEST_S = 60.0
"""Gaps are seen up to here."""
PACE_S = 0.4
"""Standard deviation of what cars take longer or shorter, s a lap."""


class StrategyEnv(gymnasium.Env[Observation, np.int64]):
    """The strategist of one car in a race lap by lap, against planners; a step is a lap.

    Actions: 0 drives on, 1, 2... stop at the end of the lap for the first, second... compound of the model,
    with fuel for the fastest stint on it. The first action is taken on the grid and fits the car: 0 leaves
    it to the planner.

    Observations, each from 0 to 1: laps to go; wear, 1 is the most that was practised; fuel; the gaps to the
    leader, to the car ahead and to the car behind over FARTHEST_S; the place; one number a compound, 1 for
    that on the car.

    The reward is what a lap takes longer than the model's fastest, s, negative. An episode is terminated at
    the finish, or without fuel. The info of a lap has `time_s` since the start, the `place`, the `stops` so
    far, and whether the car is `out` of fuel.
    """

    metadata: dict[str, Any] = {"render_modes": []}  # noqa: RUF012  # declared so by the base class

    def __init__(
        self,
        planner: str | None = None,
        laps: int = 12,
        cars: int = 8,
        car: str = "gt3",
        rules: str = "sporting",
        render_mode: None = None,
    ) -> None:
        """An environment.

        Args:
            planner: path of a composite with a planner, as `nathlon stints` writes it, whose model is raced;
                None for a shipped one.
            laps: of the race.
            cars: in it, the agent's included.
            car, rules: shipped names or paths: of the tank, and of what a stop takes.
            render_mode: there is none.

        Raises:
            InputError: if a name is unknown or a file wrong, or it has no planner.
        """
        self._model = model_of(str(SHIPPED if planner is None else planner))
        self._planner = StintPlanner(self._model)
        self._laps, self._cars = laps, cars
        self._pit = rule_parameters(load_rules(rules)).pit
        self._tank_kg = load_car(car).fuel.capacity_kg
        self._names = [compound.name for compound in self._model.compound]
        self._fastest_s = min(min(compound.lap_s) for compound in self._model.compound)
        self._worn = max(compound.wear[-1] for compound in self._model.compound)
        self.observation_space = Box(0.0, 1.0, (7 + len(self._names),), np.float32)
        self.action_space = Discrete(1 + len(self._names))
        self.render_mode = render_mode
        self._race: LapRace | None = None
        self._car, self._on_grid = 0, True

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """A new race from a drawn starting place; no options are known."""
        super().reset(seed=seed)
        pace_s = PACE_S * self.np_random.standard_normal(self._cars)
        self._race = LapRace(
            self._model, self._laps, self._pit, self._tank_kg, pace_s.tolist(), self.np_random
        )
        self._car, self._on_grid = int(self.np_random.integers(self._cars)), True
        for car in range(self._cars):
            self._race.fit(car, self._planner.start(self._race.wall(car)))
        return self._observe(), {}

    def step(self, action: np.int64) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Fit the car on the grid, or drive a lap."""
        race = self._begun()
        service = self.service(int(action))
        if self._on_grid:
            self._on_grid = False
            if service is not None:
                race.fit(self._car, service)
            return self._observe(), 0.0, False, False, {}
        services = [self._planner.decide(race.wall(car)) for car in range(self._cars)]
        services[self._car] = service
        taken_s = float(race.drive(services)[self._car])
        over = race.lap == self._laps or bool(race.out[self._car])
        facts = {
            "time_s": float(race.time_s[self._car]),
            "place": 1 + int(np.count_nonzero(race.time_s < race.time_s[self._car])),
            "stops": int(race.stops[self._car]),
            "out": bool(race.out[self._car]),
        }
        return self._observe(), self._fastest_s - taken_s, over, False, facts

    def service(self, action: int) -> Service | None:
        """What an action asks for."""
        if action == 0:
            return None
        race = self._begun()
        left = max(self._laps - race.lap - (0 if self._on_grid else 1), 1)
        name = self._names[action - 1]
        fuel_kg = 0.0 if self._on_grid else float(race.fuel_kg[self._car])
        return Service(name, self._planner.fuel_for(name, left, fuel_kg, self._pit, self._tank_kg))

    def planned(self) -> int:
        """The action that comes nearest to what the planner does."""
        race = self._begun()
        if self._on_grid:
            return 0
        service = self._planner.decide(race.wall(self._car))
        return 0 if service is None or service.compound is None else 1 + self._names.index(service.compound)

    def _begun(self) -> LapRace:
        if self._race is None:
            raise gymnasium.error.ResetNeeded("step came before reset, expected reset first")
        return self._race

    def _observe(self) -> Observation:
        race = self._begun()
        gaps = np.sort(race.time_s) - race.time_s[self._car]
        ahead, behind = -gaps[gaps < 0.0], gaps[gaps > 0.0]
        place = len(ahead)
        near = [ahead.max(initial=0.0), ahead.min(initial=FARTHEST_S), behind.min(initial=FARTHEST_S)]
        numbers = [
            (self._laps - race.lap) / self._laps,
            race.wear[self._car] / self._worn,
            race.fuel_kg[self._car] / self._tank_kg,
            *(gap / FARTHEST_S for gap in near),
            place / max(self._cars - 1, 1),
            *(float(name == race.compounds[self._car]) for name in self._names),
        ]
        return np.clip(np.array(numbers, np.float32), 0.0, 1.0)


@lru_cache
def model_of(path: str) -> StintModel:
    """The stint model in the file of a composite.

    Raises:
        InputError: if there is no such file, it is wrong, or it has no planner.
    """
    file = read_toml(Path(path), CompositeFile, "composite")
    if file.planner is None:
        raise InputError(
            f"{path}: field planner is missing, expected a composite as nathlon stints writes it"
        )
    return file.planner
