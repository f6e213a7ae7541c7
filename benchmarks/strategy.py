"""Whether a planner stops when it should: against fixed plans, alone on the road and in fields of twenty.

`python -m benchmarks.strategy --json FILE [--seeds N] [--field-seeds N] [--laps N] [--circuits NAME,NAME]
[--policy NAME] [--out FOLDER]` has a policy practise (`nathlon stints`), the champion of each circuit if none
is named, and then races its planner against plans of none to five stops with even stints, each on the
compound that the model likes best for it. The folder keeps what was practised and every
match that was driven: after a stop the same command goes on with the match that it was in. Circuits that FILE
has and that are not raced anew are kept, and so are its fields of the same strategies where none are asked
for (`--field-seeds 0`). Threads of BLAS that wait for each other take nine tenths of the time on a busy
machine: `OPENBLAS_NUM_THREADS=1` has them not. Figures by circuit:

- `alone`: race time by strategy and seed, s; null where the car did not come to the end;
- `expected_s`: of the fixed plans that came to the end of some race, by the model;
- `fields`: of the planner against the best of the fixed plans that came to the end of every race, and of that
  against the next best, ten cars each: their mean places by seed, with the hours that were driven and the
  seconds on the clock; every grid is also raced the other way round. `lap_wise` is the first one's mean place
  in as many races lap by lap (`LapRace`) as LAP_WISE, likewise. None where no plan did.

On the last line, over all circuits: `races` alone in which some fixed plan came to the end, and in how many
of them, `near`, and in which share, `within_0.3_percent`, the planner took at most 0.3 % longer than the best
plan of that race; `places_gained` by it on the best fixed plan in the field;
`places_error`, by which mean places lap by lap are off; `model_error`, the mean share of race
time by which the model errs on fixed plans; and `hours_a_minute`, hours of twenty cars' racing in a minute.
"""

from __future__ import annotations

import argparse
import json
import os
import time
from collections.abc import Collection, Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from statistics import fmean
from typing import Any

import numpy as np
import polars as pl

import nathlon
from benchmarks.result import read_result, write_result
from nathlon.arena.entrant import enter
from nathlon.arena.match import Match, Race, Seat
from nathlon.arena.match_policies import match_policies
from nathlon.arena.runner import run_match
from nathlon.policies.bundled import champion
from nathlon.policies.environments.lap_race import LapRace
from nathlon.policies.environments.strategy_env import model_of
from nathlon.policies.sources import is_path
from nathlon.policies.stint_model import StintModel
from nathlon.policies.stint_planner import StintPlanner
from nathlon.policies.stint_search import SPARE_KG
from nathlon.policies.strategy import Stint, StintPlan, Strategist
from nathlon.sim.car import load_car
from nathlon.sim.rules import load_rules, rule_parameters
from nathlon.sim.scenario import load_scenario
from nathlon.sim.whole_file import whole_file

CARS = {"lindenring": "gt3", "porto-sereno": "coupe", "grandes-landes": "prototype"}
"""By circuit, those of the champions."""
SCENARIO = "grand_prix_stops"
STOPS = range(6)
NEAR = 1.003
LAP_WISE = 20
"""Races lap by lap from each grid."""
PLANNER = "planner"
AT_ONCE = 10
"""Seeds of races alone in one match."""


def even(model: StintModel, laps: int, stops: int, tank_kg: float) -> tuple[Stint, ...]:
    """Even stints on the compound on which the model expects them to be fastest.

    They begin with the fuel of the whole race, as far as the tank holds it: to fill it in takes longer.
    """
    ends = np.rint(np.linspace(0, laps, stops + 2)).astype(int)
    lengths = np.diff(ends).tolist()
    taken = {one.name: sum(one.laps(0.0, length)[0].sum() for length in lengths) for one in model.compound}
    [compound] = [one for one in model.compound if one.name == min(taken, key=taken.__getitem__)]
    used = [float(compound.laps(0.0, length)[1].sum()) for length in lengths]
    return tuple(
        Stint(
            laps=length,
            compound=compound.name,
            fuel_kg=round(min(sum(used[number:]) + SPARE_KG, tank_kg), 1),
        )
        for number, length in enumerate(lengths)
    )


def lap_wise(model: StintModel, both: Sequence[Strategist], laps: int, tank_kg: float) -> float:
    """Mean place of the first of two strategists, each with half of the cars, lap by lap; over both grids."""
    scenario = load_scenario(SCENARIO)
    pit, cars = rule_parameters(load_rules(scenario.rules)).pit, np.arange(scenario.cars)
    places = []
    for seed in range(LAP_WISE):
        for turn in range(2):
            rng = np.random.default_rng(seed)
            race = LapRace(model, laps, pit, tank_kg, [0.0] * len(cars), rng)
            strategists = [both[number] for number in ((cars + turn) % 2).tolist()]
            for car, strategist in enumerate(strategists):
                race.fit(car, strategist.start(race.wall(car)))
            for _ in range(laps):
                race.drive([strategist.decide(race.wall(car)) for car, strategist in enumerate(strategists)])
            places.append(1.0 + race.time_s.argsort().argsort()[turn::2].mean())
    return fmean(places)


def expected_s(model: StintModel, stints: Sequence[Stint], laps: int, tank_kg: float) -> float:
    """What the lap-wise model says of a plan, without noise."""
    pit = rule_parameters(load_rules(load_scenario(SCENARIO).rules)).pit
    race = LapRace(model, laps, pit, tank_kg, [0.0], np.random.default_rng(0), 0.0)
    race.fit(0, stints[0].service)
    ends, stint = np.cumsum([one.laps for one in stints]), 0
    for lap in range(1, laps + 1):
        due = stint + 1 < len(stints) and lap == ends[stint]
        stint += due
        race.drive([stints[stint].service if due else None])
    return float(race.time_s[0])


def written(folder: Path, policy: str, name: str, stints: Sequence[Stint]) -> str:
    """A plan as a composite."""
    part = os.path.relpath(policy, folder) if is_path(policy) else policy
    lines = [f"name = {json.dumps(name)}", "[[part]]", f"policy = {json.dumps(part)}"]
    for stint in stints:
        lines += [
            "[[stint]]",
            f"laps = {stint.laps}",
            f'compound = "{stint.compound}"',
            f"fuel_kg = {stint.fuel_kg}",
        ]
    path = folder / f"{name.replace(' ', '-')}.toml"
    path.write_text("\n".join(lines) + "\n", "utf-8")
    return str(path)


def alone(
    sources: Mapping[str, str], circuit: str, laps: int, seeds: Sequence[int], folder: Path
) -> dict[str, list[float | None]]:
    """Race times without anybody else, s, by strategy; None for who did not finish."""
    taken: dict[str, list[float | None]] = {name: [] for name in sources}
    for first in range(0, len(seeds), AT_ONCE):
        some = seeds[first : first + AT_ONCE]
        races = [Race(seed, (Seat(number),)) for number in range(len(sources)) for seed in some]
        results = run(sources.values(), f"{SCENARIO}:laps={laps},cars=1", circuit, races, folder)
        times = results.sort("race")["race_time_s"].round(3).to_list()
        for number, name in enumerate(sources):
            taken[name] += times[number * len(some) : (number + 1) * len(some)]
    return taken


def field(
    both: Mapping[str, str], circuit: str, laps: int, seeds: Sequence[int], folder: Path
) -> list[dict[str, Any]]:
    """Mean places of two strategies, ten cars each, by seed, with hours and s taken; over both grids."""
    told = []
    for seed in seeds:
        races = [Race(seed, tuple(Seat((slot + turn) % 2) for slot in range(20))) for turn in range(2)]
        results = run(both.values(), f"{SCENARIO}:laps={laps}", circuit, races, folder)
        seats = np.array([seat.entrant for race in races for seat in race.seats])
        places = results.sort("race", "car")["place"].to_numpy()
        told.append(
            {
                "places": {name: float(places[seats == number].mean()) for number, name in enumerate(both)},
                "hours": float(results["driven_s"].to_numpy().max()) * len(races) / 3600.0,
                "wall_s": float(results["wall_s"][0]),
            }
        )
    return told


def run(
    sources: Collection[str], scenario: str, circuit: str, races: Sequence[Race], folder: Path
) -> pl.DataFrame:
    """RESULTS of one match and `wall_s` that it took; from the folder if it was driven before."""
    car = CARS[circuit]
    ids = tuple(enter(source, circuit, car).id for source in sources)
    match = Match("race", "strategy", scenario, circuit, car, ids, tuple(sources), tuple(races))
    path = folder / f"{match.key}.parquet"
    if not path.is_file():
        began = time.perf_counter()
        results = run_match(match, match_policies(match))
        with whole_file(path) as partial:
            results.with_columns(wall_s=time.perf_counter() - began).write_parquet(partial)
    return pl.read_parquet(path)


def measure(
    circuit: str,
    policy: str,
    laps: int,
    seeds: Sequence[int],
    in_field: Sequence[int],
    before: Sequence[Mapping[str, Any]],
    folder: Path,
) -> dict[str, Any]:
    """The figures of a circuit, given the seeds of races alone and in a field.

    Without seeds of fields, those of before are kept whose strategies would meet now.
    """
    planner, car = folder / "planner.toml", CARS[circuit]
    tank_kg = load_car(car).fuel.capacity_kg
    if not planner.is_file():
        scenario = f"{SCENARIO}:laps={laps}"
        nathlon.stints(policy, scenario=scenario, circuit=circuit, car=car, workers=1, out=folder)
    model = model_of(str(planner))
    fixed = {f"{stops} stops": even(model, laps, stops, tank_kg) for stops in STOPS}
    sources = {name: written(folder, policy, name, stints) for name, stints in fixed.items()}
    driven = alone({PLANNER: str(planner)} | sources, circuit, laps, seeds, folder)
    print(circuit, json.dumps(driven), flush=True)
    seconds = {name: np.array(driven[name], np.float64) for name in fixed}
    lasting = [name for name in fixed if np.isfinite(seconds[name]).all()]
    ranked = sorted(lasting, key=lambda name: float(seconds[name].mean()))
    sources[PLANNER] = str(planner)
    strategists: dict[str, Strategist] = {name: StintPlan(stints) for name, stints in fixed.items()} | {
        PLANNER: StintPlanner(model)
    }
    meetings = [list(both) for both in pairwise([PLANNER, *ranked[:2]])]
    return {
        "alone": driven,
        "expected_s": {
            name: round(expected_s(model, stints, laps, tank_kg), 3)
            for name, stints in fixed.items()
            if np.isfinite(seconds[name]).any()
        },
        "fields": [
            {
                "strategies": both,
                "races": field({name: sources[name] for name in both}, circuit, laps, in_field, folder),
                "lap_wise": round(lap_wise(model, [strategists[name] for name in both], laps, tank_kg), 2),
            }
            for both in meetings
        ]
        if in_field
        else [one for one in before if one["strategies"] in meetings],
    }


def summary(circuits: Mapping[str, Mapping[str, Any]]) -> dict[str, float | None]:
    """The figures over all circuits: the planner's of the races in which some fixed plan came round."""
    near, errors, gained, off, hours, wall_s = [], [], [], [], 0.0, 0.0
    for one in circuits.values():
        taken = {name: np.array(times, np.float64) for name, times in one["alone"].items()}
        planned = taken.pop(PLANNER)
        best = np.fmin.reduce(list(taken.values()))
        near += (planned <= NEAR * best)[np.isfinite(best)].tolist()
        for name, expected in one["expected_s"].items():
            came = taken[name][np.isfinite(taken[name])]
            errors += np.abs(expected / came - 1.0).tolist()
        for meeting in one["fields"]:
            (first, second), races = meeting["strategies"], meeting["races"]
            if first == PLANNER:
                gained += [race["places"][second] - race["places"][first] for race in races]
            if races:
                off.append(abs(fmean(race["places"][first] for race in races) - meeting["lap_wise"]))
            hours += sum(race["hours"] for race in races)
            wall_s += sum(race["wall_s"] for race in races)
    return {
        "races": len(near),
        "near": sum(near),
        "within_0.3_percent": round(fmean(near), 3) if near else None,
        "places_gained": round(fmean(gained), 2) if gained else None,
        "places_error": round(fmean(off), 2) if off else None,
        "model_error": round(fmean(errors), 5) if errors else None,
        "hours_a_minute": round(hours / (wall_s / 60.0), 2) if gained else None,
    }


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure, and print the figures over all circuits on the last line."""
    parser = argparse.ArgumentParser(description="Race a planner against fixed plans.")
    parser.add_argument("--json", type=Path, required=True)
    parser.add_argument("--seeds", type=int, default=200)
    parser.add_argument("--field-seeds", type=int, help="in a field; as many as alone by default")
    parser.add_argument("--laps", type=int, default=12)
    parser.add_argument("--circuits", default=",".join(CARS))
    parser.add_argument("--policy", help="the champion of each circuit by default")
    parser.add_argument("--out", type=Path, default=Path("runs/strategy"), help="folder for the strategies")
    options = parser.parse_args(arguments)
    seeds = range(1, options.seeds + 1)
    in_field = seeds if options.field_seeds is None else range(1, options.field_seeds + 1)
    circuits: dict[str, Any] = read_result(options.json).figures["circuits"] if options.json.is_file() else {}
    for circuit in options.circuits.split(","):
        policy = options.policy or str(champion(circuit, CARS[circuit]))
        before = circuits.get(circuit, {}).get("fields", [])
        folder = options.out / circuit
        circuits[circuit] = measure(circuit, policy, options.laps, seeds, in_field, before, folder)
        print(circuit, json.dumps(circuits[circuit]), flush=True)
    told = summary(circuits)
    known = {"laps": options.laps, "policy": options.policy or "the champion of each circuit"}
    write_result(options.json, known | {"circuits": circuits} | told)
    print(json.dumps(told))


if __name__ == "__main__":
    main()
