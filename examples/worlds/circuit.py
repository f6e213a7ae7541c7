"""highway-env's racetrack, mapped from its tuples: one car `alone` among its own, and a `duel` of two.

nathlon evaluate runs/circuit-1 --world examples/worlds/circuit.py:world --out runs/circuit-1-selected
"""

from typing import Any

from highway_env.envs import RacetrackEnv

from nathlon import Declared, PettingZooWorld

STEP_S = 0.2
RANGES = {"x": [-100, 100], "y": [-100, 100], "vx": [-20, 20], "vy": [-20, 20], "lat_off": [-5, 5]}
FEATURES = ["presence", *RANGES, "cos_h", "sin_h", "ang_off"]
SEEN = {"type": "Kinematics", "features": FEATURES, "features_range": RANGES, "vehicles_count": 3}
CONFIG = {
    "observation": {"type": "MultiAgentObservation", "observation_config": SEEN},
    "action": {"type": "MultiAgentAction", "action_config": {"type": "ContinuousAction"}},
    "simulation_frequency": 10,
    "policy_frequency": round(1 / STEP_S),
}


class Circuit:
    """Cars as a ParallelEnv; whoever leaves the road or hits something is out, and is braked."""

    render_mode = "rgb_array"

    def __init__(self, cars: int = 1) -> None:
        config = CONFIG | {"controlled_vehicles": cars}
        self._road, self.agents = RacetrackEnv(config, self.render_mode), list[str]()
        self.possible_agents = tuple(f"car_{car}" for car in range(cars))
        self.observation_space = lambda _: self._road.observation_space[0]
        self.action_space = lambda _: self._road.action_space[0]
        self.render = self._road.render

    def reset(self, seed: int | None = None, options: Any = None) -> Any:
        seen, _ = self._road.reset(seed=seed)
        self.agents = list(self.possible_agents)
        return dict(zip(self.agents, seen, strict=True)), {name: {} for name in self.agents}

    def step(self, actions: dict[str, Any]) -> Any:
        seen, *_ = self._road.step(tuple(actions.get(name, (-1.0, 0.0)) for name in self.possible_agents))
        cars = dict(zip(self.possible_agents, self._road.controlled_vehicles, strict=True))
        ways = {name: float(cars[name].speed) * STEP_S for name in self.agents}
        infos = {name: {"way": way, "hit": bool(cars[name].crashed)} for name, way in ways.items()}
        ends = {name: bool(cars[name].crashed or not cars[name].on_road) for name in ways}
        rewards = {name: way / 10 - 2.0 * ends[name] for name, way in ways.items()}
        self.agents = [name for name in ways if not ends[name]]
        observations = dict(zip(self.possible_agents, seen, strict=True))
        return observations, rewards, ends, dict.fromkeys(ends, False), infos


MEASURES = {
    "distance_m": Declared(lambda seat: seat.infos["way"]),
    "contacts": Declared(lambda seat: seat.infos["hit"]),
}
SCENARIOS = {"alone": lambda: Circuit(1), "duel": lambda: Circuit(2)}
world = PettingZooWorld(SCENARIOS, measures=MEASURES, packages=("highway-env",), most_steps=60, step_s=STEP_S)
