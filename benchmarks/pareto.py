"""How long the Pareto filter takes for a thousand checkpoints: `python -m benchmarks.pareto`."""

from __future__ import annotations

import argparse
import os
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
from safetensors.numpy import load_file

from benchmarks.result import write_result
from nathlon.arena.entrant import Entrant, enter, only_once
from nathlon.arena.pool import Pool
from nathlon.arena.store import Store
from nathlon.policies.bundled import BUNDLED
from nathlon.policies.checkpoint import read_card, save_checkpoint
from nathlon.selection.pareto.filter import FilterSettings, run_filter
from nathlon.selection.run import Run

CIRCUIT, CAR = "lindenring", "gt3"
SEED = 2027
NOISE = (0.01, 2.0)
"""Standard deviations of the noise on the weights, relative to their own: from hardly felt to ruinous."""


def make_field(folder: Path, count: int, rng: np.random.Generator) -> list[Path]:
    """Write distinct checkpoints: bundled ones with noise on their weights, its size even in logarithm."""
    sources = sorted((BUNDLED / CIRCUIT).glob("*.safetensors"))
    paths = []
    for index, size in enumerate(np.geomspace(*NOISE, count)):
        source = sources[index % len(sources)]
        tensors = {
            name: half.astype(np.float32) + size * half.std(dtype=float) * rng.standard_normal(half.shape)
            for name, half in load_file(source).items()
        }
        paths.append(folder / f"{source.stem}-{index:05}.safetensors")
        save_checkpoint(paths[-1], tensors, read_card(source))
    return paths


def time_filter(sources: Sequence[Path], store: Path, workers: int) -> dict[str, Any]:
    """Enter checkpoints and filter them with the default settings, into a new store."""
    began = time.perf_counter()
    entrants: list[Entrant] = only_once([enter(str(path), CIRCUIT, CAR) for path in sources])
    entered = time.perf_counter()
    with Store(store) as kept, Pool(workers) as pool:
        kept.begin_run("benchmark", {})
        run = Run(kept, "benchmark", (SEED,), pool, lambda *_: None)
        answer = run_filter(run, entrants, FilterSettings())
    ended = time.perf_counter()
    table = answer.tables["pareto"]
    return {
        "checkpoints": len(entrants),
        "wall_s": round(ended - began, 1),
        "enter_s": round(entered - began, 1),
        "workers": workers,
        "raced": table.filter(pl.col("races") > 0).height,
        "races": table["races"].sum(),
        "most_races": table["races"].max(),
        "time_trials": answer.results.filter(pl.col("test") == "time_trial").height,
        "survivors": len(answer.entrants),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--checkpoints", type=int, default=1000)
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--json", type=Path, metavar="FILE", help="file for the figures as well")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        paths = make_field(folder, options.checkpoints, np.random.default_rng(SEED))
        figures = time_filter(paths, folder / "store.sqlite", options.workers)
    if options.json:
        write_result(options.json, figures)
    for figure, value in figures.items():
        print(f"{figure:<12} {value}")


if __name__ == "__main__":
    main()
