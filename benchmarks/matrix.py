"""What a settings matrix finds: regressions planted in a thousand cells, and a real one.

`python -m benchmarks.matrix --json FILE [--folder FOLDER] [--repeats 10]`

- `planted`: matrices of 1,000 cells of `benchmarks.planted_cells`, each with other starts. Over all of them
  `false_discovery` is the share of findings called worse that are not worse by more than the margin;
  `found` the share of those that are, by how many margins they lie beyond it; `runs` and `wall_s` of one.
- `real`: a checkpoint of the Lindenring beside the built-in driver, over scenarios, places, tyres and delays:
  `cells`, `worse`, `runs`, `wall_s`.
- `slower`: `driver:pace=0.97` beside `driver` in the same cells: worse in pace in every one.
"""

from __future__ import annotations

import argparse
import shutil
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console

import nathlon
from benchmarks import planted_cells
from benchmarks.planted_cells import MARGINS, truth
from benchmarks.result import write_result
from nathlon.api.matrix import MatrixResult
from nathlon.selection.config import Config
from nathlon.selection.matrix_settings import MatrixSettings

REPOSITORY = Path(__file__).parent.parent
CHECKPOINT = REPOSITORY / "policies" / "bundled" / "lindenring" / "lindenring-again-056k.safetensors"
BEYOND = ((0.0, 1.0), (1.0, 3.0), (3.0, 11.0))
"""Margins beyond the margin, by which planted regressions are told apart."""
REAL = MatrixSettings(
    compounds=("racing-hard", "racing-medium", "racing-soft"), delays_s=(0.0, 0.1, 0.2), replays=0
)


def planted(folder: Path, repeats: int) -> dict[str, Any]:
    """Planted regressions, found and not."""
    world = f"{planted_cells.__file__}:PLANTED"
    called = false = 0
    found: list[tuple[float, bool]] = []
    runs, seconds = [], []
    new, old = (folder / f"{name}.onnx" for name in ("new", "old"))
    for path in (new, old):
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(path.stem)
    settings = MatrixSettings(margins=MARGINS, opponents=(str(old),))
    for repeat in range(repeats):
        out = folder / f"planted-{repeat}"
        config = Config(world=world, seed=repeat, matrix=settings)
        result = nathlon.matrix(new, out, baseline=old, config=config, progress=False)
        runs.append(result.report.runs)
        seconds.append(result.report.wall_s)
        for cell in result.report.cells:
            effects = dict(zip(MARGINS, truth(cell.scenario, cell.place), strict=True))
            for (name, margin), finding in zip(MARGINS.items(), cell.findings, strict=True):
                is_worse, says_so = effects[name] > margin + 1e-9, finding.verdict == "worse"
                called += says_so
                false += says_so and not is_worse
                if is_worse:
                    found.append((effects[name] / margin - 1, says_so))
        shutil.rmtree(out)
    return {
        "cells": len(result.report.cells),
        "repeats": repeats,
        "confirm": settings.confirm,
        "called": called,
        "false_discovery": false / max(called, 1),
        "found": [
            {"from": low, "to": high, "share": float(np.mean([yes for x, yes in found if low < x <= high]))}
            for low, high in BEYOND
        ],
        "runs": float(np.median(runs)),
        "wall_s": float(np.median(seconds)),
    }


def driven(result: MatrixResult) -> dict[str, Any]:
    """What a matrix of our own simulator came to."""
    report = result.report
    return {
        "policy": report.policy,
        "baseline": report.baseline,
        "cells": len(report.cells),
        "runs": report.runs,
        "wall_s": report.wall_s,
        "worse": report.worse,
        "by_measure": {
            measure.name: sum(cell.findings[number].verdict == "worse" for cell in report.cells)
            for number, measure in enumerate(report.measures)
        },
    }


def main() -> None:
    """Measure, print and write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--json", type=Path, required=True)
    parser.add_argument("--folder", type=Path, default=Path("runs/bench-matrix"))
    parser.add_argument("--repeats", type=int, default=10)
    arguments = parser.parse_args()
    config = Config(matrix=REAL)
    figures = {
        "planted": planted(arguments.folder, arguments.repeats),
        "real": driven(nathlon.matrix(CHECKPOINT, arguments.folder / "real", config=config)),
        "slower": driven(nathlon.matrix("driver:pace=0.97", arguments.folder / "slower", config=config)),
    }
    Console().print_json(data=figures)
    write_result(arguments.json, figures)


if __name__ == "__main__":
    main()
