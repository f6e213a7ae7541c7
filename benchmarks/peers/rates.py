"""What the measurements of all peers share."""

from __future__ import annotations

import os
import statistics
import time
from collections.abc import Callable
from typing import Any

EPISODES = 5


def pin() -> None:
    """Keep this process, and those that it starts, on the last core that it may use."""
    os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})


def figures(agent_steps_per_s: float, car_seconds_per_s: float) -> dict[str, float]:
    """The two entries of a peer, per CPU second."""
    return {
        "agent_steps_per_s_core": round(agent_steps_per_s),
        "car_seconds_per_cpu_second": round(car_seconds_per_s, 1),
    }


def stepping(
    reset: Callable[[], object],
    draw: Callable[[], Any],
    step: Callable[[Any], bool],
    *,
    steps: int,
    cars: int,
    dt_s: float,
) -> dict[str, float]:
    """Figures of an environment: the median of several episodes of `steps` steps, after one to warm up.

    `draw` gives the actions of all `cars`, `step` advances them by `dt_s`, observes them and returns whether
    to reset. Only `step` is timed, in CPU seconds of the process.
    """
    costs = []
    for _ in range(1 + EPISODES):
        reset()
        spent = 0.0
        for _ in range(steps):
            actions = draw()
            began = time.process_time()
            over = step(actions)
            spent += time.process_time() - began
            if over:
                reset()
        costs.append(spent / (steps * cars))
    cost = statistics.median(costs[1:])
    return figures(1.0 / cost, dt_s / cost)
