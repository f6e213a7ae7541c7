"""World and learner on a CUDA device beside the same on the machine's processors.

Run as `python -m benchmarks.cuda [--part world|learner|training] [--json FILE]`. The entries of the JSON:

- `device`: its name; `threads`: of the processors, all there are;
- `world`: for each number of races of eight cars, agent steps a second (0.1 s of driving and a full
  observation; actions come from the processor, observations go there) on the `device` and on the
  `processor`, and on the device without observing (`device_step`);
- `learner`: for each shape of the networks and batch, updates a second on the device, one by one (`device`)
  and eight in a captured graph (`device_8`), and compiled on the `processor`, each in its fastest precision;
  batches are drawn by the processor;
- `training`: for each configuration, updates a second of a run with networks on the `device` and on the
  `processor`, once the first `STARTING` are made.

Wall times; medians of `TURNS` turns, but for training.
"""

from __future__ import annotations

import argparse
import json
import os
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import torch
from numba import cuda

from benchmarks.learner_sizes import ACTION, OBSERVATION, SIZES, our_config, our_replay
from benchmarks.result import write_result
from nathlon.policies.qrsac.learner import QRSAC, fast_precision
from nathlon.policies.training.config import CONFIGS, read_config
from nathlon.policies.training.log import Status
from nathlon.policies.training.trainer import Device, Trainer
from nathlon.sim.car import load_car
from nathlon.sim.cuda_world import CudaWorld
from nathlon.sim.data_file import find_data
from nathlon.sim.observation import ObservationSpec
from nathlon.sim.scenario import load_scenario
from nathlon.sim.track import load_track
from nathlon.sim.world import World

RACES = (32, 512, 8192)
SPEC = ObservationSpec(course_points=60)
WORKERS = {"racing": 2, "paper": 8}
"""Processes of rollouts of the configurations trained; racing's smallest shares allow no more."""
UPDATES, STARTING = 1_000, 250
WARM_UP, REPLAY = 5_000, 200_000
TURNS = 5
TURN_S = 0.5
TOGETHER = 8
"""Updates of a captured graph."""
THREADS = os.cpu_count() or 1


def calls_per_s(call: Callable[[], object], finish: Callable[[], object] = lambda: None) -> float:
    """Median over the turns; `finish` waits for what the calls have begun."""
    call()
    finish()
    rates = []
    for _ in range(TURNS):
        count, began = 0, time.perf_counter()
        while time.perf_counter() - began < TURN_S:
            call()
            finish()
            count += 1
        rates.append(count / (time.perf_counter() - began))
    return float(np.median(rates))


def world_of(races: int) -> World:
    """Races of eight cars as they start."""
    circuit, scenario = load_track("lindenring"), load_scenario("1v7")
    world = scenario.world(circuit, load_car("gt3"), races, THREADS)
    rng = np.random.default_rng(0)
    for race in range(races):
        world.reset(race, scenario.place(circuit, rng))
    return world


def world_rates(races: int) -> dict[str, int]:
    """Agent steps a second."""
    world = world_of(races)
    device = CudaWorld(world)
    seats = np.indices(world.state.shape).reshape(2, -1)
    actions = np.random.default_rng(0).uniform(-1.0, 1.0, (*world.state.shape, 2))

    def both(driven: World | CudaWorld) -> None:
        driven.step(actions)
        driven.observe(SPEC, *seats)

    rates = {
        "device": calls_per_s(lambda: both(device)),
        "device_step": calls_per_s(lambda: device.step(actions), cuda.synchronize),
        "processor": calls_per_s(lambda: both(world)),
    }
    return {name: round(rate * world.state.size) for name, rate in rates.items()}


def learner_rates(hidden: tuple[int, ...], batch: int) -> dict[str, float]:
    """Updates a second."""
    rng = np.random.default_rng(0)
    replay, rates = our_replay(rng), {}
    for name, device, count in (
        ("device", "cuda", 1),
        (f"device_{TOGETHER}", "cuda", TOGETHER),
        ("processor", "cpu", 1),
    ):
        # Many threads that draw one batch wait for each other.
        torch.set_num_threads(THREADS if device == "cpu" else 1)
        generator = torch.Generator(device).manual_seed(0)
        learner = QRSAC(OBSERVATION, ACTION, our_config(hidden, batch, "auto"), generator)

        def update(learner: QRSAC = learner, count: int = count) -> None:
            learner.updates(lambda: replay.sample(batch, rng), count)

        finish = torch.cuda.synchronize if device == "cuda" else lambda: None
        rates[name] = round(count * calls_per_s(update, finish), 1)
    return rates


def training_rate(name: str, device: Device, folder: Path) -> float:
    """Updates a second of a run."""
    config = read_config(find_data(name, "training configuration", CONFIGS)).model_copy(
        update={
            "updates": UPDATES,
            "checkpoint_every": UPDATES,
            "warm_up": WARM_UP,
            "replay": REPLAY,
            "workers": WORKERS[name],
        }
    )
    seen: list[tuple[int, float]] = []

    def note(status: Status) -> None:
        seen.append((status.updates, time.perf_counter()))

    Trainer.start(folder, config, 1, device=device).run(note)
    steady = [each for each in seen if each[0] >= STARTING]
    (first, began), (last, ended) = steady[0], steady[-1]
    return round((last - first) / (ended - began), 1)


def training_rates(name: str) -> dict[str, float]:
    """Of a configuration, on both."""
    with TemporaryDirectory() as folder:
        return {
            "device": training_rate(name, "cuda", Path(folder) / "device"),
            "processor": training_rate(name, "cpu", Path(folder) / "processor"),
        }


PARTS: dict[str, dict[str, Callable[[], dict[str, Any]]]] = {
    "world": {str(races): partial(world_rates, races) for races in RACES},
    "learner": {name: partial(learner_rates, *size) for name, size in SIZES.items()},
    "training": {name: partial(training_rates, name) for name in WORKERS},
}


def main() -> None:
    """Measure, and print each of the figures as JSON."""
    parser = argparse.ArgumentParser(description=str(__doc__).partition("\n")[0])
    parser.add_argument("--part", choices=PARTS, action="append", help="measure this only; may be repeated")
    parser.add_argument("--json", type=Path, metavar="FILE", help="file for the figures as well")
    chosen = parser.parse_args()
    figures: dict[str, Any] = {
        "device": torch.cuda.get_device_name(),
        "precision": str(fast_precision(torch.device("cuda"))).removeprefix("torch."),
        "threads": THREADS,
    }
    for part in chosen.part or PARTS:
        figures[part] = {}
        for name, measure in PARTS[part].items():
            figures[part][name] = measure()
            print(json.dumps({part: {name: figures[part][name]}}), flush=True)
            # After each: the next may not fit in the device's memory.
            if chosen.json:
                write_result(chosen.json, figures)


if __name__ == "__main__":
    main()
