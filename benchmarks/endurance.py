"""How long a race of 24 hours takes: twenty cars, each with a checkpoint of its own.

Run as `python -m benchmarks.endurance [--hours 0.5] [--json FILE]`. The race is driven in one process, by the
hour, as `nathlon endurance` drives it; kernels are compiled before. The last line of the output is one JSON
object: `cars`, `hours` that were driven, and of these the seconds on the clock `wall_s` and of the processor
`processor_s`; both for a whole day in proportion, `day_wall_s` and `day_processor_s`; `laps` of the winner,
`stops` of all, and how many cars were `left` in the end.
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import polars as pl

from benchmarks.result import write_result
from nathlon.arena.entrant import enter
from nathlon.arena.executor import Executor
from nathlon.arena.leg import Leg, LegDriven, drive_leg
from nathlon.arena.match import Match
from nathlon.arena.match_policies import match_policies
from nathlon.arena.pool import Pool
from nathlon.arena.single_race import single_race
from nathlon.arena.watch import Watch
from nathlon.lab.events.race_folder import drive_race
from nathlon.policies.bundled import BUNDLED

CARS = 20
CIRCUIT, CAR = "lindenring", "gt3"


class Here(Pool):
    """Drives legs in this process, whose processor time can be told."""

    def drive_leg(self, match: Match, leg: Leg) -> LegDriven:
        """As of `Executor`."""
        return drive_leg(match, match_policies(match), leg, Watch())


def measure(hours: float) -> dict[str, Any]:
    """Figures of a race of so many hours."""
    files = sorted((BUNDLED / CIRCUIT).glob("*.safetensors"))[:CARS]
    entrants = [enter(str(file), CIRCUIT, CAR) for file in files]
    pool: Executor = Here(1)

    def drive(hours: float) -> Any:
        match = single_race(entrants, f"endurance:hours={hours:g}", 1)
        with TemporaryDirectory() as folder:
            return drive_race(pool, match, Path(folder))

    drive(1.0 / 60.0)
    wall_s, processor_s = time.perf_counter(), time.process_time()
    driven = drive(hours)
    wall_s, processor_s = time.perf_counter() - wall_s, time.process_time() - processor_s
    stops = driven.laps.group_by("car").agg(pl.col("stops").max())
    return {
        "cars": len(entrants),
        "hours": hours,
        "wall_s": round(wall_s, 1),
        "processor_s": round(processor_s, 1),
        "day_wall_s": round(24.0 / hours * wall_s),
        "day_processor_s": round(24.0 / hours * processor_s),
        "laps": int(driven.results["laps"].max()),
        "stops": int(stops["stops"].sum()),
        "left": driven.results.filter(ending="time_up").height,
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--hours", type=float, default=0.5)
    parser.add_argument("--json", type=Path)
    asked = parser.parse_args()
    figures = measure(asked.hours)
    if asked.json:
        write_result(asked.json, figures)
    print(json.dumps(figures))


if __name__ == "__main__":
    main()
