"""PufferLib's driving environment: 512 kinematic cars in copies of one map, 10 Hz, random actions.

Every car observes 1,847 numbers. The exchange of maps every 91 steps is switched off: it is a reset.
"""

from __future__ import annotations

import importlib
import json
import os
import sys
from typing import Any

import numpy as np

from benchmarks.peers.install import PUFFERLIB_SOURCE
from benchmarks.peers.rates import pin, stepping

CARS = 512
DT_S = 0.1
STEPS = 91
"""Of an episode, after which the environment starts again by itself."""


def main() -> None:
    """Print the figures as JSON."""
    pin()
    if not PUFFERLIB_SOURCE.is_dir():
        sys.exit("PufferLib is not installed.")
    # The environment looks for its maps in the working folder.
    os.chdir(PUFFERLIB_SOURCE)
    sys.path.insert(0, str(PUFFERLIB_SOURCE))
    drive: Any = importlib.import_module("pufferlib.ocean.gpudrive.gpudrive")
    environment = drive.GPUDrive(num_maps=1, num_agents=CARS, resample_frequency=0)
    rng = np.random.default_rng(0)

    def step(actions: np.ndarray) -> bool:
        environment.step(actions)
        return False

    measured = stepping(
        environment.reset,
        lambda: rng.integers(0, environment.single_action_space.nvec, (CARS, 2)),
        step,
        steps=STEPS,
        cars=CARS,
        dt_s=DT_S,
    )
    print(json.dumps({"gpudrive": measured}))


if __name__ == "__main__":
    main()
