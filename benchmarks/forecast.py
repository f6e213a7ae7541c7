"""How well a selection is forecast: races, processor time and the difference that it can find.

`python -m benchmarks.forecast --json FILE [--folder FOLDER] [--nights 3] [--workers 2]`
selects among the bundled checkpoints of every circuit, `nights` times with seeds of their own, all of a
circuit into one store. The first is forecast without an earlier one, each of the others from those before it.

By circuit a list of nights: `stages`, each with `entrants`, `races` and `core_s` as pairs of forecast and
outcome, and `effect` and `deviation` as such pairs.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from rich.console import Console

from benchmarks.ladder import circuits
from benchmarks.ladders import folders
from benchmarks.result import write_result
from nathlon.api.selection import entered
from nathlon.arena.pool import Pool
from nathlon.policies.sources.finding import find
from nathlon.results.summary import Summary
from nathlon.selection.config import Config
from nathlon.selection.pipeline import run_pipeline
from nathlon.selection.single_run import single_run
from nathlon.terminal.progress import stage_progress


def measure(circuit: str, nights: int, folder: Path, workers: int) -> list[dict[str, Any]]:
    """The figures of a circuit."""
    store = folder / f"{circuit}.sqlite"
    told = []
    for seed in range(1, nights + 1):
        with Pool(workers) as pool:
            field, config = entered(pool, find(folders(circuit)), Config(seed=seed))
            with (
                stage_progress(True) as on_match,
                single_run("selection", field.newcomers, config, store, pool, on_match) as run,
            ):
                summary = run_pipeline(run, field, config)
        assert summary is not None, "no people sit on the committee"
        told.append(figures(summary))
    return told


def figures(summary: Summary) -> dict[str, Any]:
    """Forecast and outcome of a selection."""
    expected = summary.forecast
    assert expected is not None, "it was made before the selection ran"
    came = {stage.name: stage for stage in summary.stages}
    return {
        "earlier": expected.earlier,
        "effect": (round(expected.budgets[0].effect, 3), round(summary.effect or 0.0, 3)),
        "deviation": (round(expected.deviation or 0.0, 3), round(summary.unit_deviation or 0.0, 3)),
        "stages": {
            stage.name: {
                "entrants": (stage.entrants, came[stage.name].entered),
                "races": (stage.races, came[stage.name].races),
                "most_races": stage.most_races,
                "core_s": (round(stage.core_s or 0.0, 1), came[stage.name].core_s),
                "ran": came[stage.name].ran,
            }
            for stage in expected.stages
        },
    }


def main() -> None:
    """Measure, print and, if asked, write the figures."""
    parser = argparse.ArgumentParser(description="How well a selection is forecast.")
    parser.add_argument("--json", type=Path)
    parser.add_argument("--folder", type=Path, default=Path("build/forecast"))
    parser.add_argument("--nights", type=int, default=3)
    parser.add_argument("--workers", type=int, default=2)
    arguments = parser.parse_args()
    arguments.folder.mkdir(parents=True, exist_ok=True)
    told = {
        circuit: measure(circuit, arguments.nights, arguments.folder, arguments.workers)
        for circuit in circuits()
    }
    Console().print_json(data=told)
    if arguments.json:
        write_result(arguments.json, told)


if __name__ == "__main__":
    main()
