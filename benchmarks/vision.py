"""Speed of the camera: pictures a second on one core, beside observations in numbers in the same run.

Run as `python -m benchmarks.vision [--json FILE]`; the last line of the output is one JSON object:

- `pictures_per_s`: pictures of 64 x 64 x 3 with eight cars in each race, from the cockpit, a CPU second;
- `observations_per_s`: full observations in numbers of the same cars at the same moments, a CPU second;
- `ratio`: the latter over the former;
- `pictures_per_s_by_mount`: the first by where the camera sits;
- `size`: width, height and channels.

The first bundled checkpoint of the Lindenring drives all cars. Times are CPU times of one thread, medians
over several episodes.
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.progress import track

from benchmarks.result import write_result
from benchmarks.world import BATCH, CAR, CIRCUIT, SCENARIOS, SPEC, seats, trained_drive
from nathlon.policies.bundled import BUNDLED
from nathlon.sim.camera_spec import MOUNTS, CameraSpec
from nathlon.sim.car import load_car
from nathlon.sim.observation import ObservationSpec
from nathlon.sim.scenario import load_scenario
from nathlon.sim.track import load_track

CARS, EPISODES, TICKS, EVERY = 8, 7, 100, 4
"""Cars in a race; ticks of an episode, of which every fourth is looked at."""
SPECS = [SPEC, *(ObservationSpec(camera=CameraSpec(mount=mount)) for mount in MOUNTS)]


def costs(console: Console) -> NDArray[np.float64]:
    """CPU seconds of an observation by each of SPECS."""
    circuit, scenario = load_track(CIRCUIT), load_scenario(SCENARIOS[CARS])
    world, rng = scenario.world(circuit, load_car(CAR), BATCH // CARS), np.random.default_rng(1)
    drive, everybody = trained_drive(min((BUNDLED / CIRCUIT).glob("*.safetensors"))), seats(world)
    for spec in SPECS:
        world.observe(spec, *everybody)  # compiles the kernels or loads them
    episodes = np.zeros((EPISODES, len(SPECS)))
    for episode in track(episodes, "episodes", console=console):
        for race in range(BATCH // CARS):
            world.reset(race, scenario.place(circuit, rng))
        for tick in range(TICKS):
            world.step(drive(world))
            if tick % EVERY:
                continue
            for at, spec in enumerate(SPECS):
                began = time.thread_time()
                world.observe(spec, *everybody)
                episode[at] += time.thread_time() - began
    return np.asarray(np.median(episodes, axis=0) / (TICKS // EVERY * BATCH))


def main() -> None:
    """Measure, print the figures as JSON."""
    parser = argparse.ArgumentParser(description=str(__doc__).partition("\n")[0])
    parser.add_argument("--json", type=Path, metavar="FILE", help="file for the figures as well")
    chosen = parser.parse_args()
    numbers, *pictures = costs(Console(stderr=True)).tolist()
    rates = dict(zip(MOUNTS, (round(1.0 / cost) for cost in pictures), strict=True))
    camera = CameraSpec()
    figures = {
        "pictures_per_s": rates[camera.mount],
        "observations_per_s": round(1.0 / numbers),
        "ratio": round(pictures[list(MOUNTS).index(camera.mount)] / numbers, 1),
        "pictures_per_s_by_mount": rates,
        "size": [camera.width, camera.height, camera.channels],
    }
    if chosen.json:
        write_result(chosen.json, figures)
    print(json.dumps(figures))


if __name__ == "__main__":
    main()
