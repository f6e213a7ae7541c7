"""Speed of the batched world on one core beside that of its peers: agent steps a second, and where they go.

Run as `python -m benchmarks.world [--json FILE]`; the last line of the output is one JSON object. Its
entries, the first four by number of cars in a race:

- `agent_steps_per_s_core`: cars advanced by 0.1 s and observed in full, a CPU second, under random actions;
- `agent_steps_per_s_core_trained`: the same while the first bundled checkpoint of the Lindenring drives;
- `car_seconds_per_cpu_second`: time simulated, without observing, under random actions;
- `step_share`: share of the CPU time that goes to stepping under random actions; the rest goes to observing;
- `two_thread_ratio`: agent steps a second of wall time on two threads against one, eight cars;
- `two_process_ratio`: the same of two processes with a world each against one: what the machine has to give;
- `compile_s`: CPU time of the first start, step and observation of a process, `cold` without compiled kernels
  in the cache and `warm` with them;
- `peers`: other simulators by name (see `benchmarks.peers`), each with its two figures and `ratio`, ours
  over theirs in both: against its agent steps with eight cars, or 20 where its name ends so.

Times but for the two threads and processes are CPU times of one thread, medians over several episodes.
What the policy computes is not counted.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.progress import track

from benchmarks.peers import measure
from benchmarks.result import write_result
from nathlon.policies.bundled import BUNDLED
from nathlon.policies.checkpoint import load_checkpoint
from nathlon.sim.car import load_car
from nathlon.sim.clock import AGENT_DT
from nathlon.sim.observation import ObservationSpec
from nathlon.sim.scenario import load_scenario
from nathlon.sim.track import load_track
from nathlon.sim.world import World

CIRCUIT = "lindenring"
CAR = "gt3"
SCENARIOS = {1: "1v0", 8: "1v7", 20: "grand_prix"}
SPEC = ObservationSpec(course_points=60)
BATCH = 160
"""Cars in a world, whatever the number of races."""
TICKS = 50
"""Of an episode: short, since random drivers soon stand at a wall."""
EPISODES = 15

ROUNDS = 5
"""Of one process beside two."""

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
    world = scenario.world(circuit, load_car(CAR), BATCH // cars)
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


def two_thread_ratio(rng: np.random.Generator) -> float:
    """Wall time of stepping and observing on one thread over that on two."""
    circuit, scenario = load_track(CIRCUIT), load_scenario(SCENARIOS[8])
    drive = random_drive(rng)
    worlds = [scenario.world(circuit, load_car(CAR), 4 * BATCH // 8, threads) for threads in (1, 2)]
    everybody = seats(worlds[0])
    seconds = np.zeros((1 + EPISODES, 2))
    for episode in seconds:
        for world in worlds:
            for race in range(len(world.state)):
                world.reset(race, scenario.place(circuit, rng))
        for _ in range(TICKS):
            for threads, world in enumerate(worlds):
                actions = drive(world)
                began = time.perf_counter()
                world.step(actions)
                world.observe(SPEC, *everybody)
                episode[threads] += time.perf_counter() - began
    return float(np.median(seconds[1:, 0] / seconds[1:, 1]))


def episode_s(seed: int) -> float:
    """Wall time of stepping and observing in an episode of a world on one thread."""
    rng = np.random.default_rng(seed)
    circuit, scenario = load_track(CIRCUIT), load_scenario(SCENARIOS[8])
    world, drive = scenario.world(circuit, load_car(CAR), 4 * BATCH // 8), random_drive(rng)
    everybody = seats(world)
    for race in range(len(world.state)):
        world.reset(race, scenario.place(circuit, rng))
    seconds = 0.0
    for _ in range(TICKS):
        actions = drive(world)
        began = time.perf_counter()
        world.step(actions)
        world.observe(SPEC, *everybody)
        seconds += time.perf_counter() - began
    return seconds


def two_process_ratio() -> float:
    """Twice the wall time of an episode in one process over that of two at once."""
    with ProcessPoolExecutor(2, get_context("spawn")) as pool:
        list(pool.map(episode_s, range(2)))  # loads the kernels
        ratios = []
        for seed in range(ROUNDS):
            alone = pool.submit(episode_s, seed).result()
            ratios.append(2.0 * alone / max(pool.map(episode_s, (seed, seed))))
    return float(np.median(ratios))


def compared(
    peers: dict[str, dict[str, float]], ours: dict[int, dict[str, float]]
) -> dict[str, dict[str, Any]]:
    """Each peer's figures with our multiple of them."""
    return {
        name: {
            **figures,
            "ratio": {
                figure: round(ours[20 if name.endswith("_20") else 8][figure] / value, 1)
                for figure, value in figures.items()
            },
        }
        for name, figures in peers.items()
    }


def first_use() -> float:
    """CPU seconds until a race has started, made one step and been observed."""
    circuit, scenario = load_track(CIRCUIT), load_scenario("1v7")
    world = scenario.world(circuit, load_car(CAR), 1)
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
    parser = argparse.ArgumentParser(description=str(__doc__).partition("\n")[0])
    parser.add_argument("--json", type=Path, metavar="FILE", help="file for the figures as well")
    chosen = parser.parse_args()
    rng = np.random.default_rng(0)
    console = Console(stderr=True)
    bundled = sorted((BUNDLED / "lindenring").glob("*.safetensors"))
    drives = {"random": random_drive(rng), "trained": trained_drive(bundled[0])}
    runs = [(name, cars) for name in drives for cars in SCENARIOS]
    costs = {
        (name, cars): cost(cars, drives[name], rng)
        for name, cars in track(runs, "Stepping and observing", console=console)
    }
    steps = {name: {str(cars): round(1.0 / sum(costs[name, cars])) for cars in SCENARIOS} for name in drives}
    alone = {cars: costs["random", cars] for cars in SCENARIOS}
    figures = {
        "agent_steps_per_s_core": steps["random"],
        "agent_steps_per_s_core_trained": steps["trained"],
        "car_seconds_per_cpu_second": {
            str(cars): round(AGENT_DT / step_s) for cars, (step_s, _) in alone.items()
        },
        "step_share": {str(cars): round(cost[0] / sum(cost), 3) for cars, cost in alone.items()},
        "two_thread_ratio": round(two_thread_ratio(rng), 2),
        "two_process_ratio": round(two_process_ratio(), 2),
        "compile_s": compile_s(),
        "peers": compared(
            measure(console),
            {
                cars: {
                    "agent_steps_per_s_core": 1.0 / (step_s + observe_s),
                    "car_seconds_per_cpu_second": AGENT_DT / step_s,
                }
                for cars, (step_s, observe_s) in alone.items()
            },
        ),
    }
    if chosen.json:
        write_result(chosen.json, figures)
    print(json.dumps(figures))


if __name__ == "__main__":
    main()
