"""How good the bundled checkpoints are: laps alone, and races among eight cars.

`.venv/bin/python -m benchmarks.bundled` prints one JSON object as its last line.
"""

from __future__ import annotations

import json

import numpy as np
import polars as pl
from rich.progress import track

from arena.entrant import Entrant, enter, enter_all
from arena.match import Match, Race, Seat
from arena.pool import match_policies
from arena.runner import run_match
from nathlon.stages import filter_matches
from policies.bundled import BUNDLED

LAPS = 8
SEED = 2024


def time_trial(entrant: Entrant) -> Match:
    """One flying lap alone from each of `LAPS` starts."""
    races = tuple(Race(SEED + k, (Seat(0),)) for k in range(LAPS))
    circuit, car = entrant.circuit, entrant.car
    return Match("race", "time_trial", "time_trial", circuit, car, (entrant.id,), (entrant.source,), races)


def alone(entrant: Entrant) -> dict[str, float | None]:
    """Mean lap time (None unless all laps were completed) and share of time off course."""
    match = time_trial(entrant)
    results = run_match(match, match_policies(match))
    laps = results["best_lap_s"]
    return {
        "lap_s": None if laps.null_count() else round(float(laps.to_numpy().mean()), 3),
        "best_lap_s": None
        if laps.null_count() == LAPS
        else round(float(laps.drop_nulls().to_numpy().min()), 3),
        "off_course_share": round(float(results["off_course_s"].sum()) / float(results["driven_s"].sum()), 5),
    }


def among_eight(entrant: Entrant) -> dict[str, float]:
    """From the back of the grid: races finished, mean place, contacts a kilometre."""
    [match] = filter_matches([entrant], np.random.SeedSequence(SEED))
    rows = run_match(match, match_policies(match)).filter(pl.col("entrant") == entrant.id)
    return {
        "races": rows.height,
        "finished": rows.filter(pl.col("ending") == "finished").height,
        "mean_place": float(rows["place"].to_numpy().mean()),
        "contacts_per_km": round(1000 * int(rows["contacts"].sum()) / float(rows["distance_m"].sum()), 3),
    }


def main() -> None:
    """Measure every bundled checkpoint and the built-in driver."""
    driver = alone(enter("driver", "lindenring", "gt3"))
    paths = sorted(str(path) for path in BUNDLED.glob("*.safetensors"))
    checkpoints = {}
    for entrant in track(enter_all(paths, "lindenring", "gt3"), description="checkpoints"):
        measured = {**alone(entrant), **among_eight(entrant)}
        lap = measured["lap_s"]
        measured["driver_ratio"] = None if lap is None else round(lap / float(driver["lap_s"] or np.nan), 4)
        checkpoints[entrant.name] = measured
    print(json.dumps({"driver": driver, "checkpoints": checkpoints}))


if __name__ == "__main__":
    main()
