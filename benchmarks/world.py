"""Speed of the batched world on one core: agent steps a second, where their time goes, and compilation.

Run as `python -m benchmarks.world`; the last line of the output is one JSON object. Its entries, the first
four by number of cars in a race:

- `agent_steps_per_s_core`: cars advanced by 0.1 s and observed in full, a CPU second, under random actions;
- `agent_steps_per_s_core_trained`: the same while the first bundled checkpoint drives, if there is one;
- `car_seconds_per_cpu_second`: time simulated, without observing, under random actions;
- `step_share`: share of the CPU time that goes to stepping under random actions; the rest goes to observing;
- `compile_s`: CPU time of the first start, step and observation of a process, `cold` without compiled kernels
  in the cache and `warm` with them;
- `machine` and `versions`.

Times are those of one thread (the kernels have no parallel loops), medians over several episodes. What
the policy computes is not counted.
"""

from __future__ import annotations

import json
import os
import platform
import subprocess
import sys
import time
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.progress import track

import policies
from policies.checkpoint import load_checkpoint
from sim.car import load_car
from sim.observation import ObservationSpec
from sim.scenario import load_scenario
from sim.track import load_track
from sim.world import AGENT_DT, World

CIRCUIT = "lindenring"
CAR = "gt3"
SCENARIOS = {1: "1v0", 2: "1v1", 4: "1v3", 8: "1v7"}
SPEC = ObservationSpec(course_points=60)
BATCH = 128
"""Cars in a world, whatever the number of races."""
TICKS = 50
"""Of an episode: short, since random drivers soon stand at a wall."""
EPISODES = 15

FIRST_USE = "from benchmarks.world import first_use; print(first_use())"

Actions = NDArray[np.float64]
Drive = Callable[[World], Actions]


def seats(world: World) -> NDArray[np.int64]:
    """Race and index of every car, (2, n)."""
    return np.indices(world.state.shape).reshape(2, -1)


def random_drive(rng: np.random.Generator) -> Drive:
    """Actions drawn evenly from all that there are."""
    return lambda world: rng.uniform(-1.0, 1.0, (*world.state.shape, 2))


def trained_drive(checkpoint: Path) -> Drive:
    """Actions of a checkpoint."""
    policy = load_checkpoint(checkpoint)

    def drive(world: World) -> Actions:
        seen = world.observe(policy.observation_spec, *seats(world))
        actions, _ = policy.act(seen, policy.initial_memory(len(seen)))
        return actions.reshape(*world.state.shape, 2).astype(np.float64)

    return drive


def cost(cars: int, drive: Drive, rng: np.random.Generator) -> tuple[float, float]:
    """CPU seconds to advance one car by an agent step, and to observe it."""
    circuit, scenario = load_track(CIRCUIT), load_scenario(SCENARIOS[cars])
    world = World(circuit, load_car(CAR), BATCH // cars, cars)
    everybody = seats(world)
    episodes = np.zeros((1 + EPISODES, 2))
    for episode in episodes:
        for race in range(BATCH // cars):
            world.reset(race, scenario.place(circuit, rng))
        for _ in range(TICKS):
            actions = drive(world)
            began = time.thread_time()
            world.step(actions)
            stepped = time.thread_time()
            world.observe(SPEC, *everybody)
            episode += stepped - began, time.thread_time() - stepped
    # The first episode compiles the kernels or loads them.
    step_s, observe_s = np.median(episodes[1:], axis=0) / (TICKS * BATCH)
    return float(step_s), float(observe_s)


def first_use() -> float:
    """CPU seconds until a race has started, made one step and been observed."""
    circuit, scenario = load_track(CIRCUIT), load_scenario("1v7")
    world = World(circuit, load_car(CAR), 1, scenario.cars)
    began = time.process_time()
    world.reset(0, scenario.place(circuit, np.random.default_rng(0)))
    world.step(np.zeros((1, scenario.cars, 2)))
    world.observe(SPEC, *seats(world))
    return time.process_time() - began


def compile_s() -> dict[str, float]:
    """`first_use` of a process that finds no compiled kernels, and of one that finds them."""
    with TemporaryDirectory() as cache:
        environment = {**os.environ, "NUMBA_CACHE_DIR": cache}
        command = [sys.executable, "-c", FIRST_USE]
        cold, warm = (
            float(subprocess.run(command, env=environment, check=True, capture_output=True, text=True).stdout)
            for _ in range(2)
        )
    return {"cold": round(cold, 2), "warm": round(warm, 2)}


def main() -> None:
    """Measure, show progress on stderr, print the figures as JSON."""
    rng = np.random.default_rng(0)
    drives = {"random": random_drive(rng)}
    bundled = sorted((Path(str(policies.__file__)).parent / "bundled").rglob("*.safetensors"))
    if bundled:
        drives["trained"] = trained_drive(bundled[0])
    runs = [(name, cars) for name in drives for cars in SCENARIOS]
    costs = {
        (name, cars): cost(cars, drives[name], rng)
        for name, cars in track(runs, "Stepping and observing", console=Console(stderr=True))
    }
    steps = {name: {str(cars): round(1.0 / sum(costs[name, cars])) for cars in SCENARIOS} for name in drives}
    alone = {cars: costs["random", cars] for cars in SCENARIOS}
    figures = {
        "agent_steps_per_s_core": steps["random"],
        **({"agent_steps_per_s_core_trained": steps["trained"]} if bundled else {}),
        "car_seconds_per_cpu_second": {
            str(cars): round(AGENT_DT / step_s) for cars, (step_s, _) in alone.items()
        },
        "step_share": {str(cars): round(cost[0] / sum(cost), 3) for cars, cost in alone.items()},
        "compile_s": compile_s(),
        "machine": platform.platform(),
        "versions": {
            "python": platform.python_version(),
            **{name: version(name) for name in ("numba", "numpy")},
        },
    }
    print(json.dumps(figures))


if __name__ == "__main__":
    main()
