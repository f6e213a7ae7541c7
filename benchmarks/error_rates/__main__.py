"""How often each verdict makes a claim that is false, by kinds of noise.

`python -m benchmarks.error_rates [--json FILE] [--simulations 1000] [--workers 2] [--verdict NAME ...]` draws
what the verdicts' own functions take in, races nothing, and ends with 1 where a row is proven to miss its
goal. The last line is JSON: `rows`, each with

- `verdict`, `claim`: what is claimed falsely, and under what `noise`;
- `claims`: those that were made of a false discovery rate, and else those that could have been;
- `false_share`, `low`, `high`: of false claims, with a 95 % interval over simulations;
- `goal`: false claims, at most; `power`: how often what is true was found, which the module's function says.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from itertools import chain
from multiprocessing import get_context
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import track

from benchmarks.error_rates import gates, matrices, recipes, selections
from benchmarks.error_rates.simulation import Case, missed, row, simulated
from benchmarks.result import write_result

CHUNK = 100
"""Simulations that a process does at a time."""


def all_cases() -> list[Case]:
    """Every verdict under every noise."""
    return list(chain(*(module.cases() for module in (selections, gates, matrices, recipes))))


def rows(cases: Sequence[Case], simulations: int, workers: int) -> Iterator[dict[str, Any]]:
    """The rows of some cases, as they are done."""
    chunks = [range(begin, min(begin + CHUNK, simulations)) for begin in range(0, simulations, CHUNK)]
    if workers == 1:
        for case in cases:
            yield row(case, simulated(case, range(simulations)))
        return
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
        asked = [(case, [pool.submit(simulated, case, chunk) for chunk in chunks]) for case in cases]
        for case, parts in asked:
            yield row(case, [outcome for part in parts for outcome in part.result()])


def main() -> None:
    """Measure, print and, if asked, write."""
    parser = argparse.ArgumentParser(description=str(__doc__).partition("\n")[0])
    parser.add_argument("--json", type=Path, metavar="FILE", help="file for the figures as well")
    parser.add_argument("--simulations", type=int, default=1000)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--verdict", action="append", help="only this one, or these")
    chosen = parser.parse_args()
    cases = [case for case in all_cases() if chosen.verdict is None or case.verdict in chosen.verdict]
    told = rows(cases, chosen.simulations, chosen.workers)
    made = list(track(told, "Rows", len(cases), console=Console(stderr=True)))
    figures = {"simulations": chosen.simulations, "rows": made}
    if chosen.json:
        write_result(chosen.json, figures)
    for one in filter(missed, made):
        print(f"{one['verdict']} misses its goal: {one}", file=sys.stderr)
    print(json.dumps(figures))
    sys.exit(any(map(missed, made)))


if __name__ == "__main__":
    main()
