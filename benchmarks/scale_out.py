"""What it costs to share matches among processes by the queue of a store, or by a Ray cluster.

`python -m benchmarks.scale_out [--database URL [--alone]] [--matches N ...] [--workers N ...]
[--engines NAME ...] [--nap S] [--busy] [--json PATH]` has matches of a world run that sleeps for 10 ms a
match, or for `S` seconds, or computes for as long (`--busy`): by the processes of one pool (`local`), by
workers of one process each that share nothing but the store (`queue`), and by nodes of one processor each of
a cluster on this machine (`ray`). Who sleeps needs no core: with more than there are cores, what is left is
what claims and the store cost. Time counts from when all are ready.

Figures: for every run `engine`, `store`, `workers`, `matches`, `nap_s` that one takes, `wall_s`; `each`,
the matches that each process ran, the fewest first; `speed_up`, over the first run of
the engine on the store; `efficiency`, the share of the
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
from itertools import cycle, product
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import polars as pl

from benchmarks.result import write_result
from nathlon.arena.engine import MatchEngine
from nathlon.arena.entrant import Entrant
from nathlon.arena.match import Match, Race, Seat
from nathlon.arena.pool import Pool
from nathlon.arena.queue import post
from nathlon.arena.queue_engine import QueueEngine
from nathlon.arena.queue_worker import work
from nathlon.arena.results import RESULTS
from nathlon.arena.store import Store
from nathlon.arena.watch import Watch
from nathlon.arena.world import LineUp, Measure, Setup

NAP_S = 0.01
"""That a match takes, unless it is told."""
WARM_S = 2.0
"""For which each worker works before time counts."""
WARM_SEEDS = 10**9
"""From which the seeds of those matches go up."""
PATIENCE_S = 600.0
"""For which a worker waits for others to start."""
NAME, BUSY = "benchmarks.scale_out:sleeper", "benchmarks.scale_out:computer"
NOTES = "NATHLON_SCALE_OUT_NOTES"
"""Names the folder where processes note which matches they have run."""
NAP = "NATHLON_SCALE_OUT_NAP_S"
"""Tells processes what a match takes."""
LOOK_S = 0.05
OBJECTS_BYTES = 100 << 20
"""Of memory for a node's objects: Ray takes a third of the machine's otherwise."""


class Sleeper:
    """A world in which nothing happens, for as long as a match takes."""

    scenarios: tuple[str, ...] = ("nap",)
    measures: Mapping[str, Measure] = {}
    baseline = "random"

    def __init__(self, busy: bool) -> None:
        """A world; if it is `busy` it computes meanwhile."""
        self._busy, self.name = busy, BUSY if busy else NAME
        self._nap_s = float(os.environ[NAP])

    def setup(self, scenario: str) -> Setup:
        return Setup(("bed",), ((0,),), time_s=1.0)

    def check(self, scenario: str) -> None:
        """All is well."""

    def facts(self, scenario: str) -> dict[str, Any]:
        return {"nap_s": self._nap_s}

    def enter(self, source: str) -> Entrant:
        return Entrant(source, source, source, "none", "", "", None, None, self.name)

    def policy(self, source: str) -> Any:
        return source

    def run(self, line_ups: Mapping[int, LineUp], watch: Watch) -> Iterator[tuple[int, pl.DataFrame]]:
        with (Path(os.environ[NOTES]) / str(os.getpid())).open("a") as notes:
            for number, (match, _) in line_ups.items():
                watch.work()
                self._pass()
                row = {"place": 1, "points": 0.0, "ending": "finished", "score": 0.0}
                notes.write(f"{match.key}\n")
                yield number, pl.DataFrame([match.seat_facts(0, 0) | row], schema=RESULTS)

    def _pass(self) -> None:
        if not self._busy:
            time.sleep(self._nap_s)
            return
        until = time.process_time() + self._nap_s
        while time.process_time() < until:
            pass


def sleeper() -> Sleeper:
    """The world."""
    return Sleeper(busy=False)


def computer() -> Sleeper:
    """The busy world."""
    return Sleeper(busy=True)


def naps(count: int, first: int, world: str = NAME) -> list[Match]:
    """Matches with seeds of their own."""
    return [
        Match(
            "pareto", "nap", "nap", "", "", ("random",), ("random",),
            (Race(first + number, (Seat(0, 0),)),), world,
        )
        for number in range(count)
    ]  # fmt: skip


def _warming(workers: int, world: str) -> list[Match]:
    return naps(round(WARM_S / float(os.environ[NAP])) * workers, WARM_SEEDS, world)


def local(target: str, workers: int, matches: Sequence[Match]) -> float:
    """Seconds that the processes of a pool take."""
    with Store(target) as store, Pool(workers) as pool:
        engine: MatchEngine = QueueEngine(store, pool)
        return _warm_seconds(engine, workers, matches)


def _warm_seconds(engine: MatchEngine, workers: int, matches: Sequence[Match]) -> float:
    list(engine.run(_warming(workers, matches[0].world)))
    began = time.perf_counter()
    list(engine.run(matches))
    return time.perf_counter() - began


def ray(target: str, workers: int, matches: Sequence[Match]) -> float:
    """Seconds that nodes of one processor each take, on this machine."""
    from ray.cluster_utils import Cluster

    from nathlon.arena.on_ray.cluster import joined
    from nathlon.arena.on_ray.engine import RayEngine
    from nathlon.arena.on_ray.nodes import Nodes

    head = {"num_cpus": 0, "include_dashboard": False, "object_store_memory": OBJECTS_BYTES}
    cluster = Cluster(initialize_head=True, head_node_args=head)
    try:
        for _ in range(workers):
            cluster.add_node(num_cpus=1, object_store_memory=OBJECTS_BYTES)
        with (
            Store(target) as store,
            Pool(1) as pool,
            joined(cluster.address),
            Nodes(pool.log) as nodes,
        ):
            return _warm_seconds(RayEngine(store, pool, nodes), workers, matches)
    finally:
        cluster.shutdown()


def _help(target: str) -> None:
    with Store(target) as store, Pool(1) as pool:
        work(store, pool, [NAME, BUSY], wait_s=PATIENCE_S)


def queue(target: str, workers: int, matches: Sequence[Match]) -> float:
    """Seconds that workers take which have nothing in common but the store."""
    with Store(target) as store:
        spawn = multiprocessing.get_context("spawn")
        helpers = [spawn.Process(target=_help, args=(target,)) for _ in range(workers)]
        for helper in helpers:
            helper.start()
        post(store, _warming(workers, matches[0].world))
        while len(store.at_work()) < workers or store.waiting():
            time.sleep(LOOK_S)
        began = time.perf_counter()
        post(store, matches)
        while store.waiting():
            time.sleep(LOOK_S)
        wall_s = time.perf_counter() - began
        for helper in helpers:
            helper.terminate()
            helper.join()
    return wall_s


ENGINES = {"local": local, "queue": queue, "ray": ray}


def measure(engine: str, target: str, workers: int, matches: Sequence[Match]) -> dict[str, Any]:
    """The figures of a run."""
    keys = {match.key for match in matches}
    wall_s = ENGINES[engine](target, workers, matches)
    notes = Path(os.environ[NOTES])
    noted = [[key for key in file.read_text().split() if key in keys] for file in notes.iterdir()]
    ran = Counter(key for some in noted for key in some)
    nap_s = float(os.environ[NAP])
    with Store.open(target) as store:
        lost = len(keys - store.stored(keys))
    busy = workers * wall_s / len(matches)
    return {
        "engine": engine,
        "store": "PostgreSQL" if "://" in target else "SQLite",
        "workers": workers,
        "matches": len(matches),
        "nap_s": nap_s,
        "wall_s": round(wall_s, 2),
        "each": sorted(len(some) for some in noted if some),
        "efficiency": round(nap_s / busy, 3),
        "overhead_s_per_match": round(busy - nap_s, 5),
        "lost": lost,
        "twice": sum(times > 1 for times in ran.values()),
    }


def _alike(one: Mapping[str, Any], other: Mapping[str, Any]) -> bool:
    return all(one[name] == other[name] for name in ("engine", "store"))


def main() -> None:
    """Measure, print, and keep the figures."""
    parser = argparse.ArgumentParser(prog="benchmarks.scale_out", description="Workers on one store")
    parser.add_argument("--database", help="URL of an empty one, measured beside a new SQLite file")
    parser.add_argument("--alone", action="store_true", help="measure the database without the file")
    parser.add_argument("--matches", type=int, nargs="+", default=[10_000], help="of each number of workers")
    parser.add_argument("--workers", type=int, nargs="+", default=[1, 2, 8])
    parser.add_argument("--engines", nargs="+", choices=ENGINES, default=["local", "queue"])
    parser.add_argument("--nap", type=float, default=NAP_S, help="seconds that a match takes")
    parser.add_argument("--busy", action="store_true", help="compute instead of sleeping")
    parser.add_argument("--json", type=Path, help="where to write the figures")
    asked = parser.parse_args()
    figures: list[dict[str, Any]] = []
    world = BUSY if asked.busy else NAME
    with TemporaryDirectory() as folder, TemporaryDirectory() as notes:
        os.environ[NOTES], os.environ[NAP] = notes, str(asked.nap)
        stores = [asked.database] if asked.alone else [None, asked.database]
        counted = list(zip(asked.workers, cycle(asked.matches), strict=False))
        for number, (database, engine, (workers, count)) in enumerate(
            product(dict.fromkeys(stores), asked.engines, counted)
        ):
            target = database or f"{folder}/{number}.sqlite"
            matches = naps(count, number * max(asked.matches), world)
            figure = measure(engine, target, workers, matches)
            alone = next((one for one in figures if _alike(one, figure)), figure)
            figures.append(figure | {"speed_up": round(alone["wall_s"] / figure["wall_s"], 2)})
            print(figures[-1], file=sys.stderr)
    if asked.json:
        write_result(asked.json, figures)


if __name__ == "__main__":
    main()
