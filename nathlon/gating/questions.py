"""What a gate asks: measures of a candidate beside those of the champion, unit by unit."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import sqrt
from typing import NamedTuple

import numpy as np
import polars as pl

from nathlon.arena.entrant import Entrant
from nathlon.arena.match import TESTED, Match
from nathlon.arena.results import VOID_ENDINGS
from nathlon.n_athlon.measures import Measure
from nathlon.n_athlon.skill import Marks, Skill
from nathlon.selection.round_robin import Fixture
from nathlon.selection.run import GATE
from nathlon.selection.trials import against
from nathlon.tournament.evidence import Evidence, appearances
from nathlon.tournament.non_inferiority import Sample

NEVER = 2.0
"""A lap that is never completed counts as so many of the champion's."""


class Pair(NamedTuple):
    """A candidate and whose place it would take."""

    candidate: Entrant
    champion: Entrant


@dataclass(frozen=True)
class Series:
    """Matches whose results answer some questions; the same ones never run twice.

    Attributes:
        most: units or runs in all.
        matches: those of some of the units.
    """

    most: int
    matches: Callable[[slice], list[Match]]


@dataclass(frozen=True)
class Question:
    """One measure.

    Attributes:
        name, unit: of the measure.
        margin: by which the candidate may be worse, in `unit`.
        series: what has to be run.
        sample: of RESULTS of the series, the units of evidence; None where nothing is measured.
    """

    name: str
    unit: str
    margin: float
    series: Series
    sample: Callable[[pl.DataFrame], Sample | None]


def race_series(fixtures: Sequence[Fixture], most: int) -> Series:
    """Mirrored races of the two against each other."""
    return Series(
        most, lambda units: [made.match(units, GATE) for made in fixtures if made.meeting.seeds[units]]
    )


def trial_series(
    scenario: str,
    pair: Pair,
    opponents: Sequence[str],
    slots: Sequence[int],
    seeds: Sequence[int],
    in_order: bool = False,
) -> Series:
    """The same runs of both, one after the other, each among the same opponents."""

    def matches(units: slice) -> list[Match]:
        begin = units.start % len(slots)
        turned = [*slots[begin:], *slots[:begin]]
        return [
            against(GATE, scenario, scenario, entrant, opponents, turned, seeds[units], in_order)
            for entrant in (pair.candidate, pair.champion)
        ]

    return Series(len(seeds), matches)


def points_question(margin: float, series: Series, pair: Pair, weights: Mapping[str, float]) -> Question:
    """Team points a race."""

    def sample(results: pl.DataFrame) -> Sample | None:
        evidence = Evidence(results, weights)
        if evidence.seen.is_empty():
            return None
        cells = evidence.cells
        variance = evidence.shares**2 @ (cells["deviation"] ** 2 / cells["units"]).fill_null(0.0).to_numpy()
        sign = 1.0 if evidence.entrants[0] == pair.candidate.id else -1.0
        [units], [mean] = evidence.units, evidence.shares @ evidence.means
        return Sample(float(units), sign * float(mean), sqrt(float(variance[0] * units)))

    return Question("points", "a race", margin, series, sample)


def at_fault_question(margin: float, series: Series, pair: Pair) -> Question:
    """Contacts that the stewards lay to the one and to the other, a car and kilometre.

    Counting alone makes a candidate's units vary that is worse by the margin: by no less is reckoned, or a
    few kilometres without a contact would be proof.
    """

    def sample(results: pl.DataFrame) -> Sample | None:
        if results["contacts_at_fault"].null_count() == results.height:
            return None
        seen = appearances(results).filter(pl.col("km") > 0)
        rate = pl.col("at_fault") / pl.col("km")
        by_unit = seen.group_by("test", "match", "unit", maintain_order=True).agg(
            difference=rate.filter(pl.col("entrant") == pair.champion.id).sum()
            - rate.filter(pl.col("entrant") == pair.candidate.id).sum(),
            km=pl.col("km").mean(),
        )
        if by_unit.is_empty():
            return None
        km = float(by_unit["km"].mean())  # type: ignore[arg-type]  # there are some
        return Sample.of(by_unit["difference"].to_numpy(), sqrt(margin / km))

    return Question("contacts at fault", "a km", margin, series, sample)


def lap_question(margin: float, series: Series, pair: Pair) -> Question:
    """How much shorter the candidate's best lap is than the champion's from the same start.

    Args:
        margin: a share of the champion's lap.
    """

    def sample(results: pl.DataFrame) -> Sample | None:
        ours, theirs = (_best_laps(results, entrant.id) for entrant in pair)
        both = theirs.drop_nulls("best_lap_s").join(ours, on="seed", how="inner", suffix="_ours")
        if both.is_empty():
            return None
        champion = both["best_lap_s"]
        candidate = both["best_lap_s_ours"].fill_null(NEVER * champion)
        return Sample.of((100.0 * (1.0 - candidate / champion)).to_numpy())

    return Question("lap time", "in % of the champion's", 100.0 * margin, series, sample)


def _best_laps(results: pl.DataFrame, entrant: str) -> pl.DataFrame:
    runs = results.filter(
        pl.col("entrant") == entrant, pl.col("team") == TESTED, ~pl.col("ending").is_in(VOID_ENDINGS)
    )
    return runs.select("seed", "best_lap_s").sort("seed")


def test_question(
    margin: float, series: Series, pair: Pair, skill: Skill, how: Measure, marks: Marks
) -> Question:
    """Points in a skill test, in the same runs."""

    def sample(results: pl.DataFrame) -> Sample | None:
        gained: dict[str, dict[int, float]] = {entrant.id: {} for entrant in pair}
        for match in results.partition_by("match", maintain_order=True):
            tested = match.filter(pl.col("team") == TESTED)["entrant"][0]
            seeds = dict(match.select("race", "seed").unique().iter_rows())
            for run, mark in skill.runs_of(match, how):
                gained[tested][seeds[run]] = float(marks.points(np.nan if mark is None else mark))
        ours, theirs = (gained[entrant.id] for entrant in pair)
        both = sorted(ours.keys() & theirs.keys())
        return Sample.of(np.array([ours[seed] - theirs[seed] for seed in both])) if both else None

    return Question(skill.name, "in points", margin, series, sample)
