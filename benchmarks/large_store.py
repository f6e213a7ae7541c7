"""What a store of many rows takes to answer: to open, to begin a night, to claim, to store, to report.

`python -m benchmarks.large_store STORE [--matches N] [--queued N] [--json PATH]` fills a new store, a SQLite
file or an empty PostgreSQL database, with copies of one match of eight cars under keys of their own and as
many others that wait in the queue, unless it has them; then it measures.

Figures: `store`, `matches`, `rows` and `queued` in it; `bytes` that the database takes; and seconds, each
the median of some tries: `open_s`; `look_up_s`, for which of 10,000 matches are there; `waiting_s`, to see
what waits; `take_s`, to take 64 matches from the queue; `add_s`, to store 20; `report_s`, to read all results
of a run of 2,000 matches.
"""

from __future__ import annotations

import argparse
import hashlib
import statistics
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import polars as pl
import sqlalchemy as sa

from benchmarks.result import write_result
from nathlon.arena.results import RESULTS
from nathlon.arena.store import Finished, Store
from nathlon.arena.store.database import POSTGRESQL
from nathlon.arena.store.queue import Queued

CARS, TRIES = 8, 5
LOOKED_UP, TAKEN, ADDED, REPORTED = 10_000, 64, 20, 2_000
SPEC = {"stage": "pareto", "test": "race", "entrants": ["0" * 64] * 2, "races": [[1, [[0, 0]] * CARS]]}
QUEUES = 4
"""Surroundings of those that wait."""
TEMPLATE = hashlib.sha256(b"template").hexdigest()


def key(number: int) -> str:
    """Of a match."""
    return hashlib.sha256(str(number).encode()).hexdigest()


def finished(name: str) -> Finished:
    """A match of eight cars."""
    row = {"match": name, "stage": "pareto", "test": "race", "race": 0, "seed": 1, "mirrored": False}
    drove = {"entrant": "0" * 64, "team": 0, "laps": 2, "ending": "finished", "points": 0.0}
    times = {"race_time_s": 201.25, "driven_s": 201.25, "distance_m": 11612.5, "best_lap_s": 99.125}
    cars = [
        dict.fromkeys(RESULTS) | row | drove | times | {"car": car, "slot": car, "place": car + 1}
        for car in range(CARS)
    ]
    return Finished(name, "pareto", SPEC, pl.DataFrame(cars, schema=RESULTS), "any")


def fill(target: str, matches: int, queued: int) -> None:
    """Fill a new store, by the database's own means: one by one would take hours."""
    with Store(target) as store:
        store.add_matches([finished(TEMPLATE)])
        store.enqueue(
            [Queued(TEMPLATE[::-1], str(number), SPEC, ["a", "b"]) for number in range(1)],
            {str(number): {"number": number} for number in range(QUEUES)},
        )
    engine = sa.create_engine(_url(target))
    hashed = "encode(sha256({}::text::bytea), 'hex')"
    numbers = "generate_series({}, {}) AS number"
    with engine.begin() as connection:
        if engine.dialect.name == "sqlite":
            driver: Any = connection.connection.driver_connection
            driver.create_function("hashed", 1, key, deterministic=True)
            hashed = "hashed({})"
            numbers = (
                "(WITH RECURSIVE n(number) AS (SELECT {} UNION ALL SELECT number + 1 FROM n"
                " WHERE number < {}) SELECT number FROM n)"
            )
        others = ", ".join(name for name in RESULTS if name != "match")
        its = ", ".join(f'r."{name}"' for name in RESULTS if name != "match")
        for statement in (
            "INSERT INTO match SELECT " + hashed.format("number") + ", stage, spec, rows, digest, processor"
            f" FROM match, {numbers.format(1, matches)} WHERE key = '{TEMPLATE}' ORDER BY 1",
            f"INSERT INTO result (match, {others}) SELECT match.key, {its} FROM match, result r"
            f" WHERE r.match = '{TEMPLATE}' AND match.key <> '{TEMPLATE}' ORDER BY match.key",
            "INSERT INTO queue (match, surroundings, spec, sources) SELECT "
            + hashed.format("number")
            + f", CAST(number - {QUEUES} * (number / {QUEUES}) AS TEXT), spec, sources"
            f" FROM queue, {numbers.format(matches + 1, matches + queued)}",
        ):
            connection.exec_driver_sql(statement)
    with engine.connect().execution_options(isolation_level="AUTOCOMMIT") as connection:
        connection.exec_driver_sql("ANALYZE")
    engine.dispose()


def _url(target: str) -> sa.URL:
    if "://" in target:
        return sa.make_url(target).set(drivername=POSTGRESQL)
    return sa.URL.create("sqlite", database=target)


def median_s(function: Callable[[int], object]) -> float:
    """Of some tries, each told its number."""
    took = []
    for number in range(TRIES):
        began = time.perf_counter()
        function(number)
        took.append(time.perf_counter() - began)
    return round(statistics.median(took), 4)


def size(target: str) -> int:
    """Bytes of the database."""
    if "://" not in target:
        return Path(target).stat().st_size
    engine = sa.create_engine(_url(target))
    with engine.connect() as connection:
        found: int = connection.exec_driver_sql("SELECT pg_database_size(current_database())").scalar_one()
    engine.dispose()
    return found


def measure(target: str, matches: int, queued: int) -> dict[str, Any]:
    """The figures of a store that is filled."""
    unique = f"{time.time_ns()}"
    looked_up = [key(number * matches // LOOKED_UP + 1) for number in range(LOOKED_UP)]
    with Store.open(target) as store:
        run = f"run {unique}"
        store.begin_run(run, {})
        store.use(run, looked_up[:REPORTED])

        def add(number: int) -> None:
            store.add_matches([finished(key(hash((unique, number, each)))) for each in range(ADDED)])

        figures = {
            "store": "PostgreSQL" if "://" in target else "SQLite",
            "matches": matches,
            "rows": CARS * matches,
            "queued": queued,
            "bytes": size(target),
            "open_s": median_s(lambda _: Store.open(target).close()),
            "look_up_s": median_s(lambda _: store.stored(looked_up)),
            "waiting_s": median_s(lambda _: store.waiting()),
            "take_s": median_s(lambda number: store.take(str(number % QUEUES), unique, TAKEN, 60.0)),
            "add_s": median_s(add),
            "report_s": median_s(lambda _: store.results_of_run(run)),
        }
        store.release(unique)
    return figures


def main() -> None:
    """Fill, measure, print, and keep the figures."""
    parser = argparse.ArgumentParser(prog="benchmarks.large_store", description="A store of many rows")
    parser.add_argument("stores", nargs="+", help="paths of new files, or URLs of empty databases")
    parser.add_argument("--matches", type=int, default=1_250_000)
    parser.add_argument("--queued", type=int, default=1_000_000)
    parser.add_argument("--json", type=Path, help="where to write the figures")
    asked = parser.parse_args()
    figures = []
    for target in asked.stores:
        with Store(target) as store:
            filled = store.has(key(1))
        if not filled:
            fill(target, asked.matches, asked.queued)
        figures.append(measure(target, asked.matches, asked.queued))
        print(figures[-1], file=sys.stderr)
    if asked.json:
        write_result(asked.json, figures)


if __name__ == "__main__":
    main()
