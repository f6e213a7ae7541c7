"""Pendulum-v1 whose velocity the policy is not shown: what a memory, and critics that know it, are worth.

Run as `python -m benchmarks.hidden_velocity [--json FILE] [--steps N] [--seeds N ..]`; the last line of the
output is one JSON object:

- `steps`: of the environment, in each run;
- `both`, `critics_see_no_more`, `no_memory`: by seed the mean return (not discounted) of ten episodes driven
  by the mean of the policy, with memory and critics that are told the velocity, and without the one or the
  other.

A policy that sees the velocity comes to about -150, one that does nothing to about -1,200. A run takes some
ten minutes of one core.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import torch
from gymnasium.spaces import Box, Dict
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from numpy.typing import NDArray
from rich.console import Console
from rich.progress import track

from benchmarks.result import write_result
from nathlon.policies.qrsac.config import QRSACConfig
from nathlon.policies.qrsac.gymnasium_training import PARTS, GymnasiumTraining, evaluate

CONFIG = QRSACConfig(
    hidden=(64,),
    n_step=1,
    gamma=0.98,
    alpha=0.2,
    critic_rate=1e-3,
    policy_rate=1e-3,
    dropout=0.0,
    batch=128,
    passage=12,
    recalled=4,
)
MEMORY, ENVIRONMENTS, STEPS, WARM_UP, EPISODES, SEED = 32, 1, 20_000, 1_000, 10, 10_000
"""Units; environments side by side; their steps together, in all and at first without learning."""
RUNS = {"both": (MEMORY, True), "critics_see_no_more": (MEMORY, False), "no_memory": (0, True)}
"""Units of the memory, and whether the critics are told."""

Seen = NDArray[np.float32]


class Hidden(gymnasium.ObservationWrapper[Any, Any, Any]):
    """Shows the angle alone, and if the critics are told, beside it all that there is to them."""

    def __init__(self, told: bool) -> None:
        super().__init__(gymnasium.make("Pendulum-v1"))
        box = Box(-1.0, 1.0, (2,), np.float32)
        whole = self.env.observation_space
        self.told = told
        self.observation_space = Dict(dict(zip(PARTS, (box, whole), strict=True))) if told else box

    def observation(self, observation: Seen) -> dict[str, Seen] | Seen:
        """What is shown of all."""
        angle = observation[:2]
        return dict(zip(PARTS, (angle, observation), strict=True)) if self.told else angle


def made(count: int, told: bool) -> SyncVectorEnv:
    """Environments side by side."""
    make: list[Callable[[], Hidden]] = [partial(Hidden, told)] * count
    return SyncVectorEnv(make, autoreset_mode=AutoresetMode.SAME_STEP)


def mean_return(name: str, seed: int, steps: int) -> float:
    """Of the policy of one run."""
    memory, told = RUNS[name]
    training = GymnasiumTraining(
        made(ENVIRONMENTS, told), CONFIG, seed, warm_up=WARM_UP, capacity=steps, memory=memory
    )
    training.advance(steps)
    return round(float(evaluate(training.learner, made(EPISODES, told), SEED).mean()), 1)


def main() -> None:
    """Make the runs, print what they came to as JSON."""
    parser = argparse.ArgumentParser(description=str(__doc__).partition("\n")[0])
    parser.add_argument("--json", type=Path, metavar="FILE", help="file for the figures as well")
    parser.add_argument("--steps", type=int, default=STEPS)
    parser.add_argument("--seeds", nargs="+", type=int, default=[0])
    parser.add_argument("--runs", nargs="+", choices=RUNS, default=list(RUNS))
    chosen = parser.parse_args()
    torch.set_num_threads(1)
    asked = [(name, seed) for name in chosen.runs for seed in chosen.seeds]
    figures: dict[str, Any] = {"steps": chosen.steps}
    for name, seed in track(asked, "runs", console=Console(stderr=True)):
        figures.setdefault(name, {})[str(seed)] = mean_return(name, seed, chosen.steps)
        if chosen.json:
            write_result(chosen.json, figures)
    print(json.dumps(figures))


if __name__ == "__main__":
    main()
