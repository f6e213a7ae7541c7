"""Filters drawn from raced time trials and races: how much of the true Pareto front they keep."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import partial
from typing import Any

import moocore
import numpy as np
import polars as pl

from benchmarks.resampled import Units, resampled
from nathlon.arena.entrant import Entrant
from nathlon.arena.match import TESTED, Match
from nathlon.arena.statistics import group_sums
from nathlon.selection.pareto import came_through
from nathlon.selection.pareto.filter import FilterSettings, run_filter
from nathlon.selection.pareto.objective import Measured, Objective, measure, own_runs
from nathlon.selection.run import Run


class RacedRuns:
    """Raced runs of some entrants, the same seeds for all of them.

    Attributes:
        results: RESULTS of the filter's tests.
    """

    def __init__(self, results: pl.DataFrame) -> None:
        """Read RESULTS whose matches each have one entrant under test."""
        self.results = results
        self._units: dict[tuple[str, str], Units] = {}
        for match in results.partition_by("match"):
            [tested] = match.filter(pl.col("team") == TESTED)["entrant"].unique()
            self._units[match["test"][0], tested] = Units(match, 1)

    def draw(self, seed: int, match: Match) -> pl.DataFrame:
        """RESULTS of a match, its runs drawn with replacement: of one seed the same run for everybody."""
        units = self._units[match.test, match.entrants[0]]
        drawn = [np.random.default_rng([seed, race.seed]).integers(len(units)) for race in match.races]
        return units.take(match, np.array(drawn))


def true_front(results: pl.DataFrame, objectives: Sequence[Objective]) -> set[str]:
    """The entrants that no other dominates, by all their runs."""
    runs = own_runs(results)
    measured = [measure(runs, objective) for objective in objectives]
    through = [came_through(runs, test) for test in {objective.source for objective in objectives}]
    entrants = sorted(set.intersection(*through, *(set(each.entrants) for each in measured)))
    costs = np.stack([each.of(entrants).cost for each in measured], axis=1)
    front = moocore.is_nondominated(costs, keep_weakly=True)
    return {entrant for entrant, on in zip(entrants, front, strict=True) if on}


def spread_of(measured: Measured) -> float:
    """Standard deviation of an objective's runs about their entrant's mean, in its unit."""
    counts = measured.sizes
    means = np.repeat(group_sums(measured.runs, counts) / counts, counts)
    return float(np.sqrt(((measured.runs - means) ** 2).mean()))


def judged(
    run: Run, entrants: Sequence[Entrant], raced: RacedRuns, settings: FilterSettings, numbers: Iterable[int]
) -> dict[str, Any]:
    """Filters by their numbers, each run by the stage itself, in its rounds.

    Returns:
        `entrants`, of whom `front` are on the true front; `kept`, the share of these that survive;
        `all_kept`, the share of filters in which all of them do; `survivors`, on average; `races` a filter,
        time trials among them; `pool_sd`, by objective, in its unit; and `runs`.
    """
    front = true_front(raced.results, settings.objective)
    kept, survivors, races = [], [], []
    for number in numbers:
        drawn = resampled(run, number, partial(raced.draw, number))
        answer = run_filter(drawn, entrants, settings)
        kept.append(len(front & {entrant.id for entrant in answer.entrants}) / len(front))
        survivors.append(len(answer.entrants))
        races.append(answer.results.select(pl.struct("match", "race").n_unique()).item())
    runs = own_runs(raced.results)
    return {
        "entrants": len(entrants),
        "front": len(front),
        "kept": round(float(np.mean(kept)), 4),
        "all_kept": round(float(np.mean(np.array(kept) == 1)), 4),
        "survivors": round(float(np.mean(survivors)), 1),
        "races": round(float(np.mean(races)), 1),
        "pool_sd": {each.name: round(spread_of(measure(runs, each)), 4) for each in settings.objective},
        "runs": len(kept),
    }
