"""The selection from end to end: pareto -> battery -> committee -> tournament -> committee.

Every stage names its matches, has them run (or finds them in the store), and turns the table of
their results into its answer with a pure function.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

import polars as pl

from nathlon.arena.entrant import Entrant, entrants_table
from nathlon.arena.results import POLICY_FAULTS, RESULTS, STRATEGIES, VOID_ENDINGS
from nathlon.arena.voids import NotJudged, most_void
from nathlon.arena.world_registry import load_world
from nathlon.policies.sources import is_path
from nathlon.policies.sources.identity import is_still
from nathlon.results.forecast import Forecast
from nathlon.results.summary import (
    ActionTime,
    Crossed,
    MostVoid,
    Sent,
    SetAside,
    Summary,
    TestMarks,
    ranked,
    versions,
    voided,
)
from nathlon.selection.action_times import time_actions
from nathlon.selection.battery import BatteryAnswer, run_battery
from nathlon.selection.committee import ask
from nathlon.selection.committee.decision import CommitteeDecision
from nathlon.selection.committee.event_log import EventLog
from nathlon.selection.config import Config
from nathlon.selection.field import EntryList
from nathlon.selection.forecasting import earlier, effect, forecast, habits_of
from nathlon.selection.incident.hold import hold_incidents
from nathlon.selection.pareto import lost_remark
from nathlon.selection.pareto.filter import run_filter
from nathlon.selection.round_robin import leaders, ranked_by_tests, run_round_robin
from nathlon.selection.run import CONFIDENCE, Answer, Run
from nathlon.sim.names import printable
from nathlon.tournament.points import pair_correlation
from nathlon.tournament.power import unit_deviation

GONE = "is gone or has changed since the selection began, so it could not be sent"
ALIKE = (
    "All mirrored pairs of the same two came out alike, so the intervals know of no chance. Where seeds have "
    "no effect (nathlon world check) they say nothing of other episodes."
)
ALIKE_DEVIATION = 1e-9
"""Points a race: what adding up in another order may leave of none."""


def run_pipeline(run: Run, field: EntryList, config: Config) -> Summary | None:
    """Run the whole selection into the store, going on from what is there already.

    Args:
        run: the selection under way.
        field: who takes part.
        config: how.

    Returns:
        what it came to, still without replays; None where the committee waits for people.
    """
    run.compile(config.world, config.circuit, config.car)
    event_log = EventLog(run.store, run.name)
    run.store.put_fact(run.name, "world", config.world)
    run.store.put_fact(run.name, "episode", load_world(config.world).episode)
    tables = {"entrants": entrants_table(field.entrants)}
    run.keep(tables)
    expected = _expected(run, field, config)

    filtered = run.with_those_there(
        _together(field.newcomers, field.incumbents), lambda those: run_filter(run, those, config.pareto)
    )
    incumbents = {entrant.id for entrant in field.incumbents}
    survivors = [entrant for entrant in filtered.entrants if entrant.id not in incumbents]
    tested = run.with_those_there(
        _together(survivors, field.incumbents), lambda those: run_battery(run, those, config.battery)
    )
    tables |= filtered.tables | tested.tables
    tables["incidents"] = run.with_those_there(
        tested.entrants, lambda those: hold_incidents(run, those, config.battery.incidents)
    )
    began = time.perf_counter()
    fit = [entrant for entrant in _without(survivors, tested.not_judged) if entrant.id not in run.gone]
    listed = ask(event_log, "shortlist", fit, tested.tables, tested.results, config.committee)
    tables["battery"] = tables["battery"].with_columns(shortlisted=pl.col("entrant").is_in(_chosen(listed)))
    run.keep(tables)
    if listed.result is None:
        return None
    run.note("committee", len(survivors), len(_chosen(listed)), pl.DataFrame(schema=RESULTS), began)

    finalists = _together([e for e in survivors if e.id in _chosen(listed)], field.incumbents)
    anchors = {entrant.id for entrant in field.anchors}
    set_aside: dict[str, str] = {}
    raced: Answer
    told: pl.DataFrame | None = None
    if config.tournament.held(config.circuit, config.car, config.world).race:
        met = run.with_those_there(
            _together(finalists, field.anchors),
            lambda those: run_round_robin(run, those, config.tournament, anchors)[0],
        )
        raced, told = met, met.records
        finalists = [entrant for entrant in finalists if entrant.id not in run.gone]
    else:
        set_aside["tournament"] = "no scenario has two sides; the ranking is that of the n-athlon"
        ranking = ranked_by_tests(tables["battery"], finalists)
        raced = Answer({"ranking": ranking}, leaders(finalists, ranking), tested.results, tested.not_judged)
    tables |= raced.tables
    run.keep(tables)
    times = time_actions(run, finalists)
    candidates = [e for e in _without(finalists, raced.not_judged) if e.id not in anchors]
    gone = [one for one in candidates if is_path(one.source) and not is_still(one.source, one.id)]
    candidates = [entrant for entrant in candidates if entrant not in gone]
    sent = ask(event_log, "selection", candidates, raced.tables, raced.results, config.committee)
    not_judged = list(dict.fromkeys([*filtered.not_judged, *tested.not_judged, *raced.not_judged]))
    summary = _summary(
        run, field, config, tables, tested, raced, told, sent, set_aside, expected, gone, not_judged
    ).model_copy(update={"action_times": tuple(one for one in times.values() if isinstance(one, ActionTime))})
    run.store.put_fact(run.name, "summary", summary.model_dump(mode="json"))
    return None if sent.result is None else summary


def _expected(run: Run, field: EntryList, config: Config) -> Forecast:
    """What was expected of a run before it began."""
    kept: Any = run.store.facts(run.name).get("forecast")
    if kept is not None:
        return Forecast.model_validate(kept)
    counts = len(field.newcomers), len(field.incumbents), len(field.anchors)
    habits = habits_of(earlier(run.store, config, run.name), config)
    expected = forecast(config, *counts, habits, run.engine.workers)
    run.store.put_fact(run.name, "forecast", expected.model_dump(mode="json"))
    return expected


def _together(*groups: Sequence[Entrant]) -> list[Entrant]:
    return list({entrant.id: entrant for group in groups for entrant in group}.values())


def _without(entrants: Sequence[Entrant], not_judged: Sequence[NotJudged]) -> list[Entrant]:
    left_out = {one.entrant for one in not_judged}
    return [entrant for entrant in entrants if entrant.id not in left_out]


def _chosen(decision: CommitteeDecision) -> list[str]:
    return [] if decision.result is None else list(decision.result.chosen)


def _summary(
    run: Run,
    field: EntryList,
    config: Config,
    tables: dict[str, pl.DataFrame],
    tested: BatteryAnswer,
    raced: Answer,
    records: pl.DataFrame | None,
    sent: CommitteeDecision,
    stages_set_aside: dict[str, str],
    expected: Forecast,
    gone: Sequence[Entrant],
    not_judged: Sequence[NotJudged],
) -> Summary:
    deviation = None if "tournament" in stages_set_aside else unit_deviation(raced.results)
    references = len(field.anchors)
    others = tables["ranking"].height - references
    world = load_world(config.world)
    by_score = not world.circuits and all(world.setup(name).points == "score" for name in world.scenarios)
    results = run.store.results_of_run(run.name)
    endings = results["ending"]
    names = {entrant.id: entrant.name for entrant in field.entrants}
    return Summary(
        stages=tuple(run.stages),
        ranking=ranked(tables["ranking"], names, records),
        sent=tuple(Sent(name=names[entrant], entrant=entrant) for entrant in _chosen(sent)),
        seed=config.seed,
        world=config.world,
        episode=world.episode,
        brings="score" if by_score else "points",
        circuit=config.circuit,
        car=config.car,
        versions=versions(),
        pair_correlation=pair_correlation(raced.results),
        unit_deviation=deviation,
        effect=None if deviation is None else effect(config, others, references, deviation),
        forecast=expected,
        confidence=CONFIDENCE,
        marks={
            test: TestMarks(
                base=marks.base,
                reference=marks.reference,
                asks=tested.asked[test],
                stretch_m=tested.stretches[test],
            )
            for test, marks in tested.marks.items()
        },
        tests_set_aside=tested.set_aside,
        car_runs=len(endings),
        faults=int(endings.is_in(POLICY_FAULTS).sum()),
        void=int(endings.is_in(VOID_ENDINGS).sum()),
        not_judged=voided(not_judged, names),
        most_void=_most_void(results, names),
        excluded=tuple(SetAside(**asdict(item)) for item in field.without(run.gone).excluded),
        gone=tuple(SetAside(source=printable(each.source), reason=GONE, digest=each.id) for each in gone),
        notes=remarks(field, deviation, run.otherwise, lost_remark(tables["pareto"])),
        also={
            entrant.name: tuple(map(printable, entrant.also)) for entrant in field.entrants if entrant.also
        },
        stages_set_aside=stages_set_aside,
        strategies=tuple(
            Crossed(**row) for row in tables.get("strategies", pl.DataFrame(schema=STRATEGIES)).to_dicts()
        ),
    )


def remarks(
    field: EntryList, deviation: float | None, otherwise: str = "", lost: str = ""
) -> tuple[str, ...]:
    """What is said of a run beside its verdict.

    Args:
        field: who took part.
        deviation: of a matchup's difference from unit to unit; None where nobody met twice.
        otherwise: what came otherwise when it was played again; '' where nothing did.
        lost: what the filter may have left aside; '' where that is little.
    """
    alike = ALIKE if deviation is not None and deviation < ALIKE_DEVIATION else ""
    return (*field.notes, *filter(None, (alike, otherwise, lost)))


def _most_void(results: pl.DataFrame, names: dict[str, str]) -> MostVoid | None:
    found = most_void(results, names)
    if found is None:
        return None
    entrant, void, races = found
    return MostVoid(name=names[entrant], entrant=entrant, void=void, races=races)
