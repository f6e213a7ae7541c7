"""Batteries drawn from the marks of many runs: of equals, and of those that a filter kept."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
import polars as pl
from numpy.typing import NDArray

from benchmarks.calibration.tally import tally
from nathlon.selection.battery.ranking import MARKS, rank_battery
from nathlon.selection.battery.skill import Skill


def drawn(marks: pl.DataFrame, runs: Mapping[str, NDArray[np.int64]]) -> pl.DataFrame:
    """MARKS of a battery: of each test the runs of these numbers, for everybody, renumbered."""
    chosen = pl.concat(
        pl.DataFrame({"run": numbers, "place": np.arange(len(numbers))}).with_columns(test=pl.lit(test))
        for test, numbers in runs.items()
    )
    return marks.join(chosen, on=["test", "run"]).with_columns(run="place").select(MARKS.names())


def by_scenario(tests: Iterable[Skill], pool: int, rng: np.random.Generator) -> dict[str, NDArray[np.int64]]:
    """By test the numbers of the runs drawn of `pool`: of one scenario the same, as its seeds are."""
    tests = list(tests)
    most = max(skill.runs for skill in tests)
    numbers = {skill.scenario: rng.integers(pool, size=most) for skill in tests}
    return {skill.name: numbers[skill.scenario][: skill.runs] for skill in tests}


def true_points(marks: pl.DataFrame) -> pl.DataFrame:
    """The points of every entrant, by all runs: `entrant` and `truth`."""
    means = marks.group_by("entrant", "test").agg(pl.col("points").mean())
    return means.group_by("entrant").agg(truth=pl.col("points").sum())


def pool_sd(marks: pl.DataFrame) -> float:
    """Standard deviation of the points of a test from run to run, of the same entrant."""
    deviation = pl.col("points") - pl.col("points").mean().over("entrant", "test")
    return float(np.sqrt(marks.select((deviation**2).mean()).item()))


def of_survivors(
    marks: pl.DataFrame, tests: Iterable[Skill], numbers: Iterable[int], seed: int
) -> dict[str, Any]:
    """Batteries of all entrants of some MARKS; as `tally`, with `entrants` and `pool_sd`."""
    tests, truth = list(tests), true_points(marks)
    pool = marks["run"].n_unique()
    rankings = []
    for number in numbers:
        rng = np.random.default_rng([seed, number])
        battery = rank_battery(drawn(marks, by_scenario(tests, pool, rng)), rng)
        rankings.append(_told(battery).join(truth, on="entrant"))
    return {"entrants": len(truth)} | tally(rankings) | {"pool_sd": round(pool_sd(marks), 1)}


def of_equals(
    marks: pl.DataFrame, tests: Iterable[Skill], entrants: int, numbers: Iterable[int], seed: int
) -> dict[str, Any]:
    """Batteries of so many equals, each with runs of its own of one and the same entrant, drawn by lot."""
    tests, truth = list(tests), true_points(marks).sort("entrant")
    pool = marks["run"].n_unique()
    own = marks.partition_by("entrant", as_dict=True)
    rankings = []
    for number in numbers:
        rng = np.random.default_rng([seed, entrants, number])
        name, points = truth.row(int(rng.integers(len(truth))))
        copies = [
            drawn(own[name,], by_scenario(tests, pool, rng)).with_columns(entrant=pl.lit(f"equal {copy}"))
            for copy in range(entrants)
        ]
        rankings.append(_told(rank_battery(pl.concat(copies), rng)).with_columns(truth=points))
    return tally(rankings) | {"pool_sd": round(pool_sd(marks), 1)}


def _told(battery: pl.DataFrame) -> pl.DataFrame:
    return battery.select("entrant", "rank", low="points_low", high="points_high")
