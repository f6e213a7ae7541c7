"""What it costs to share matches among processes by the queue of a store.

`python -m benchmarks.scale_out [--database URL] [--matches N] [--workers N ...] [--json PATH]` has matches of
a world run that sleeps for 10 ms a match: by the processes of one pool (`local`), and by workers of one
process each that share nothing but the store (`queue`). Who sleeps needs no core: with more than there are
cores, what is left is what claims and the store cost. Time counts from when all are ready.

Figures: for every run `engine`, `store`, `workers`, `matches`, `wall_s`; `efficiency`, the share of the
workers' time in which they ran matches; `overhead_s_per_match`, the rest of it; `lost`, matches that have no
result; `twice`, matches that were run more than once.
"""

from __future__ import annotations

import argparse
import multiprocessing
import os
import sys
import time
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from itertools import product
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import polars as pl

from benchmarks.result import write_result
from nathlon.arena.engine import Engine
from nathlon.arena.entrant import Entrant
from nathlon.arena.match import Match, Race, Seat
from nathlon.arena.pool import Pool
from nathlon.arena.queue import post
from nathlon.arena.queue_engine import QueueEngine
from nathlon.arena.queue_worker import work
from nathlon.arena.results import RESULTS
from nathlon.arena.store import Store
from nathlon.arena.watch import Watch
from nathlon.arena.worlds.contract import LineUp, Measure, Setup

NAP_S = 0.01
"""That a match takes."""
NAME = "benchmarks.scale_out:sleeper"
NOTES = "NATHLON_SCALE_OUT_NOTES"
"""Names the folder where processes note which matches they have run."""
LOOK_S = 0.05


class Sleeper:
    """A world in which nothing happens, for as long as a match takes."""

    name = NAME
    scenarios: tuple[str, ...] = ("nap",)
    measures: Mapping[str, Measure] = {}
    baseline = "random"

    def setup(self, scenario: str) -> Setup:
        return Setup(("bed",), ((0,),), time_s=1.0)

    def check(self, scenario: str) -> None:
        """All is well."""

    def facts(self, scenario: str) -> dict[str, Any]:
        return {"nap_s": NAP_S}

    def enter(self, source: str) -> Entrant:
        return Entrant(source, source, source, "none", "", "", None, None, NAME)

    def policy(self, source: str) -> Any:
        return source

    def run(self, line_ups: Mapping[int, LineUp], watch: Watch) -> Iterator[tuple[int, pl.DataFrame]]:
        with (Path(os.environ[NOTES]) / str(os.getpid())).open("a") as notes:
            for number, (match, _) in line_ups.items():
                watch.work()
                time.sleep(NAP_S)
                row = {"place": 1, "points": 0.0, "ending": "finished", "score": 0.0}
                notes.write(f"{match.key}\n")
                yield number, pl.DataFrame([match.seat_facts(0, 0) | row], schema=RESULTS)


def sleeper() -> Sleeper:
    """The world."""
    return Sleeper()


def naps(count: int, first: int) -> list[Match]:
    """Matches with seeds of their own."""
    return [
        Match(
            "pareto", "nap", "nap", "", "", ("random",), ("random",),
            (Race(first + number, (Seat(0, 0),)),), NAME,
        )
        for number in range(count)
    ]  # fmt: skip


def local(target: str, workers: int, matches: Sequence[Match]) -> float:
    """Seconds that the processes of a pool take."""
    with Store(target) as store, Pool(workers) as pool:
        engine: Engine = QueueEngine(store, pool)
        list(engine.run(naps(4 * workers, -4 * workers)))
        began = time.perf_counter()
        list(engine.run(matches))
        return time.perf_counter() - began


def _help(target: str) -> None:
    with Store(target) as store, Pool(1) as pool:
        work(store, pool, [NAME], wait_s=5.0)


def queue(target: str, workers: int, matches: Sequence[Match]) -> float:
    """Seconds that workers take which have nothing in common but the store."""
    with Store(target) as store:
        spawn = multiprocessing.get_context("spawn")
        helpers = [spawn.Process(target=_help, args=(target,)) for _ in range(workers)]
        for helper in helpers:
            helper.start()
        warm = naps(200 * workers, -200 * workers)
        post(store, warm)
        while len(store.at_work()) < workers or store.waiting():
            time.sleep(LOOK_S)
        began = time.perf_counter()
        post(store, matches)
        while store.waiting():
            time.sleep(LOOK_S)
        wall_s = time.perf_counter() - began
        for helper in helpers:
            helper.join()
    return wall_s


ENGINES = {"local": local, "queue": queue}


def measure(engine: str, target: str, workers: int, matches: Sequence[Match]) -> dict[str, Any]:
    """The figures of a run."""
    keys = {match.key for match in matches}
    wall_s = ENGINES[engine](target, workers, matches)
    notes = Path(os.environ[NOTES])
    noted = [key for file in notes.iterdir() for key in file.read_text().split()]
    ran = Counter(key for key in noted if key in keys)
    with Store.open(target) as store:
        lost = len(keys - store.stored(keys))
    busy = workers * wall_s / len(matches)
    return {
        "engine": engine,
        "store": "PostgreSQL" if "://" in target else "SQLite",
        "workers": workers,
        "matches": len(matches),
        "wall_s": round(wall_s, 2),
        "efficiency": round(NAP_S / busy, 3),
        "overhead_s_per_match": round(busy - NAP_S, 5),
        "lost": lost,
        "twice": sum(times > 1 for times in ran.values()),
    }


def main() -> None:
    """Measure, print, and keep the figures."""
    parser = argparse.ArgumentParser(prog="benchmarks.scale_out", description="Workers on one store")
    parser.add_argument("--database", help="URL of an empty one, measured beside a new SQLite file")
    parser.add_argument("--matches", type=int, default=10_000)
    parser.add_argument("--workers", type=int, nargs="+", default=[1, 2, 8])
    parser.add_argument("--engines", nargs="+", choices=ENGINES, default=list(ENGINES))
    parser.add_argument("--json", type=Path, help="where to write the figures")
    asked = parser.parse_args()
    figures = []
    with TemporaryDirectory() as folder, TemporaryDirectory() as notes:
        os.environ[NOTES] = notes
        for number, (database, engine, workers) in enumerate(
            product(dict.fromkeys([None, asked.database]), asked.engines, asked.workers)
        ):
            target = database or f"{folder}/{number}.sqlite"
            figures.append(measure(engine, target, workers, naps(asked.matches, number * asked.matches)))
            print(figures[-1], file=sys.stderr)
    if asked.json:
        write_result(asked.json, figures)


if __name__ == "__main__":
    main()
