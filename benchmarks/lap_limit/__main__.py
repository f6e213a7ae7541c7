"""How close the built-in driver comes to the fastest lap that the car's own equations allow.

Run as `python -m benchmarks.lap_limit`; the last line of the output is one JSON object. Its `laps` have, for
each circuit and car:

- `limit_s`: the fastest lap by optimal control, with a full tank and new tyres; `solved` says whether the
  solver is content with it, `points` and `iterations` what it took, `solve_s` how long (CPU time);
- `driver_s`: the best flying lap of the built-in driver alone at full pace, null if it did not finish one;
  `off_course_s` and `wall_s`, how long it was off the course and at walls;
- `ratio`: of the two.

The limit keeps to the rules: never three tyres beyond edge and kerb, no wall touched. It knows what no
driver knows, acts at every moment instead of every 0.1 s, changes gear at once and at the best speed, and
feels no kerbs shake; so a ratio somewhat above 1 is what a perfect driver would reach.

With `--json` every lap is written as soon as it is known, and those already there are not done again.
"""

from __future__ import annotations

import argparse
import json
import math
import time
from importlib.metadata import version
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import track as progress

from benchmarks.lap_limit.flying import FlyingLaps, flying_laps
from benchmarks.lap_limit.plots import plot
from benchmarks.result import read_result, write_result
from nathlon.policies.lap_limit.problem import OptimalLap, fastest_lap
from nathlon.sim.car import load_car
from nathlon.sim.track import load_track

CIRCUITS = ("porto-sereno", "lindenring", "grandes-landes")
CARS = ("gt3", "coupe", "prototype")

Entry = dict[str, Any]


def entry(circuit: str, car: str, lap: OptimalLap, solve_s: float, driver: FlyingLaps) -> Entry:
    """One of `laps`."""
    finished = math.isfinite(driver.best_s)
    return {
        "circuit": circuit,
        "car": car,
        "limit_s": round(lap.lap_s, 3),
        "driver_s": round(driver.best_s, 3) if finished else None,
        "ratio": round(driver.best_s / lap.lap_s, 4) if finished else None,
        "off_course_s": round(driver.off_course_s, 2),
        "wall_s": round(driver.wall_s, 2),
        "solved": lap.solved,
        "points": len(lap.distance),
        "iterations": lap.iterations,
        "solve_s": round(solve_s, 1),
    }


def main() -> None:
    """Find the limits, let the driver drive, print the figures as JSON."""
    parser = argparse.ArgumentParser(
        prog="benchmarks.lap_limit", description="Fastest laps, and the driver's"
    )
    parser.add_argument("--circuit", help="name, or path of a circuit file; all of them by default")
    parser.add_argument("--car", help="name, or path of a car file; all of them by default")
    parser.add_argument("--json", type=Path, help="JSON file of the laps, continued if it is there")
    parser.add_argument("--plots", type=Path, help="folder for a picture of each lap")
    chosen = parser.parse_args()
    circuits = (chosen.circuit,) if chosen.circuit else CIRCUITS
    cars = (chosen.car,) if chosen.car else CARS
    laps: list[Entry] = []
    if chosen.json and chosen.json.exists():
        laps = read_result(chosen.json).figures["laps"]
    done = {(lap["circuit"], lap["car"]) for lap in laps}
    runs = [(circuit, car) for circuit in circuits for car in cars if (circuit, car) not in done]
    for circuit, car in progress(runs, "Fastest laps", console=Console(stderr=True)):
        track = load_track(circuit)
        began = time.process_time()
        lap = fastest_lap(track, load_car(car))
        solve_s = time.process_time() - began
        driver = flying_laps(circuit, car)
        laps.append(entry(circuit, car, lap, solve_s, driver))
        if chosen.json:
            write_result(chosen.json, {"laps": laps}, {"casadi": version("casadi")})
        if chosen.plots:
            chosen.plots.mkdir(parents=True, exist_ok=True)
            title = f"{track.name}, {load_car(car).name}"
            plot(chosen.plots / f"{track.name}-{load_car(car).name}.svg", title, track, lap, driver)
    print(json.dumps({"laps": laps}))


if __name__ == "__main__":
    main()
