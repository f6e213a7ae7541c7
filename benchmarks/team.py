"""What a team's size costs: ten thousand checkpoints filtered and shown, and a night on a store of millions.

`python -m benchmarks.team [--checkpoints N] [--matches N] [--json PATH]`; the last line of the output is one
JSON object. Nothing is simulated: policies lap in a time that their names say. Its entries:

- `checkpoints`: of the filter and the report; `workers`: processes that ran it, of one each;
- `open_s`: to open them all; `filter_s`: from the first match to the front; `matches`, and `front` of them;
- `plan_s`: to say what such a selection will cost;
- `page_mb`, `report_open_s`: the page of a selection of as many, and how soon its first view stands;
- `rows`: of the large store; `night_s`: until a night on it knows what is new among as many files.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import time
from dataclasses import asdict
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from benchmarks import large_store, report
from benchmarks.laps import NAME, SLOWEST_S, world
from benchmarks.result import write_result
from nathlon.arena.entrance import enter_all
from nathlon.arena.pool import Pool
from nathlon.arena.queue_worker import work
from nathlon.arena.store import Store
from nathlon.selection.config import Config
from nathlon.selection.field import EntryList
from nathlon.selection.forecasting import forecast, habits_of
from nathlon.selection.nightly.night import NIGHT, nightly
from nathlon.selection.pareto.filter import run_filter
from nathlon.selection.single_run import single_run

WORKERS = 4
CHECKPOINTS, MATCHES = 10_000, 1_250_000
RUNS = 100
"""Training runs that they come from."""
PATIENCE_S = 600.0


def write_checkpoints(folder: Path, count: int) -> list[str]:
    """Files of a hundred training runs, of which each gets faster."""
    paths = []
    for number in range(count):
        step, run = divmod(number, RUNS)
        path = folder / f"run-{run:02d}" / f"step-{step:05d}.onnx"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(f"{SLOWEST_S - 10.0 * number / count + 1e-7 * number:.7f}")
        paths.append(str(path))
    return paths


def _help(target: str) -> None:
    with Store(target) as store, Pool(1) as pool:
        work(store, pool, [NAME], wait_s=PATIENCE_S)


def filtered(folder: Path, count: int) -> dict[str, Any]:
    """A filter of so many, by four processes that share its store."""
    sources, target = write_checkpoints(folder / "checkpoints", count), str(folder / "filter.sqlite")
    config = Config(world=NAME, workers=1).suited
    spawn = multiprocessing.get_context("spawn")
    with Pool(1) as pool:
        began = time.perf_counter()
        entrants = enter_all(pool, sources, "", "", NAME)
        opened_s = time.perf_counter() - began
        with Store(target):
            helpers = [spawn.Process(target=_help, args=(target,)) for _ in range(WORKERS - 1)]
        for helper in helpers:
            helper.start()
        try:
            with single_run("pareto", entrants, config, target, pool, lambda *_: None) as run:
                began = time.perf_counter()
                answer = run_filter(run, entrants, config.pareto)
                filter_s = time.perf_counter() - began
        finally:
            for helper in helpers:
                helper.terminate()
                helper.join()
    began = time.perf_counter()
    forecast(config, count, 0, 1, habits_of([], config), WORKERS)
    return {
        "checkpoints": count,
        "workers": WORKERS,
        "open_s": round(opened_s, 1),
        "filter_s": round(filter_s, 1),
        "matches": answer.results["match"].n_unique(),
        "front": len(answer.entrants),
        "plan_s": round(time.perf_counter() - began, 2),
    }


def night_begun(folder: Path, count: int, matches: int) -> dict[str, Any]:
    """A night on a store of so many matches that has judged all files of a folder: until it knows so."""
    target, files = str(folder / "large.sqlite"), folder / "watched"
    sources = write_checkpoints(files, count)
    large_store.fill(target, matches, 1)
    field = EntryList(tuple(world.enter(source) for source in sources))
    with Store(target) as store:
        store.begin_run(f"{NIGHT}0001", {"world": {}, "field": asdict(field)})
        store.end_run(f"{NIGHT}0001", "done")
    config = Config(world=NAME, checkpoints=(str(files),), store=target, out=str(folder / "nights"))
    began = time.perf_counter()
    night = nightly(config, 1, lambda *_: None)
    assert night.name is None, night.reason
    return {"rows": large_store.CARS * matches, "night_s": round(time.perf_counter() - began, 2)}


def measure(count: int, matches: int) -> dict[str, Any]:
    """All figures."""
    with TemporaryDirectory() as name:
        folder = Path(name)
        figures = filtered(folder, count) | night_begun(folder, count, matches)
    shown = report.measure(count, max(report.RACES, count))
    return figures | {"page_mb": shown["page_mb"], "report_open_s": shown["open_s"]}


def main() -> None:
    """Measure, and print the figures as JSON."""
    parser = argparse.ArgumentParser(prog="benchmarks.team", description="What a team's size costs")
    parser.add_argument("--checkpoints", type=int, default=CHECKPOINTS)
    parser.add_argument("--matches", type=int, default=MATCHES, help="of the large store, of eight rows each")
    parser.add_argument("--json", type=Path, nargs="?", help="file for the figures as well")
    asked = parser.parse_args()
    figures = measure(asked.checkpoints, asked.matches)
    if asked.json:
        write_result(asked.json, figures)
    print(json.dumps(figures))


if __name__ == "__main__":
    main()
