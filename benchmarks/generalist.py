"""How well one policy drives circuits and cars that it was never trained on.

`python -m benchmarks.generalist --json FILE [POLICY] [--circuits DIR] [--cars N] [--tight N] [--races N]`
takes the bundled generalist, or another policy for any pair. Circuits are generated ones of seeds that no
training draws, or every CSV of a folder of the TUM racetrack database; each with the three cars that nathlon
has, and N generated cars, each on one of the circuits in turn. The three home pairs of the specialists come
first; last N generated circuits on which a tight bend follows a long straight, with the three cars in turn.

`pairs` has a row for each `circuit` and `car`:

- `kind` of circuit: home, its style, tight, or real;
- `lap_s`: median of the best of two laps from each of 8 rolling starts; null where half of them gave none;
- `driver_ratio`: over that of the built-in driver, who has planned and practised there; `limit_ratio`: over
  the limit by optimal control, where it is known; `off_course_share` of the time;
- of N races of eight over two laps, from the last place against built-in drivers at 0.95: `finished`, and
  `wins_from_back`; `contacts_per_km`, and `at_fault_per_km` of those laid to it.

`unseen` sums up the rows but those of the home pairs and of tight bends, `kinds` those of each kind; `goals`
says which `unseen` meets.
"""

from __future__ import annotations

import argparse
import itertools
import math
import os
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import polars as pl
from rich.console import Console
from rich.progress import track

from benchmarks.champions import race_match
from benchmarks.result import write_result
from benchmarks.time_trial import FLYING, TimeTrial, drive_alone, limits
from nathlon.arena.entrant import enter
from nathlon.arena.match import Match
from nathlon.arena.pool import run_matches
from nathlon.policies.bundled import generalist
from nathlon.policies.sources import DRIVER
from nathlon.sim.car_family import generate_car, write_car
from nathlon.sim.errors import InputError
from nathlon.sim.track import CURVATURE, Track
from nathlon.sim.track.generating import generate_track, write_generated
from nathlon.sim.track.importing import import_circuit
from nathlon.sim.track.styles import STYLES

HELD_OUT = 1_000_000
"""Seed of the first circuit and car; trainings count from 0."""
CIRCUITS = 6
CARS = ("gt3", "coupe", "prototype")
HOME = (("lindenring", "gt3"), ("porto-sereno", "coupe"), ("grandes-landes", "prototype"))
TIGHT_FROM = HELD_OUT + 1000
"""Seed of the first circuit that is looked at for a tight bend."""
STRAIGHT_M, STRAIGHT_RADIUS_M, TIGHT_RADIUS_M = 300.0, 1000.0, 40.0
"""A long straight is so long and bends no more than this; a tight bend has this radius at most."""
INTO_BEND_M = 100.0
"""From the end of a straight to where the bend is tightest, at most."""
OTHERS = f"{DRIVER}:pace=0.95"
SEED = 4711

Row = dict[str, Any]


class Pair(NamedTuple):
    """A kind of circuit, the circuit and the car."""

    kind: str
    circuit: str
    car: str


def home() -> list[Pair]:
    """The pairs of the specialists."""
    return [Pair("home", circuit, car) for circuit, car in HOME]


def unseen(folder: Path, real: Path | None, cars: int) -> list[Pair]:
    """Pairs that no training has seen; files go into a folder."""
    if real is None:
        circuits = [_generated(folder, seed) for seed in range(HELD_OUT, HELD_OUT + CIRCUITS)]
    else:
        files = sorted(real.glob("*.csv"))
        circuits = [("real", str(import_circuit(file, file.stem.lower(), folder).path)) for file in files]
    if not circuits:
        raise InputError(f"{real}: no CSV file, expected those of circuits")
    made = []
    for place in range(cars):
        path = folder / f"car-{place}.toml"
        write_car(path, generate_car(HELD_OUT + place))
        made.append(Pair(*circuits[place % len(circuits)], str(path)))
    return [Pair(*circuit, car) for circuit in circuits for car in CARS] + made


def tight(folder: Path, count: int) -> list[Pair]:
    """The first generated circuits on which a tight bend follows a long straight, with the cars in turn."""
    found: list[Pair] = []
    seeds = itertools.count(TIGHT_FROM)
    while len(found) < count:
        seed = next(seeds)
        if brakes_hard(generate_track(seed, _style(seed))):
            found.append(Pair("tight", _generated(folder, seed)[1], CARS[len(found) % len(CARS)]))
    return found


def brakes_hard(track: Track) -> bool:
    """Whether a tight bend follows a long straight somewhere on the lap."""
    curvature = np.abs(track.table[:, CURVATURE])
    straight, into = (round(length / track.spacing) for length in (STRAIGHT_M, INTO_BEND_M))
    bends = np.flatnonzero(curvature >= 1.0 / STRAIGHT_RADIUS_M)
    since = np.diff(bends, prepend=bends[-1] - len(curvature))
    ahead = bends[since >= straight, None] + np.arange(into)
    return bool((curvature[ahead % len(curvature)] >= 1.0 / TIGHT_RADIUS_M).any())


def _style(seed: int) -> str:
    return list(STYLES)[seed % len(STYLES)]


def _generated(folder: Path, seed: int) -> tuple[str, str]:
    return _style(seed), str(write_generated(folder, seed, _style(seed)))


def alone(policy: str, pair: Pair) -> Row:
    """Laps alone, beside those of the built-in driver."""
    kind, circuit, car = pair
    laps, driver = (drive_alone(enter(source, circuit, car), FLYING) for source in (policy, DRIVER))
    limit_s = limits().get((circuit, car))
    return {
        "kind": kind,
        "circuit": Path(circuit).parent.name if circuit.endswith(".toml") else circuit,
        "car": Path(car).stem,
        "lap_s": number(laps.lap_s, 3),
        "driver_ratio": _ratio(laps, driver.lap_s),
        "limit_ratio": None if limit_s is None else _ratio(laps, limit_s),
        "off_course_share": round(laps.off_course_share, 5),
        "clean_starts": laps.clean,
    }


def _ratio(laps: TimeTrial, other_s: float) -> float | None:
    return number(laps.lap_s / other_s, 4)


def number(value: float, digits: int) -> float | None:
    """Rounded; null where it is not finite."""
    return round(value, digits) if math.isfinite(value) else None


def in_races(rows: pl.DataFrame) -> Row:
    """Places and contacts of RESULTS, a row a race."""
    finished = pl.col("ending") == "finished"
    km = float(rows["distance_m"].sum()) / 1000.0
    return {
        "races": rows.height,
        "finished": rows.filter(finished).height,
        "wins_from_back": rows.filter(finished & (pl.col("place") == 1)).height,
        "mean_place": round(float(rows["place"].to_numpy().mean()), 2),
        "contacts_per_km": round(float(rows["contacts"].sum()) / km, 3),
        "at_fault_per_km": round(float(rows["contacts_at_fault"].sum()) / km, 3),
    }


def summary(rows: Sequence[Row]) -> Row:
    """Of all pairs together."""
    ratios = np.array([row["driver_ratio"] or math.inf for row in rows])
    raced = sum(row["races"] for row in rows)
    return {
        "pairs": len(rows),
        "no_lap": int(np.isinf(ratios).sum()),
        "driver_ratio": number(float(np.median(ratios)), 4),
        "driver_ratio_worst": number(float(ratios.max()), 4),
        "off_course_share": round(float(np.mean([row["off_course_share"] for row in rows])), 5),
        "finished_share": round(sum(row["finished"] for row in rows) / raced, 3),
        "wins_share": round(sum(row["wins_from_back"] for row in rows) / raced, 3),
        "mean_place": round(sum(row["mean_place"] * row["races"] for row in rows) / raced, 2),
        "at_fault_per_km": round(float(np.mean([row["at_fault_per_km"] for row in rows])), 3),
    }


def goals(unseen: Row) -> dict[str, bool]:
    """Which goals are met."""
    median, worst = unseen["driver_ratio"], unseen["driver_ratio_worst"]
    return {
        "median at most 0.995 of the built-in driver's lap": median is not None and median <= 0.995,
        "no pair past 1.06 or without a lap": not unseen["no_lap"] and worst is not None and worst <= 1.06,
        "off course at most 0.3 % of the time": unseen["off_course_share"] <= 0.003,
        "98 % of races finished": unseen["finished_share"] >= 0.98,
        "60 % won from the back": unseen["wins_share"] >= 0.6,
        "at fault at most 0.05 times a kilometre": unseen["at_fault_per_km"] <= 0.05,
    }


def measure(policy: str, found: Sequence[Pair], races: int, workers: int) -> list[Row]:
    """A row for each pair."""
    console = Console(stderr=True)
    rows = [alone(policy, pair) for pair in track(found, "Laps alone", console=console)]
    matches: list[Match] = [
        race_match(enter(policy, pair.circuit, pair.car), races, OTHERS, seed=SEED + place)
        for place, pair in enumerate(found)
    ]
    ended = track(run_matches(matches, workers), "Races", len(matches), console=console)
    raced = {
        match.key: in_races(results.filter(pl.col("slot") == pl.col("slot").max()))
        for match, results in ended
    }
    return [row | raced[match.key] for row, match in zip(rows, matches, strict=True)]


def main() -> None:
    """Measure, and write the JSON."""
    parser = argparse.ArgumentParser(prog="benchmarks.generalist", description="One policy for any car")
    parser.add_argument("policy", nargs="?", help="checkpoint or built-in driver; default: the bundled one")
    parser.add_argument("--circuits", type=Path, help="folder of CSV files; default: generated circuits")
    parser.add_argument("--cars", type=int, default=20, help="generated ones")
    parser.add_argument("--tight", type=int, default=0, help="circuits with a tight bend after a straight")
    parser.add_argument("--races", type=int, default=5, help="of each pair")
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--json", type=Path, required=True, help="file for the figures")
    chosen = parser.parse_args()
    policy = chosen.policy or str(generalist())
    try:
        with tempfile.TemporaryDirectory() as folder:
            new = unseen(Path(folder), chosen.circuits, chosen.cars)
            found = [*home(), *new, *tight(Path(folder), chosen.tight)]
            rows = measure(policy, found, chosen.races, chosen.workers)
    except InputError as error:
        parser.error(str(error))
    whole = summary([row for row in rows if row["kind"] not in ("home", "tight")])
    kinds = {
        kind: summary([row for row in rows if row["kind"] == kind])
        for kind in dict.fromkeys(pair.kind for pair in found)
    }
    write_result(
        chosen.json,
        {
            "checkpoint": enter(policy, *found[0][1:]).name,
            "unseen": whole,
            "kinds": kinds,
            "goals": goals(whole),
            "pairs": rows,
        },
    )


if __name__ == "__main__":
    main()
