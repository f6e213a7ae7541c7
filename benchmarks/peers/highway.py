"""The racetrack of highway-env with 20 controlled cars: kinematic bicycles, random steering.

Decisions at 5 Hz and physics at 15 Hz, as the environment has them by default. The cars of
`highway_env_grid_20` observe the default occupancy grid of 12 x 12 cells, which takes most of the time;
those of `highway_env_kinematics_20` observe themselves and their four nearest neighbours.
"""

from __future__ import annotations

import json
from typing import Any

import gymnasium as gym

from benchmarks.peers.rates import pin, stepping

NAME = "highway_env:racetrack-v1"
CARS = 20
DT_S = 1.0 / 5.0
STEPS = 10


def measure(observation: dict[str, Any], action: dict[str, Any]) -> dict[str, float]:
    """Figures with an observation and an action of every car, as highway-env configures them."""
    config = {
        "controlled_vehicles": CARS,
        "other_vehicles": 0,
        "observation": {"type": "MultiAgentObservation", "observation_config": observation},
        "action": {"type": "MultiAgentAction", "action_config": action},
    }
    environment = gym.make(NAME, config=config, disable_env_checker=True)
    environment.action_space.seed(0)
    environment.reset(seed=0)

    def step(actions: Any) -> bool:
        _, _, terminated, truncated, _ = environment.step(actions)
        return terminated or truncated

    return stepping(
        environment.reset, environment.action_space.sample, step, steps=STEPS, cars=CARS, dt_s=DT_S
    )


def main() -> None:
    """Print the figures as JSON."""
    pin()
    default: Any = gym.make(NAME).unwrapped
    observations = {"grid": default.config["observation"], "kinematics": {"type": "Kinematics"}}
    measured = {
        f"highway_env_{name}_{CARS}": measure(observation, default.config["action"])
        for name, observation in observations.items()
    }
    print(json.dumps(measured))


if __name__ == "__main__":
    main()
