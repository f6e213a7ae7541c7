"""How large the report of a large night is, and how soon its page is there.

Run as `python -m benchmarks.report [--json FILE]`; the last line of the output is one JSON object. The night
is made up: 2,000 checkpoints, of which 60 come to the n-athlon and 13 to 5,000 races of eight cars in all.
Its entries:

- `size_mb`: of the report's folder; `page_mb` of its page alone;
- `write_s`: to write all of it;
- `open_s`: from the start of the navigation until the first view stands, the median of several in Chromium;
- `leaderboard_s`, `checkpoint_s`, `pareto_s`: from the change of the address until that view stands;
- `chromium`: its version.
"""

from __future__ import annotations

import argparse
import json
import shutil
import statistics
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
from playwright.sync_api import Page, sync_playwright

from benchmarks.result import write_result
from nathlon.arena.results import RESULTS, TABLES
from nathlon.reports.page import write_page
from nathlon.reports.spreadsheet import write_spreadsheet
from nathlon.reports.tables import write_tables
from nathlon.results.selection import Selection
from nathlon.results.summary import Summary

CHECKPOINTS, SURVIVORS, FINALISTS, RACES, CARS = 2000, 60, 13, 5000, 8
TESTS = 14
OPENED = 5
FRAME = "new Promise(resolve => requestAnimationFrame(() => setTimeout(resolve)))"


def _table(table: str, rng: np.random.Generator, entrants: list[str], **columns: Any) -> pl.DataFrame:
    """Random rows of a stage table, one for each of the entrants, but for the columns given."""
    count = len(entrants)
    made: dict[str, Any] = {"entrant": entrants}
    for column, kind in TABLES[table].items():
        if column not in made:
            made[column] = _values(rng, kind, count)
    return pl.DataFrame(made | columns, schema=TABLES[table])


def _values(rng: np.random.Generator, kind: Any, count: int) -> Any:
    if kind == pl.Float64:
        return rng.gamma(2.0, 10.0, count)
    if kind == pl.Int64:
        return rng.integers(1, 9, count)
    if kind == pl.Boolean:
        return rng.random(count) < 0.1
    return ["abc"] * count


def night(rng: np.random.Generator, checkpoints: int = CHECKPOINTS, races: int = RACES) -> Selection:
    """A made-up night of so many checkpoints, and races in all."""
    ids = [rng.bytes(32).hex() for _ in range(checkpoints)]
    tested, final = ids[:SURVIVORS], ids[:FINALISTS]
    pairs = [(a, b) for a in final for b in final if a != b]
    objectives = [f"objective_{index}" for index in range(3)]
    tests = [f"test_{index:02d}" for index in range(TESTS)]
    tables = {name: pl.DataFrame(schema=schema) for name, schema in TABLES.items()} | {
        "entrants": _table(
            "entrants",
            rng,
            ids,
            name=[f"run-s{index % 7}-{index:05d}k" for index in range(checkpoints)],
            source=[f"checkpoints/run-s{index % 7}-{index:05d}k.safetensors" for index in range(checkpoints)],
        ),
        "pareto": _table("pareto", rng, ids, survives=[index < SURVIVORS for index in range(checkpoints)]),
        "objectives": _table("objectives", rng, ids * 3, objective=np.repeat(objectives, checkpoints)),
        "skills": _table("skills", rng, tested * TESTS, test=np.repeat(tests, SURVIVORS)),
        "battery": _table("battery", rng, tested),
        "ranking": _table("ranking", rng, final),
        "pool": _table("pool", rng, final),
        "matchups": _table("matchups", rng, [a for a, _ in pairs], opponent=[b for _, b in pairs]),
        "ratings": _table("ratings", rng, final),
    }
    summary: dict[str, Any] = {
        "stages": [{"name": "pareto", "in": checkpoints, "out": SURVIVORS, "races": races, "wall_s": 900.0}],
        "sent": [],
        "committee": [],
        "circuit": "lindenring",
        "car": "gt3",
        "seed": 1,
        "versions": {},
        "marks": {},
        "tests_set_aside": {},
        "excluded": [],
        "pair_correlation": -0.1,
        "confidence": 0.95,
        "car_runs": races * CARS,
        "faults": 0,
        "void": 0,
        "replays": [],
    }
    facts = Summary.model_validate(summary | {"ranking": []})
    return Selection("A large night", tables, _results(rng, ids, final, races), facts, "nathlon.sqlite")


def _results(rng: np.random.Generator, ids: list[str], final: list[str], races: int) -> pl.DataFrame:
    """One race of the filter for every checkpoint, against a built-in driver, and then team races."""
    rows = races * CARS
    race = np.arange(races)
    filtered = race < len(ids)
    keys = [rng.bytes(32).hex() for _ in range(races)]
    entrants = [
        [ids[index] if index < len(ids) and car == 0 else "driver:pace=0.9" for car in range(CARS)]
        if filtered[index]
        else [final[(index + car % 2) % FINALISTS] for car in range(CARS)]
        for index in race
    ]
    columns = {name: _values(rng, kind, rows) for name, kind in RESULTS.items()}
    fixed = {
        "match": np.repeat(keys, CARS),
        "stage": np.repeat(np.where(filtered, "pareto", "tournament"), CARS),
        "test": np.repeat(np.where(filtered, "race", "4v4"), CARS),
        "race": [0] * rows,
        "car": list(range(CARS)) * races,
        "entrant": [entrant for cars in entrants for entrant in cars],
        "ending": ["finished"] * rows,
    }
    return pl.DataFrame(columns | fixed, schema=RESULTS)


def _open_s(page: Page, address: str) -> float:
    began = time.perf_counter()
    page.goto(address)
    page.evaluate(FRAME)
    return time.perf_counter() - began


def _view_s(page: Page, address: str) -> float:
    began = time.perf_counter()
    page.evaluate(f"address => {{ location.hash = address; return {FRAME}; }}", address)
    return time.perf_counter() - began


def measure(checkpoints: int = CHECKPOINTS, races: int = RACES) -> dict[str, Any]:
    """The figures of a night of so many checkpoints, and races in all."""
    selection = night(np.random.default_rng(1), checkpoints, races)
    with tempfile.TemporaryDirectory() as name, sync_playwright() as playwright:
        folder = Path(name)
        began = time.perf_counter()
        page_file = write_page(selection, folder)
        write_spreadsheet(selection, folder / "ranking.xlsx")
        write_tables(selection, folder / "tables")
        write_s = time.perf_counter() - began
        browser = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=["--no-sandbox"])
        opened = []
        for _ in range(OPENED):
            # Pages of one place share a process: each would wait for the memory of those before it.
            with browser.new_context() as context:
                opened.append(_open_s(context.new_page(), page_file.as_uri()))
        page = browser.new_page()
        _open_s(page, page_file.as_uri())
        views = {
            "leaderboard_s": "#/leaderboard",
            "checkpoint_s": f"#/checkpoint/{selection.tables['ranking']['entrant'][0][:12]}",
            "pareto_s": "#/pareto",
        }
        shown = {name: round(_view_s(page, address), 2) for name, address in views.items()}
        chromium = browser.version
        browser.close()
        size = sum(path.stat().st_size for path in folder.rglob("*") if path.is_file())
        return {
            "size_mb": round(size / 1e6, 1),
            "page_mb": round(page_file.stat().st_size / 1e6, 1),
            "write_s": round(write_s, 1),
            "open_s": round(statistics.median(opened), 2),
            **shown,
            "checkpoints": checkpoints,
            "races": races,
            "chromium": chromium,
        }


def main() -> None:
    """Measure, and print the figures as JSON."""
    parser = argparse.ArgumentParser(prog="benchmarks.report", description="Size and speed of the report")
    parser.add_argument("--json", type=Path, nargs="?", help="file for the figures as well")
    chosen = parser.parse_args()
    figures = measure()
    if chosen.json:
        write_result(chosen.json, figures)
    print(json.dumps(figures))


if __name__ == "__main__":
    main()
