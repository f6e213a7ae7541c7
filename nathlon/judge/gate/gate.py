"""Running a gate: round after round, until every measure is decided or its budget is spent."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import polars as pl

from nathlon.arena.decision import Decision
from nathlon.arena.entrance import check_opponents
from nathlon.arena.entrant import Entrant
from nathlon.arena.results import POLICY_FAULTS, RESULTS, VOID_ENDINGS
from nathlon.arena.voids import MOST, void_races
from nathlon.arena.world_registry import home
from nathlon.judge.gate.action_time import action_finding
from nathlon.judge.gate.questions import (
    BROKEN,
    NO_LAP,
    Errors,
    GateAnswer,
    GateQuestion,
    at_fault_question,
    completion_question,
    lap_question,
    points_question,
    test_question,
)
from nathlon.judge.gate.series import Lost, RunPair, Series, race_series, trial_series
from nathlon.results.gate import Gated, GateFinding, GateReport
from nathlon.results.standing import ActionTime
from nathlon.results.summary import versions
from nathlon.results.voided import voided
from nathlon.selection.action_times import time_actions
from nathlon.selection.battery import marking_matches
from nathlon.selection.battery.measures import measured
from nathlon.selection.battery.skill import Marks, Skill, load_skills
from nathlon.selection.config import Config
from nathlon.selection.gate_settings import GateSettings
from nathlon.selection.round_robin import entered_there, plan
from nathlon.selection.run import DONE, GATE, Run
from nathlon.selection.trials import draw_seeds
from nathlon.sim.errors import InputError
from nathlon.tournament.non_inferiority import together

SEED = 7_041_776
"""Beside the configuration's, so that a gate shares no race with the selection that found the candidate: of
many, the one that was lucky there is put forward."""


@dataclass
class _Case:
    """A candidate under way.

    Attributes:
        asked: what is asked of it.
        results: RESULTS by series.
        failed: whether more runs ended by its fault than may.
        decided: by measure, what the units came to when they decided it.
    """

    pair: RunPair
    asked: list[GateQuestion]
    results: dict[int, pl.DataFrame] = field(default_factory=dict)
    failed: bool = False
    decided: dict[str, GateAnswer] = field(default_factory=dict)

    @property
    def open(self) -> list[GateQuestion]:
        """What is not decided yet; nothing once the candidate has failed."""
        if self.fails:
            return []
        return [question for question in self.asked if question.name not in self.decided]

    @property
    def fails(self) -> bool:
        """Whether nothing can save the candidate."""
        return self.failed or any(judged.verdict == Decision.FAIL for judged in self.decided.values())

    def lost(self) -> list[Lost]:
        """What is void, series by series."""
        series = {id(question.series): question.series for question in self.asked}
        return [series[key].lost(table) for key, table in self.results.items()]

    def endings(self, who: Entrant) -> pl.Series:
        """How the runs of one's cars ended."""
        own = [table.filter(pl.col("entrant") == who.id)["ending"] for table in self.results.values()]
        return pl.concat(own) if own else pl.Series(dtype=pl.String)

    def faults(self, who: Entrant) -> int:
        """How many of these by its fault."""
        return int(self.endings(who).is_in(POLICY_FAULTS).sum())


def run_gate(run: Run, champion: Entrant, candidates: Sequence[Entrant], config: Config) -> GateReport:
    """Ask of every candidate whether it may take the champion's place.

    Raises:
        InputError: if a candidate is the champion, a test is unknown, or nothing can be asked.
    """
    began = time.perf_counter()
    for candidate in candidates:
        if candidate.id == champion.id:
            raise InputError(f"{candidate.source}: is the champion, expected another policy")
    run.compile(config.world, config.circuit, config.car)
    tests = _tests(run, champion, config.gate)
    cases = [
        _Case(pair, _questions(run, pair, config, tests))
        for pair in (RunPair(candidate, champion) for candidate in candidates)
    ]
    if not cases[0].asked:
        raise InputError("section gate asks nothing here, expected points, tests, or lap with a time trial")
    settings = config.gate
    for begin in range(0, max(question.series.most for question in cases[0].asked), settings.block):
        if not _round(run, cases, slice(begin, begin + settings.block), settings):
            break
    times = time_actions(run, [one for case in cases for one in case.pair]) if settings.action_ms else {}
    tables = [table for case in cases for table in case.results.values()]
    return GateReport(
        champion=champion.name,
        champion_id=champion.id,
        circuit=config.circuit,
        car=config.car,
        world=config.world,
        seed=config.seed,
        alpha=settings.alpha,
        beta=settings.beta,
        races=sum(table.select(pl.struct("match", "race").n_unique()).item() for table in tables),
        void=sum(map(void_races, tables)),
        champion_faults=sum(case.faults(champion) for case in cases),
        champion_runs=sum(len(case.endings(champion)) for case in cases),
        champion_also=champion.also,
        otherwise=run.otherwise,
        wall_s=round(time.perf_counter() - began, 1),
        versions=versions(),
        candidates=tuple(_gated(case, settings, other_gates(run, case.pair), times) for case in cases),
    )


def _round(run: Run, cases: Sequence[_Case], units: slice, settings: GateSettings) -> bool:
    """Run some units of what is open, all in one go; tells whether there was anything to run."""
    wanted = [
        (number, series, series.matches(units))
        for number, case in enumerate(cases)
        for series in {id(question.series): question.series for question in case.open}.values()
        if units.start < series.most
    ]
    if not wanted:
        return False
    results = run.results(GATE, [match for _, _, matches in wanted for match in matches])
    for number, series, matches in wanted:
        keys = [match.key for match in matches]
        here = results.filter(pl.col("match").is_in(keys))
        before = cases[number].results.get(id(series), pl.DataFrame(schema=RESULTS))
        cases[number].results[id(series)] = pl.concat([before, here])
    for case in cases:
        _judge(case, settings)
    return True


def _judge(case: _Case, settings: GateSettings) -> None:
    """Decide what can be decided."""
    for question in case.open:
        judged = _judged(case, question, settings)
        if judged is not None and (judged.final or judged.verdict != Decision.CANNOT_TELL):
            case.decided[question.name] = judged
    case.failed = case.faults(case.pair.candidate) > settings.max_faults


def _judged(case: _Case, question: GateQuestion, settings: GateSettings) -> GateAnswer | None:
    results = case.results.get(id(question.series))
    return None if results is None else question.answer(results, settings.breakdowns or 0.0)


def other_gates(run: Run, pair: RunPair) -> int:
    """How many gates of the same two have ended in a run's store, with other seeds or settings."""
    gates = [record for record in run.store.runs() if record.name.startswith(f"{GATE}-")]
    own = {record.config["config"] for record in gates if record.name == run.name}
    others = set()
    for record in gates:
        champion, *candidates = record.config["entrants"]
        if record.status == DONE and champion == pair.champion.id and pair.candidate.id in candidates:
            others.add(record.config["config"])
    return len(others - own)


def _gated(
    case: _Case, settings: GateSettings, other_gates: int, times: Mapping[str, ActionTime | str]
) -> Gated:
    findings = [_finding(case, question, settings) for question in case.asked]
    # Where nothing is measured, nothing speaks for the candidate.
    measured = together([finding.verdict for finding in findings if finding.set_aside is None])
    counted = [_faults(case, settings)]
    if settings.action_ms is not None:
        counted.append(action_finding(case.pair, settings.action_ms, times))
    names = {one.id: one.name for one in case.pair}
    not_judged = [one for lost in case.lost() for one in lost.not_judged]
    not_judged.sort(key=lambda one: one.entrant != case.pair.candidate.id)
    return Gated(
        name=case.pair.candidate.name,
        entrant=case.pair.candidate.id,
        verdict=together([measured, *(finding.verdict for finding in counted)]),
        findings=(*findings, *counted),
        not_judged=voided(not_judged, names),
        also=case.pair.candidate.also,
        other_gates=other_gates,
    )


def _faults(case: _Case, settings: GateSettings) -> GateFinding:
    """The runs that ended by the candidate's fault; of most it has to be known how they ended."""
    candidate, champion = case.pair
    endings, faults = case.endings(candidate), case.faults(candidate)
    void = int(endings.is_in(VOID_ENDINGS).sum())
    verdict = Decision.CANNOT_TELL if void > MOST * len(endings) else Decision.PASS
    notes = []
    if void:
        notes.append(f"{void} more runs are void")
    if theirs := case.faults(champion):
        notes.append(f"{theirs} of {len(case.endings(champion))} runs of the champion ended by its own fault")
    return GateFinding(
        measure="faults",
        unit="in all",
        margin=None,
        difference=float(faults),
        units=len(endings) - void,
        void=void,
        verdict=Decision.FAIL if faults > settings.max_faults else verdict,
        note="; ".join(notes),
    )


def _finding(case: _Case, question: GateQuestion, settings: GateSettings) -> GateFinding:
    plain = GateFinding(
        measure=question.name, unit=question.unit, margin=question.margin, most=question.series.most
    )
    judged = case.decided.get(question.name) or _judged(case, question, settings)
    if judged is None:
        return plain.model_copy(update={"set_aside": "nothing of the kind is measured"})
    if judged.verdict == Decision.CANNOT_TELL:
        note = "; ".join(filter(None, (judged.note, _open(case, judged))))
        judged = judged._replace(note=note)
    told = judged._asdict()
    del told["final"]
    return plain.model_copy(update=told)


def _open(case: _Case, judged: GateAnswer) -> str:
    """Why there was no more to tell by; empty where its note says so already."""
    if case.fails:
        return "left open, as the candidate fails"
    if judged.needed is not None:
        return f"the budget is spent; if the difference stays as it is, about {judged.needed:,} units decide"
    return "" if judged.note else "the budget is spent, and no number of units decides such a difference"


def _questions(
    run: Run, pair: RunPair, config: Config, tests: Mapping[str, tuple[Skill, Marks]]
) -> list[GateQuestion]:
    """All that can be asked of a candidate."""
    settings, world = config.gate, home(pair.champion)
    errors = Errors(settings.alpha, settings.beta, settings.block, settings.breakdowns)
    races_from, trials_from = np.random.SeedSequence([*run.seeds_from, SEED]).spawn(2)
    asked: list[GateQuestion] = []
    event = config.tournament.held(config.circuit, config.car, config.world)
    if event.race and not (settings.points is None and settings.at_fault_per_km is None):
        fields = [entered_there(run.pool, pair, race.circuit, race.car) for race in event.race]
        fixtures = plan(event, fields, settings.pairs, races_from, {pair.champion.id})
        races = race_series(fixtures, settings.pairs)
        if settings.points is not None:
            asked.append(points_question(settings.points, races, pair, event.weights, errors))
        if settings.at_fault_per_km is not None:
            asked.append(at_fault_question(settings.at_fault_per_km, races, pair, errors))
    seeds = draw_seeds(trials_from, settings.runs)
    if config.pareto.time_trial is not None:
        laps = trial_series(config.pareto.time_trial, pair, [], [1], seeds)
        if settings.breakdowns is not None:
            asked.append(completion_question("completion", settings.breakdowns, laps, pair, NO_LAP, errors))
        if settings.lap is not None:
            asked.append(lap_question(settings.lap, laps, pair, errors))
    driven: dict[tuple[str, tuple[str, ...], tuple[int, ...]], Series] = {}
    for skill, marks in tests.values():
        how = measured(skill.measure, world)
        field = (skill.scenario, skill.opponents, skill.slots)
        if field not in driven:
            driven[field] = trial_series(
                skill.scenario, pair, skill.opponents, skill.slots, seeds, skill.in_order
            )
            if settings.breakdowns is not None and not skill.opponents:
                name = f"completion of {skill.name}"
                asked.append(
                    completion_question(name, settings.breakdowns, driven[field], pair, BROKEN, errors)
                )
        series = driven[field]
        asked.append(test_question(settings.test_points, series, pair, skill, how, marks, errors))
    return asked


def _tests(run: Run, champion: Entrant, settings: GateSettings) -> dict[str, tuple[Skill, Marks]]:
    """The skill tests that are asked for, with their marks.

    Raises:
        InputError: if one is unknown, has no room here, or its baseline fails in it.
    """
    world = home(champion)
    skills = load_skills(settings.tests, world)
    for skill in skills:
        world.check(skill.scenario)
        check_opponents(
            run.pool, [*skill.opponents, skill.baseline or world.baseline], champion, f"test {skill.name!r}"
        )
    own = marking_matches(skills, champion)
    results = run.results("battery", list(own.values()))
    found: dict[str, tuple[Skill, Marks]] = {}
    for skill in skills:
        how = measured(skill.measure, world)
        runs = skill.runs_of(results.filter(pl.col("match") == own[skill.name].key), how)
        marks = skill.marks(runs, how)
        if marks is None:
            raise InputError(f"test {skill.name!r}: its baseline fails too often, expected another test")
        found[skill.name] = skill, marks
    return found
