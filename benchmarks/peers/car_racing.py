"""CarRacing of Gymnasium: one car on Box2D with wheels that slide, 50 Hz, random actions.

`car_racing_image` observes as it is meant to, by drawing 96 x 96 pixels in software; `car_racing_no_image`
has the drawing replaced by an empty picture, so that only the physics is measured.
"""

from __future__ import annotations

import json

import gymnasium as gym
import numpy as np

from benchmarks.peers.rates import pin, stepping

DT_S = 1.0 / 50.0
STEPS = 300


def measure(image: bool) -> dict[str, float]:
    """Figures with or without the picture."""
    environment = gym.make("CarRacing-v3")
    if not image:
        nothing = np.zeros((96, 96, 3), np.uint8)
        setattr(environment.unwrapped, "_render", lambda mode: nothing)  # noqa: B010
    environment.action_space.seed(0)
    environment.reset(seed=0)

    def step(action: np.ndarray) -> bool:
        _, _, terminated, truncated, _ = environment.step(action)
        return terminated or truncated

    return stepping(environment.reset, environment.action_space.sample, step, steps=STEPS, cars=1, dt_s=DT_S)


def main() -> None:
    """Print the figures as JSON."""
    pin()
    print(json.dumps({"car_racing_image": measure(True), "car_racing_no_image": measure(False)}))


if __name__ == "__main__":
    main()
