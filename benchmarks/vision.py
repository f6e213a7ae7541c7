"""Speed of the camera, and how well a policy races by what it sees, beside the champion of its circuit.

Run as `OPENBLAS_NUM_THREADS=1 python -m benchmarks.vision [--json FILE] [--races N] [CHECKPOINT ...]`, by
default with all of `benchmarks.ladders` that see; the last line of the output is one JSON object:

- `pictures_per_s`: pictures of 64 x 64 x 3 with eight cars in each race, from the cockpit, a CPU second;
- `observations_per_s`: full observations in numbers of the same cars at the same moments, a CPU second;
- `ratio`: the latter over the former;
- `pictures_per_s_by_mount`: the first by where the camera sits;
- `size`: width, height and channels;
- `agents`: by the name of each checkpoint its `circuit` and `car`, `lap_s` and `lap_ratio` to the champion's
  from the same eight rolling starts (see `benchmarks.time_trial`), `off_course_share` of the time driven,
  `clean_starts`; `races` from the last place of eight over two laps against drivers at 0.95, how many were
  `finished` and won (`wins_from_back_8`), `mean_place`, `at_fault_per_km`; `from_20`, the same of as many
  grands prix from the last of twenty places against drivers at 0.88 to 0.92 on a drawn grid, with those
  `in_first_three`; `action_ms` a car, for one car and for eight; and under `champion` the same of the
  champion.

The first bundled checkpoint of the Lindenring drives all cars. Times are CPU times of one thread, medians
over several episodes.
"""

from __future__ import annotations

import argparse
import json
import math
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
from numpy.typing import NDArray
from rich.console import Console
from rich.progress import track

from benchmarks.champions import SEED, places, race_match
from benchmarks.ladders import ladder
from benchmarks.result import write_result
from benchmarks.time_trial import FLYING, drive_alone
from benchmarks.world import BATCH, CAR, CIRCUIT, SCENARIOS, SPEC, seats, trained_drive
from nathlon.arena.entrant import Entrant, enter
from nathlon.arena.match import Match, Race, Seat
from nathlon.arena.match_policies import match_policies
from nathlon.arena.runner import run_match
from nathlon.policies.bundled import BUNDLED, champion
from nathlon.policies.checkpoint import read_card
from nathlon.policies.load import load_policy
from nathlon.policies.policy import Policy
from nathlon.policies.sources import DRIVER
from nathlon.sim.camera_spec import MOUNTS, CameraSpec
from nathlon.sim.car import load_car
from nathlon.sim.observation import ObservationSpec
from nathlon.sim.scenario import load_scenario
from nathlon.sim.track import load_track

CARS, EPISODES, TICKS, EVERY = 8, 7, 100, 4
"""Cars in a race; ticks of an episode, of which every fourth is looked at."""
RACES, DRIVERS = 10, f"{DRIVER}:pace=0.95"
"""From the back, and against whom."""
GRAND_PRIX, CROWD = "grand_prix", tuple(f"{DRIVER}:pace={pace}" for pace in (0.88, 0.89, 0.9, 0.91, 0.92))
"""Races of twenty, and who else is in them."""
ASKED = 200
"""How often an action is asked for."""
Figures = dict[str, Any]
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


def racing(source: str, circuit: str, car: str, races: int) -> Figures:
    """How a policy laps alone and races from the back."""
    entrant = enter(source, circuit, car)
    laps = drive_alone(entrant, FLYING)
    wins, rest = came(race_match(entrant, races, DRIVERS), entrant)
    crowd_wins, crowd = came(crowded(entrant, races), entrant)
    return {
        "lap_s": round(laps.lap_s, 3) if math.isfinite(laps.lap_s) else None,
        "off_course_share": round(laps.off_course_share, 5),
        "clean_starts": laps.clean,
        "races": races,
        "wins_from_back_8": wins,
        **rest,
        "from_20": {"wins": crowd_wins, **crowd},
        "action_ms": {str(cars): action_ms(load_policy(source, circuit, car), cars) for cars in (1, CARS)},
    }


def crowded(entrant: Entrant, races: int) -> Match:
    """Grands prix of an entrant from the last place, drivers of several paces before it."""
    rng = np.random.default_rng(SEED)
    cars = load_scenario(GRAND_PRIX).cars
    grids = rng.integers(1, 1 + len(CROWD), (races, cars - 1)).tolist()
    return Match(
        "race",
        GRAND_PRIX,
        GRAND_PRIX,
        entrant.circuit,
        entrant.car,
        (entrant.id, *CROWD),
        (entrant.source, *CROWD),
        tuple(Race(SEED + race, (*map(Seat, grid), Seat(0))) for race, grid in enumerate(grids)),
    )


def came(match: Match, entrant: Entrant) -> tuple[int, Figures]:
    """How many races an entrant won, and how it raced."""
    rows = run_match(match, match_policies(match)).filter(pl.col("entrant") == entrant.id)
    found = places(rows)
    return found["wins"], {
        "finished": rows.filter(pl.col("ending") == "finished").height,
        "in_first_three": rows.filter(pl.col("place") <= 3).height,
        "mean_place": round(found["mean_place"], 2),
        "at_fault_per_km": found["at_fault_per_km"],
    }


def action_ms(policy: Policy, cars: int) -> float:
    """CPU milliseconds of an action of a car, where so many are asked for at once."""
    seen, memory = policy.observation_spec.blank(cars), policy.initial_memory(cars)
    policy.act(seen, memory)
    times = np.zeros(ASKED)
    for turn in range(ASKED):
        began = time.thread_time()
        policy.act(seen, memory)
        times[turn] = time.thread_time() - began
    return round(float(np.median(times)) / cars * 1000, 3)


def agents(paths: Sequence[Path], races: int, console: Console) -> Figures:
    """Figures of checkpoints that see, by name."""
    found: Figures = {}
    for path in track(paths, "agents", console=console):
        card = read_card(path)
        where = card.circuit, card.car
        own, best = (racing(str(source), *where, races) for source in (path, champion(*where)))
        ratio = round(own["lap_s"] / best["lap_s"], 4) if own["lap_s"] and best["lap_s"] else None
        found[path.stem] = {"circuit": where[0], "car": where[1], **own, "lap_ratio": ratio, "champion": best}
    return found


def main() -> None:
    """Measure, print the figures as JSON."""
    parser = argparse.ArgumentParser(description=str(__doc__).partition("\n")[0])
    parser.add_argument("--json", type=Path, metavar="FILE", help="file for the figures as well")
    parser.add_argument("--races", type=int, default=RACES, metavar="N", help="from the back")
    parser.add_argument("checkpoints", nargs="*", type=Path, metavar="CHECKPOINT", help="that see")
    chosen = parser.parse_args()
    console = Console(stderr=True)
    numbers, *pictures = costs(console).tolist()
    rates = dict(zip(MOUNTS, (round(1.0 / cost) for cost in pictures), strict=True))
    camera = CameraSpec()
    figures = {
        "pictures_per_s": rates[camera.mount],
        "observations_per_s": round(1.0 / numbers),
        "ratio": round(pictures[list(MOUNTS).index(camera.mount)] / numbers, 1),
        "pictures_per_s_by_mount": rates,
        "size": [camera.width, camera.height, camera.channels],
        "agents": agents(chosen.checkpoints or ladder("sight"), chosen.races, console),
    }
    if chosen.json:
        write_result(chosen.json, figures)
    print(json.dumps(figures))


if __name__ == "__main__":
    main()
