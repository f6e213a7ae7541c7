"""What the end of a night takes after many: the pool over all of them, in time and memory.

`python -m benchmarks.nights [--nights N] [--json PATH]` makes up N nights in which six newcomers meet the
best three of before and an anchor, everybody against everybody in twelve mirrored pairs of 4v4 races. All but
the last are added up as nights do it. The last is in a store, and a process of its own ranks the pool from
there.

Figures: `nights`, `entrants` that raced in all of them, `pool` of the last; `wall_s` of that process, its
`peak_mb` beyond the `before_mb` that the program takes by itself; `goal_s` and `goal_mb`. It ends with 1
where a goal is missed.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import time
from dataclasses import asdict
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from benchmarks.result import write_result
from nathlon.arena.classification import PLACE_POINTS
from nathlon.arena.entrant import Entrant
from nathlon.arena.results import RESULTS
from nathlon.arena.store import Finished, Store
from nathlon.selection.field import EntryList
from nathlon.selection.nightly.pool import KEPT, after, best_first, rank_nights
from nathlon.tournament.tallies import Tally

NIGHTS, GOAL_S, GOAL_MB = 1000, 5.0, 300
NEWCOMERS, INCUMBENTS, PAIRS, CARS = 6, 3, 12, 8
ANCHOR = "driver:pace=0.95"
WORLD = {"config": "0" * 64, "code": "0" * 64}


def round_robin(pace: dict[str, float], night: int, rng: np.random.Generator) -> pl.DataFrame:
    """RESULTS of a night: the order at the flag is pace, grid place and luck of the car."""
    two = np.array(list(combinations(sorted(pace), 2)))
    shape = (len(two), PAIRS, 2, CARS)
    match, pair, race, car = (index.ravel() for index in np.indices(shape))
    side = (car + race) % 2
    names = two[match, side]
    score = np.array([pace[name] for name in names]) - 0.25 * car + 1.5 * rng.standard_normal(car.size)
    place = 1 + np.argsort(np.argsort(-score.reshape(shape), axis=-1), axis=-1).ravel()
    keys = np.array([f"night {night}: {a} against {b}" for a, b in two])
    columns = {
        "match": keys[match],
        "race": 2 * pair + race,
        "mirrored": race == 1,
        "car": car,
        "slot": car + 1,
        "entrant": names,
        "team": side,
        "place": place,
        "points": np.array(PLACE_POINTS, np.float64)[place - 1],
        "contacts": rng.poisson(0.5, car.size),
    }
    plain = {"stage": "tournament", "test": "4v4", "ending": "finished", "distance_m": 11612.5}
    same = {"seed": night, "laps": 2, "contacts_at_fault": 0}
    frame = pl.DataFrame({name: values.tolist() for name, values in columns.items()})
    missing = [pl.lit((plain | same).get(name)).alias(name) for name in RESULTS if name not in columns]
    return frame.with_columns(missing).select(RESULTS.names()).cast(RESULTS)


def make_up(path: Path, nights: int) -> int:
    """Leave a store in which the last night is to be ranked; how many have raced."""
    rng, pace, tally = np.random.default_rng(1), {ANCHOR: 0.0}, Tally()
    best: list[str] = []
    with Store(path) as store:
        for night in range(1, nights + 1):
            new = {f"{night:05d}-{letter}".rjust(64, "0"): float(rng.normal()) for letter in "abcdef"}
            pace |= new
            field = {name: pace[name] for name in (ANCHOR, *new, *best[:INCUMBENTS])}
            name = f"night-{night:04d}"
            store.begin_run(name, {"world": WORLD, "field": asdict(_field(field))})
            results = round_robin(field, night, rng)
            if night == nights:
                matches = results.partition_by("match", as_dict=True)
                store.add_matches([Finished(key, "tournament", {}, rows) for (key,), rows in matches.items()])
                store.use(name, [key for (key,) in matches])
                break
            ranking, tally = after(tally, results, {ANCHOR}, KEPT, night)
            best = [name for name in best_first(ranking) if name != ANCHOR]
            store.end_run(name, "done")
            if night == nights - 1:
                store.put_table(name, "pool", ranking)
                store.put_table(name, "pool_cells", tally.cells)
                store.put_table(name, "pool_totals", tally.totals)
    return len(pace)


def _field(names: dict[str, float]) -> EntryList:
    entrants = [
        Entrant(name, name, f"{name}.safetensors", "QR-SAC", "lindenring", "gt3", 1, 1) for name in names
    ]
    return EntryList(tuple(one for one in entrants if one.id != ANCHOR), anchors=(entrants[0],))


def rank_last(path: Path) -> dict[str, Any]:
    """What it takes in this process to rank the pool after the last night."""
    before = _peak_mb()
    began = time.perf_counter()
    with Store.open(path) as store:
        nights = store.runs()
        made = rank_nights(store, nights, nights[-1], INCUMBENTS)
        for name, table in made.items():
            store.put_table(nights[-1].name, name, table)
    took = time.perf_counter() - began
    peak = _peak_mb() - before
    return {"pool": made["pool"].height, "wall_s": round(took, 2), "peak_mb": peak, "before_mb": before}


def _peak_mb() -> int:
    """The most memory that this program has taken; what `getrusage` says, its parent has had as well."""
    lines = Path("/proc/self/status").read_text("utf-8").splitlines()
    return int(next(line.split()[1] for line in lines if line.startswith("VmHWM"))) // 1000


def main() -> None:
    """Make nights up, rank the last, print and keep the figures."""
    parser = argparse.ArgumentParser(prog="benchmarks.nights", description="The end of a night after many")
    parser.add_argument("--nights", type=int, default=NIGHTS)
    parser.add_argument("--store", type=Path, help="rank the last night of this store, and nothing else")
    parser.add_argument("--json", type=Path, help="where to write the figures")
    asked = parser.parse_args()
    if asked.store:
        print(json.dumps(rank_last(asked.store)))
        return
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "nathlon.sqlite"
        entrants = make_up(path, asked.nights)
        command = [sys.executable, "-m", "benchmarks.nights", "--store", str(path)]
        told = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
    figures = {"nights": asked.nights, "entrants": entrants, **told, "goal_s": GOAL_S, "goal_mb": GOAL_MB}
    print(json.dumps(figures))
    if asked.json:
        write_result(asked.json, figures)
    if told["wall_s"] > GOAL_S or told["peak_mb"] > GOAL_MB:
        raise SystemExit(1)


if __name__ == "__main__":
    main()
