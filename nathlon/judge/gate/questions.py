"""What a gate asks: measures of a candidate beside those of the champion, unit by unit.

A mean says little of losses that are rare. So a unit is taken to vary by no less than such losses would make
it vary (`least_deviation`), and where a loss may be of any size, nothing passes before as many units as
would have shown one (`clean_sweep`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import sqrt
from typing import NamedTuple

import numpy as np
import polars as pl

from nathlon.arena.decision import Decision
from nathlon.arena.match import TESTED
from nathlon.arena.tested import BREAKDOWNS, RACE, entrant_rows
from nathlon.arena.voids import is_void
from nathlon.judge.gate.series import RunPair, Series
from nathlon.selection.battery.measures import SkillMeasure
from nathlon.selection.battery.skill import Marks, Skill
from nathlon.tournament.completion import Completed, Completion, clean_sweep
from nathlon.tournament.evidence import Evidence, appearances
from nathlon.tournament.non_inferiority import NonInferiority, Sample, least_deviation

FIRST_LOOK = 24
"""Units before which no mean is judged, or all where there are fewer: noise may be skewed."""
BROKEN = pl.col("ending").is_in(BREAKDOWNS)
"""Whether a run, a row of RESULTS, is not completed."""
NO_LAP = BROKEN | pl.col("best_lap_s").is_null()
"""Likewise of a time trial, which wants a lap."""


class GateAnswer(NamedTuple):
    """What the units of a question so far come to.

    Attributes:
        verdict: on it.
        difference: as measured, more being better; None where nothing was.
        low, high: its bounds, which hold at all looks together; None where they are not known.
        units: of evidence.
        note: a sentence on what the verdict rests on, or does not; empty where there is nothing to say.
        needed: units that would decide, if the difference stays as it is; None where that is not known.
        void: units that count for nobody.
        final: whether what is left of the budget cannot make it a pass, so that it is not run.
    """

    verdict: Decision
    difference: float | None
    low: float | None
    high: float | None
    units: int
    note: str = ""
    needed: int | None = None
    void: int = 0
    final: bool = False


@dataclass(frozen=True)
class GateQuestion:
    """One measure.

    Attributes:
        name, unit: of the measure.
        margin: by which the candidate may be worse, in `unit`.
        series: what has to be run.
        judge: RESULTS of the series; None where nothing is measured.
    """

    name: str
    unit: str
    margin: float
    series: Series
    judge: Callable[[pl.DataFrame], GateAnswer | None]

    def answer(self, results: pl.DataFrame, spare: float) -> GateAnswer | None:
        """What the results come to, void units among them; None where nothing is measured.

        Void units may hide what the candidate would have lost. So it does not pass where it may have voided
        more than a share of them, and nothing is said where most of one's units are void.

        Args:
            results: RESULTS of the series.
            spare: the share.
        """
        said, lost = self.judge(results), self.series.lost(results)
        final = lost.hides_for_good(spare, self.series.most)
        if lost.not_judged or (said is None and lost.units and lost.void == lost.units):
            nothing = GateAnswer(
                Decision.CANNOT_TELL, None, None, None, 0, lost.sentence(spare), void=lost.void
            )
            return nothing._replace(final=final)
        if said is None or not lost.void:
            return said
        note = "; ".join(filter(None, (said.note, lost.sentence(spare))))
        if said.verdict == Decision.PASS and lost.hides(spare):
            said = said._replace(verdict=Decision.CANNOT_TELL, final=final)
        return said._replace(note=note, void=lost.void)


@dataclass(frozen=True)
class Errors:
    """How often a gate may err, and how often it looks.

    Attributes:
        alpha, beta: as `nathlon.selection.gate_settings.GateSettings` has them.
        block: units from look to look.
        breakdowns: the rate that matters; None where breakdowns are not asked for.
    """

    alpha: float
    beta: float
    block: int
    breakdowns: float | None

    @property
    def sweep(self) -> int:
        """Units before which nothing passes whose losses may be of any size."""
        return 0 if self.breakdowns is None else clean_sweep(self.breakdowns, self.alpha)

    def of_mean(self, margin: float, most: int, sweep: int) -> NonInferiority:
        """The test of a mean of so many units at most."""
        looks = -(-most // self.block)
        return NonInferiority(margin, self.alpha, self.beta, looks, min(FIRST_LOOK, most), sweep)


def mean_judged(test: NonInferiority, sample: Sample, note: str = "") -> GateAnswer:
    """What a mean of differences comes to."""
    low, high = test.interval(sample)
    verdict = test.verdict(sample)
    needed = test.needed(sample) if verdict == Decision.CANNOT_TELL else None
    return GateAnswer(verdict, sample.mean, low, high, round(sample.units), note, needed)


def points_question(
    margin: float, series: Series, pair: RunPair, weights: Mapping[str, float], errors: Errors
) -> GateQuestion:
    """Team points a race. In other worlds they are scores, which may fall without end."""
    endless = not pair.champion.circuit
    test = errors.of_mean(margin, series.most, errors.sweep if endless else 0)
    least = least_deviation(margin) if endless else 0.0

    def judge(results: pl.DataFrame) -> GateAnswer | None:
        evidence = Evidence(results, weights)
        if evidence.seen.is_empty():
            return None
        cells = evidence.cells
        variance = evidence.shares**2 @ (cells["deviation"] ** 2 / cells["units"]).fill_null(0.0).to_numpy()
        sign = 1.0 if evidence.entrants[0] == pair.candidate.id else -1.0
        [units], [mean] = evidence.units, evidence.shares @ evidence.means
        deviation = max(sqrt(float(variance[0] * units)), least)
        return mean_judged(test, Sample(float(units), sign * float(mean), deviation))

    return GateQuestion("points", "a race", margin, series, judge)


def at_fault_question(margin: float, series: Series, pair: RunPair, errors: Errors) -> GateQuestion:
    """Contacts that the stewards lay to the one and to the other, a car and kilometre.

    Counting alone makes a candidate's units vary that is worse by the margin: by no less is reckoned, or a
    few kilometres without a contact would be proof.
    """
    test = errors.of_mean(margin, series.most, 0)

    def judge(results: pl.DataFrame) -> GateAnswer | None:
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
        return mean_judged(test, Sample.of(by_unit["difference"].to_numpy(), sqrt(margin / km)))

    return GateQuestion("contacts at fault", "per km", margin, series, judge)


def completion_question(
    name: str, rate: float, series: Series, pair: RunPair, broken: pl.Expr, errors: Errors
) -> GateQuestion:
    """In how many of its runs the candidate breaks down, and whether more often than the champion.

    A run that it has voided, and the champion has not, may be one more: it counts as a breakdown for what is
    ruled out, and for nothing else.

    Args:
        rate: of breakdowns that matters, a share of the runs.
        broken: whether a row of RESULTS is such a run.
    """
    test = Completion(rate, errors.alpha, errors.beta)

    def judge(results: pl.DataFrame) -> GateAnswer | None:
        ours, theirs = (_runs(results, entrant.id, broken.alias("broken")) for entrant in pair)
        both = ours.join(theirs, on="seed", suffix="_theirs")
        doubtful = both.filter(pl.col("void"), ~pl.col("void_theirs")).height
        whole = both.filter(~pl.col("void"), ~pl.col("void_theirs"))
        if whole.is_empty():
            return None
        mine, other = whole["broken"], whole["broken_theirs"]
        seen = Completed(
            whole.height, int((mine & other).sum()), int((mine & ~other).sum()), int((~mine & other).sum())
        )
        feared = seen._replace(runs=seen.runs + doubtful, alone=seen.alone + doubtful)
        verdict = test.verdict(seen)
        if verdict == Decision.PASS and test.verdict(feared) != Decision.PASS:
            verdict = Decision.CANNOT_TELL
        out = test.ruled_out(feared)
        return GateAnswer(
            verdict,
            -100.0 * seen.broken / seen.runs,
            None if out is None else -100.0 * out,
            None,
            feared.runs,
            completion_note(seen, doubtful, verdict, test, out),
        )

    return GateQuestion(name, "in % of runs", 100.0 * rate, series, judge)


def completion_note(
    seen: Completed, doubtful: int, verdict: Decision, test: Completion, ruled_out: float | None
) -> str:
    """What the runs of a completion question can say, and what they cannot.

    Args:
        seen: runs that are not void.
        doubtful: runs that the candidate may have voided.
        verdict: on both.
        test: of them.
        ruled_out: the least rate of breakdowns that is.
    """
    told = f"it broke down in {seen.broken} of {seen.runs} runs, the champion in {seen.others_broken}"
    if doubtful:
        told += f"; {doubtful} void runs of its own may be breakdowns too"
    if verdict == Decision.PASS:
        return f"{told}; a rate of breakdowns above {100 * (ruled_out or 0.0):.1f} % is ruled out"
    if verdict == Decision.FAIL:
        return f"{told}: surely more often"
    if seen.others_broken >= test.rate * seen.runs:
        return f"{told}: it cannot be judged by a champion that breaks down itself"
    sweep = clean_sweep(test.rate, test.alpha)
    runs, broken = seen.runs + doubtful, seen.broken + doubtful
    if runs < sweep:
        return f"{told}; fewer than {sweep} runs cannot rule out {100 * test.rate:g} %"
    told = f"{told}; {100 * test.rate:g} % are not ruled out"
    if broken >= test.rate * runs:
        return told
    return f"{told} before {test.needed(broken)} runs without a further breakdown"


def lap_question(margin: float, series: Series, pair: RunPair, errors: Errors) -> GateQuestion:
    """How much shorter the candidate's best lap is than the champion's from the same start.

    Only runs that both completed are compared: how often they do not is a question of its own.

    Args:
        margin: a share of the champion's lap.
    """
    test = errors.of_mean(100.0 * margin, series.most, errors.sweep)

    def judge(results: pl.DataFrame) -> GateAnswer | None:
        ours, theirs = (_runs(results, one.id, pl.col("best_lap_s"), NO_LAP.alias("broken")) for one in pair)
        both = ours.join(theirs, on="seed", suffix="_theirs").filter(~pl.col("void"), ~pl.col("void_theirs"))
        whole = both.filter(~pl.col("broken"), ~pl.col("broken_theirs"))
        if whole.is_empty():
            return None
        gains = 100.0 * (1.0 - whole["best_lap_s"] / whole["best_lap_s_theirs"])
        left = both.height - whole.height
        return mean_judged(
            test,
            Sample.of(gains.to_numpy(), least_deviation(test.margin)),
            f"{left} of {both.height} runs are not compared: one of the two broke down" if left else "",
        )

    return GateQuestion("lap time", "in % of the champion's", test.margin, series, judge)


def _runs(results: pl.DataFrame, entrant: str, *columns: pl.Expr) -> pl.DataFrame:
    """Some columns of the runs of one under test, after `seed`, and whether each is `void`."""
    own = results.filter(pl.col("match").is_in(_tested(results, entrant)))
    void = own.filter(is_void()).select(*RACE, void=True).unique()
    runs = entrant_rows(own).join(void, on=RACE, how="left")
    return runs.select("seed", *columns, pl.col("void").fill_null(value=False)).sort("seed")


def _tested(results: pl.DataFrame, entrant: str) -> list[str]:
    """Matches in which somebody is under test."""
    own = results.filter(pl.col("team") == TESTED, pl.col("entrant") == entrant)
    return own["match"].unique().to_list()


def test_question(
    margin: float,
    series: Series,
    pair: RunPair,
    skill: Skill,
    how: SkillMeasure,
    marks: Marks,
    errors: Errors,
) -> GateQuestion:
    """Points in a skill test, in the same runs; a run without a mark has none."""
    test = errors.of_mean(margin, series.most, errors.sweep)

    def judge(results: pl.DataFrame) -> GateAnswer | None:
        gained: dict[str, dict[int, float]] = {entrant.id: {} for entrant in pair}
        for match in results.partition_by("match", maintain_order=True):
            tested = match.filter(pl.col("team") == TESTED)["entrant"][0]
            seeds = dict(match.select("race", "seed").unique().iter_rows())
            for run, mark in skill.runs_of(match, how):
                gained[tested][seeds[run]] = float(marks.points(np.nan if mark is None else mark))
        ours, theirs = (gained[entrant.id] for entrant in pair)
        both = sorted(ours.keys() & theirs.keys())
        if not both:
            return None
        gains = np.array([ours[seed] - theirs[seed] for seed in both])
        return mean_judged(test, Sample.of(gains, least_deviation(margin)))

    return GateQuestion(skill.name, "in points", margin, series, judge)
