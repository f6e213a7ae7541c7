"""How often a gate errs: on the noise of real races and time trials, shifted to where the truth is known.

`python -m benchmarks.gate --json FILE [--folder FOLDER] [--gates 4000] [--pairs 60] [--runs 32]`
takes the finalists of the selection among the bundled checkpoints of the Lindenring, their fresh mirrored
pairs of every two and their fresh time trials. A gate draws its units from those of two of them, with
replacement, and ends as `nathlon gate` does by default.

By measure, `points`, `contacts at fault` and `lap time`, `false_pass` and `false_fail`:

- `share` of gates that pass a candidate that is worse by the margin, or fail one that is as good. Points and
  laps are shifted so that their mean is at the margin, or at 0. Contacts are dealt to the two by lot, and the
  worse one gets as many more as a Poisson process of the margin's rate brings;
- `undecided`: share that cannot tell within the budget; `units` that a gate takes, on average.

`together`: the same of all three measures, drawn independently; the worse one is worse in points alone.
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Callable
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
from rich.console import Console

from benchmarks.ladder import Ladder, selected
from benchmarks.meetings import meetings
from benchmarks.result import write_result
from nathlon.arena.decision import Decision
from nathlon.arena.statistics import Floats
from nathlon.gating.settings import GateSettings
from nathlon.pareto.objective import TIME_TRIAL
from nathlon.tournament.evidence import UNIT, appearances, differences
from nathlon.tournament.non_inferiority import NonInferiority, Sample, together

CIRCUIT = "lindenring"
SEED = 2026
WORKERS = 1
SETTINGS = GateSettings()

Draw = Callable[[np.random.Generator, bool], tuple[Floats, float]]
"""Differences of a gate's units, of a candidate that is worse or not, and the least deviation of one."""


def points(ladder: Ladder, pairs: int) -> tuple[list[Floats], list[Floats], float]:
    """Of every two finalists: differences in points, and in contacts at fault a km; km of a unit and car."""
    gaps, rates, driven = [], [], []
    for meeting in meetings(ladder.race(ladder.finalists, pairs)).values():
        seen = appearances(meeting.results)
        gaps.append(differences(seen)["difference"].to_numpy())
        by_side = seen.with_columns(rate=pl.col("at_fault") / pl.col("km"))
        paired = by_side.group_by(*UNIT, maintain_order=True).agg(
            pl.col("rate").first() - pl.col("rate").last()
        )
        rates.append(paired["rate"].to_numpy())
        driven.append(float(seen["km"].to_numpy().mean()))
    return gaps, rates, float(np.mean(driven))


def laps(ladder: Ladder, runs: int) -> list[Floats]:
    """Of every two survivors: by how many % the one's lap is shorter than the other's from the same start."""
    trials = ladder.filter_runs(runs).filter(pl.col("test") == TIME_TRIAL).sort("entrant", "seed")
    by_entrant = [
        trials.filter(pl.col("entrant") == one.id)["best_lap_s"].to_numpy() for one in ladder.survivors
    ]
    found = [100 * (1 - one / other) for one, other in combinations(by_entrant, 2)]
    return [gaps[np.isfinite(gaps)] for gaps in found]


def shifted(pools: list[Floats], margin: float, most: int) -> Draw:
    """Gates whose units are drawn from one of the pools and moved to a mean of -margin, or of 0."""

    def draw(rng: np.random.Generator, worse: bool) -> tuple[Floats, float]:
        pool = pools[rng.integers(len(pools))]
        return rng.choice(pool, most) - pool.mean() - margin * worse, 0.0

    return draw


def dealt(pools: list[Floats], margin: float, km: float, most: int) -> Draw:
    """Gates whose units are dealt to the two by lot; the worse one has more contacts."""

    def draw(rng: np.random.Generator, worse: bool) -> tuple[Floats, float]:
        lots = rng.choice([-1.0, 1.0], most) * rng.choice(pools[rng.integers(len(pools))], most)
        return lots - worse * rng.poisson(margin * km, most) / km, float(np.sqrt(margin / km))

    return draw


def end(units: Floats, floor: float, margin: float) -> tuple[Decision, int]:
    """What a gate says in the end of one measure, and after how many units."""
    block = SETTINGS.block
    test = NonInferiority(margin, SETTINGS.alpha, SETTINGS.beta, -(-len(units) // block))
    for taken in range(block, len(units) + block, block):
        said = test.verdict(Sample.of(units[:taken], floor))
        if said != Decision.CANNOT_TELL:
            return said, min(taken, len(units))
    return Decision.CANNOT_TELL, len(units)


def errors(
    measures: list[tuple[Draw, float]], gates: int, rng: np.random.Generator, worse_in: int = 0
) -> dict[str, Any]:
    """False passes and fails of gates with some measures, of which the worse candidate is worse in one."""
    told: dict[str, Any] = {}
    for name, worse, wrong in (("false_pass", True, Decision.PASS), ("false_fail", False, Decision.FAIL)):
        said: Counter[Decision] = Counter()
        units = 0
        for _ in range(gates):
            ends = [
                end(*draw(rng, worse and number == worse_in), margin)
                for number, (draw, margin) in enumerate(measures)
            ]
            said[together([verdict for verdict, _ in ends])] += 1
            units += max(taken for _, taken in ends)
        told[name] = {
            "share": round(said[wrong] / gates, 4),
            "undecided": round(said[Decision.CANNOT_TELL] / gates, 4),
            "units": round(units / gates, 1),
        }
    return told


def measure(ladder: Ladder, gates: int, pairs: int, runs: int) -> dict[str, Any]:
    """The figures of a ladder."""
    gaps, rates, km = points(ladder, pairs)
    margins = SETTINGS.model_dump()
    margin, at_fault, lap = margins["points"], margins["at_fault_per_km"], 100 * margins["lap"]
    drawn: dict[str, tuple[Draw, float]] = {
        "points": (shifted(gaps, margin, SETTINGS.pairs), margin),
        "contacts at fault": (dealt(rates, at_fault, km, SETTINGS.pairs), at_fault),
        "lap time": (shifted(laps(ladder, runs), lap, SETTINGS.runs), lap),
    }
    rng = np.random.default_rng(SEED)
    told = {name: {"margin": one[1], **errors([one], gates, rng)} for name, one in drawn.items()}
    return {"gates": gates, "measures": told | {"together": errors(list(drawn.values()), gates, rng)}}


def main() -> None:
    """Measure, print and, if asked, write the figures."""
    parser = argparse.ArgumentParser(description="How often a gate errs.")
    parser.add_argument("--json", type=Path)
    parser.add_argument("--folder", type=Path, default=Path("build/calibration"))
    parser.add_argument("--gates", type=int, default=4000)
    parser.add_argument("--pairs", type=int, default=60)
    parser.add_argument("--runs", type=int, default=32)
    chosen = parser.parse_args()
    with selected(CIRCUIT, chosen.folder / CIRCUIT, WORKERS) as ladder:
        figures = measure(ladder, chosen.gates, chosen.pairs, chosen.runs)
    Console().print_json(data=figures)
    if chosen.json:
        write_result(chosen.json, figures)


if __name__ == "__main__":
    main()
