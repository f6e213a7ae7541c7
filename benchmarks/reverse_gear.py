"""What the reverse gear brings: cars that come to the end with it and without it.

`python -m benchmarks.reverse_gear --json FILE [--races 20]` has built-in drivers of all tempers race two
laps, and start anywhere, facing anywhere (`recovery`), where walls stand close: on Porto Sereno and
on two generated streets. The same races are run with drivers whose cars have no reverse gear.

`races` has a row for each `circuit` and `scenario`: `cars` that started, and of these `stuck_with` and
`stuck_without` a reverse gear, which no longer moved; all others ran to the end.
"""

from __future__ import annotations

import argparse
import json
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import track

from benchmarks.result import write_result
from nathlon.arena.match import Match, Race, Seat
from nathlon.arena.runner import run_match
from nathlon.policies.driver import Driver
from nathlon.policies.temper import TEMPERS
from nathlon.sim.scenario import load_scenario
from nathlon.sim.track.generating import write_generated

SCENARIOS = ("race", "recovery")
PACES = (1.0, 0.97, 0.94)
STREETS = (2_000_000, 2_000_001)
"""Seeds."""
SEED = 31


def drivers(circuit: str, car: str, reverse: bool) -> list[Driver]:
    """One of each pace and temper."""
    made = [Driver(circuit, car, pace=pace, temper=temper) for pace in PACES for temper in TEMPERS]
    for driver in made:
        driver.reverse = reverse
    return made


def endings(circuit: str, car: str, scenario: str, races: int, reverse: bool) -> list[str]:
    """How the runs of all cars ended."""
    policies = drivers(circuit, car, reverse)
    cars = load_scenario(scenario).cars
    drawn = tuple(
        Race(SEED + race, tuple(Seat((race + seat) % len(policies)) for seat in range(cars)))
        for race in range(races * 8 // cars)
    )
    names = tuple(f"driver {number}" for number in range(len(policies)))
    results = run_match(Match("race", "race", scenario, circuit, car, names, names, drawn), policies)
    return results["ending"].to_list()


def measure(places: Sequence[tuple[str, str]], races: int) -> list[dict[str, Any]]:
    """A row for each circuit and scenario."""
    rows = []
    asked = [(*place, scenario) for place in places for scenario in SCENARIOS]
    for circuit, car, scenario in track(asked, "Races", console=Console(stderr=True)):
        without, fitted = (endings(circuit, car, scenario, races, reverse) for reverse in (False, True))
        rows.append(
            {
                "circuit": Path(circuit).parent.name if circuit.endswith(".toml") else circuit,
                "car": car,
                "scenario": scenario,
                "cars": len(fitted),
                "stuck_with": fitted.count("stuck"),
                "stuck_without": without.count("stuck"),
            }
        )
    return rows


def main() -> None:
    """Measure, print the figures as JSON."""
    parser = argparse.ArgumentParser(description=str(__doc__).partition("\n")[0])
    parser.add_argument("--json", type=Path, metavar="FILE", help="file for the figures as well")
    parser.add_argument("--races", type=int, default=20, help="of eight cars")
    chosen = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        streets = [(str(write_generated(Path(folder), seed, "street")), "gt3") for seed in STREETS]
        figures = {"races": measure([("porto-sereno", "coupe"), *streets], chosen.races)}
    if chosen.json:
        write_result(chosen.json, figures)
    print(json.dumps(figures))


if __name__ == "__main__":
    main()
