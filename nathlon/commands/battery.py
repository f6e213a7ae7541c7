"""`nathlon battery`: the n-athlon alone."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import polars as pl
from rich.table import Table

from arena.entrant import enter_all, find_checkpoints, trained_on
from arena.pool import Pool
from arena.store import Store
from nathlon.commands.console import console, say, worker_count
from nathlon.commands.selection import progress
from nathlon.config import Config
from nathlon.n_athlon import BatteryAnswer, run_battery
from nathlon.run import Run


def battery(sources: Sequence[str], out: Path, config: Config, as_json: bool) -> None:
    """Put entrants through the n-athlon and print who has how many points."""
    paths = [str(path) for path in find_checkpoints(map(Path, sources))]
    entrants = enter_all(paths, *trained_on(paths))
    ids = [entrant.id for entrant in entrants]
    name = "battery-" + hashlib.sha256("\n".join([config.digest, *ids]).encode()).hexdigest()[:12]
    path = out / "store.sqlite"
    with (
        progress(f"The same command goes on from {path}.", as_json, ("battery",)) as on_match,
        Store(path) as store,
        Pool(worker_count(config.workers)) as pool,
    ):
        store.begin_run(name, {"entrants": ids})
        run = Run(store, name, (config.seed,), pool, on_match)
        answer = run_battery(run, entrants, config.battery)
        for table, frame in answer.tables.items():
            store.put_table(name, table, frame)
        store.end_run(name, "done")
    names = {entrant.id: entrant.name for entrant in entrants}
    if as_json:
        print(json.dumps(_as_json(answer, names), indent=1))
    else:
        _print(answer, names)


def _named(table: pl.DataFrame, names: dict[str, str]) -> list[dict[str, Any]]:
    return [{"name": names[row["entrant"]], **row} for row in table.iter_rows(named=True)]


def _as_json(answer: BatteryAnswer, names: dict[str, str]) -> dict[str, Any]:
    return {
        "battery": _named(answer.tables["battery"], names),
        "skills": _named(answer.tables["skills"], names),
        "marks": {test: asdict(marks) for test, marks in answer.marks.items()},
        "set_aside": answer.set_aside,
    }


def _print(answer: BatteryAnswer, names: dict[str, str]) -> None:
    ranking = Table(title="N-athlon with 95 % intervals")
    for column in ("Rank", "Entrant", "Points"):
        ranking.add_column(column, justify="right" if column in ("Rank", "Points") else "left")
    for row in _named(answer.tables["battery"], names):
        points = f"{row['points']:.0f}"
        if row["points_low"] is not None:
            points += f" ({row['points_low']:.0f} to {row['points_high']:.0f})"
        ranking.add_row(str(row["rank"]), row["name"], points)
    console.print(ranking)

    tests = Table(title="Tests")
    for column in ("Test", "500 points", "1,000 points", "Best", "Mean", "Points"):
        tests.add_column(column, justify="left" if column in ("Test", "Best") else "right")
    rows = _named(answer.tables["skills"], names)
    for test, marks in answer.marks.items():
        best = max((row for row in rows if row["test"] == test), key=lambda row: row["points"])
        mean = "–" if best["measure"] is None else f"{best['measure']:.2f}"
        worth = [f"{mark:.2f} {best['unit']}" for mark in (marks.base, marks.reference)]
        tests.add_row(test, *worth, best["name"], mean, f"{best['points']:.0f}")
    console.print(tests)
    for test, reason in answer.set_aside.items():
        say(f"Set aside: {test}: {reason}")
