"""How often a gate errs: on the noise of real races and time trials, shifted to where the truth is known.

`python -m benchmarks.gate --json FILE [--folder FOLDER] [--gates 4000] [--pairs 60] [--runs 32]`
takes the finalists of the selection among the bundled checkpoints of the Lindenring, their fresh mirrored
pairs of every two and their fresh time trials. A gate draws its units from those of two of them, with
replacement, and ends as `nathlon gate` does by default.

By measure, `points`, `contacts at fault`, `completion` and `lap time`, `false_pass` and `false_fail`:

- `share` of gates that pass a candidate that is worse by the margin, or fail one that is as good. Points and
  laps are shifted so that their mean is at the margin, or at 0. Contacts are dealt to the two by lot, and the
  worse one gets as many more as a Poisson process of the margin's rate brings. Runs are completed as often as
  in the time trials, but by the worse one, which breaks down at the rate that matters; laps of runs that one
  of the two did not complete are not compared;
- `undecided`: share that cannot tell within the budget; `units` that a gate takes, on average.

`together`: the same of all measures, drawn independently; the worse one is worse in points alone.
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Callable
from itertools import combinations
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import polars as pl
from rich.console import Console

from benchmarks.ladder import Ladder, selected
from benchmarks.meetings import meetings
from benchmarks.result import write_result
from nathlon.arena.decision import Decision
from nathlon.arena.statistics import Floats
from nathlon.arena.tested import BREAKDOWNS
from nathlon.judge.gate.questions import Errors
from nathlon.selection.gate_settings import GateSettings
from nathlon.selection.pareto.objective import TIME_TRIAL
from nathlon.tournament.completion import Completed, Completion
from nathlon.tournament.evidence import UNIT, appearances, differences
from nathlon.tournament.non_inferiority import Sample, least_deviation, together

CIRCUIT = "lindenring"
SEED = 2026
WORKERS = 1
SETTINGS = GateSettings()
ERRORS = Errors(SETTINGS.alpha, SETTINGS.beta, SETTINGS.block, SETTINGS.breakdowns)
RATE = SETTINGS.breakdowns or 0.05
OURS, THEIRS = 1, 2
"""What of a run is not completed: the candidate's, the champion's, or both, which is the sum."""


class Measure(NamedTuple):
    """A measure of a gate.

    Attributes:
        margin: by which the worse candidate is.
        most: units.
        draw: all of them, of a candidate that is worse or not.
        judge: what some of them say.
    """

    margin: float
    most: int
    draw: Callable[[np.random.Generator, bool], Floats]
    judge: Callable[[Floats], Decision]


def of_mean(margin: float, most: int, sweep: int, least: float) -> Callable[[Floats], Decision]:
    """The judge of a mean; what is not a number is not compared."""
    test = ERRORS.of_mean(margin, most, sweep)
    return lambda units: test.verdict(Sample.of(units[np.isfinite(units)], least))


def of_completion(units: Floats) -> Decision:
    """The judge of completion, of the runs that were not completed."""
    both, ours, theirs = (int((units == kind).sum()) for kind in (OURS + THEIRS, OURS, THEIRS))
    return Completion(RATE, ERRORS.alpha, ERRORS.beta).verdict(Completed(len(units), both, ours, theirs))


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
    """Of every two survivors: by how many % the one's lap is shorter than the other's from the same start.

    Not a number where one of the two completed none.
    """
    trials = ladder.filter_runs(runs).filter(pl.col("test") == TIME_TRIAL).sort("entrant", "seed")
    whole = pl.when(~pl.col("ending").is_in(BREAKDOWNS)).then("best_lap_s")
    by_entrant = [
        trials.filter(pl.col("entrant") == one.id).select(whole).to_series().fill_null(np.nan).to_numpy()
        for one in ladder.survivors
    ]
    return [100 * (1 - one / other) for one, other in combinations(by_entrant, 2)]


def shifted(pools: list[Floats], margin: float, most: int) -> Callable[[np.random.Generator, bool], Floats]:
    """Gates whose units are drawn from one of the pools and moved to a mean of -margin, or of 0."""

    def draw(rng: np.random.Generator, worse: bool) -> Floats:
        pool = pools[rng.integers(len(pools))]
        return np.asarray(rng.choice(pool, most) - np.nanmean(pool) - margin * worse)

    return draw


def dealt(
    pools: list[Floats], margin: float, km: float, most: int
) -> Callable[[np.random.Generator, bool], Floats]:
    """Gates whose units are dealt to the two by lot; the worse one has more contacts."""

    def draw(rng: np.random.Generator, worse: bool) -> Floats:
        lots = rng.choice([-1.0, 1.0], most) * rng.choice(pools[rng.integers(len(pools))], most)
        return np.asarray(lots - worse * rng.poisson(margin * km, most) / km)

    return draw


def broken(rate: float, most: int) -> Callable[[np.random.Generator, bool], Floats]:
    """Gates whose runs are not completed at a rate, those of the worse one at that which matters."""

    def draw(rng: np.random.Generator, worse: bool) -> Floats:
        ours, theirs = rng.uniform(size=(2, most)) < np.array([[RATE if worse else rate], [rate]])
        return np.asarray(OURS * ours + THEIRS * theirs, np.float64)

    return draw


def end(measure: Measure, units: Floats) -> tuple[Decision, int]:
    """What a gate says in the end of one measure, and after how many units."""
    for taken in range(SETTINGS.block, measure.most + SETTINGS.block, SETTINGS.block):
        said = measure.judge(units[:taken])
        if said != Decision.CANNOT_TELL:
            return said, min(taken, measure.most)
    return Decision.CANNOT_TELL, measure.most


def errors(
    measures: list[Measure], gates: int, rng: np.random.Generator, worse_in: int = 0
) -> dict[str, Any]:
    """False passes and fails of gates with some measures, of which the worse candidate is worse in one."""
    told: dict[str, Any] = {}
    for name, worse, wrong in (("false_pass", True, Decision.PASS), ("false_fail", False, Decision.FAIL)):
        said: Counter[Decision] = Counter()
        units = 0
        for _ in range(gates):
            ends = [
                end(measure, measure.draw(rng, worse and number == worse_in))
                for number, measure in enumerate(measures)
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
    driven = laps(ladder, runs)
    margins = SETTINGS.model_dump()
    margin, at_fault, lap = margins["points"], margins["at_fault_per_km"], 100 * margins["lap"]
    rate = float(np.mean([np.isnan(gains).mean() for gains in driven])) / 2
    pairs_most, runs_most = SETTINGS.pairs, SETTINGS.runs
    contacts = of_mean(at_fault, pairs_most, 0, float(np.sqrt(at_fault / km)))
    timed = of_mean(lap, runs_most, ERRORS.sweep, least_deviation(lap))
    measures = {
        "points": Measure(
            margin, pairs_most, shifted(gaps, margin, pairs_most), of_mean(margin, pairs_most, 0, 0.0)
        ),
        "contacts at fault": Measure(at_fault, pairs_most, dealt(rates, at_fault, km, pairs_most), contacts),
        "lap time": Measure(lap, runs_most, shifted(driven, lap, runs_most), timed),
        "completion": Measure(RATE, runs_most, broken(rate, runs_most), of_completion),
    }
    rng = np.random.default_rng(SEED)
    told = {name: {"margin": one.margin, **errors([one], gates, rng)} for name, one in measures.items()}
    return {"gates": gates, "measures": told | {"together": errors(list(measures.values()), gates, rng)}}


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
