"""The selection from end to end: pareto -> battery -> committee -> tournament -> committee.

Every stage names its matches, has them run (or finds them in the store), and turns the table of
their results into its answer with a pure function.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any

import polars as pl

from nathlon.arena.entrant import Entrant, entrants_table
from nathlon.arena.results import RESULTS
from nathlon.arena.voids import NotJudged
from nathlon.arena.world_registry import load_world
from nathlon.policies.sources import is_path
from nathlon.policies.sources.identity import is_still
from nathlon.results.forecast import Forecast
from nathlon.results.standing import ActionTime
from nathlon.results.summary import Summary
from nathlon.selection.action_times import time_actions
from nathlon.selection.answers import StageAnswers, summarise
from nathlon.selection.battery import run_battery
from nathlon.selection.committee import ask
from nathlon.selection.committee.event_log import EventLog
from nathlon.selection.config import Config
from nathlon.selection.field import EntryList
from nathlon.selection.forecasting import earlier, forecast, habits_of
from nathlon.selection.incident.hold import hold_incidents
from nathlon.selection.pareto.filter import run_filter
from nathlon.selection.round_robin import leaders, ranked_by_tests, run_round_robin
from nathlon.selection.run import Answer, Run


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
    tables["battery"] = tables["battery"].with_columns(shortlisted=pl.col("entrant").is_in(listed.chosen))
    run.keep(tables)
    if listed.result is None:
        return None
    run.note("committee", len(survivors), len(listed.chosen), pl.DataFrame(schema=RESULTS), began)

    finalists = _together([e for e in survivors if e.id in listed.chosen], field.incumbents)
    anchors = {entrant.id for entrant in field.anchors}
    set_aside: dict[str, str] = {}
    raced: Answer
    if config.tournament.held(config.circuit, config.car, config.world).race:
        raced = run.with_those_there(
            _together(finalists, field.anchors),
            lambda those: run_round_robin(run, those, config.tournament, anchors)[0],
        )
        finalists = [entrant for entrant in finalists if entrant.id not in run.gone]
    else:
        set_aside["tournament"] = "no scenario has two sides; the ranking is that of the n-athlon"
        ranking = ranked_by_tests(tables["battery"], finalists)
        raced = Answer({"ranking": ranking}, leaders(finalists, ranking), tested.results, tested.not_judged)
    tables |= raced.tables
    run.keep(tables)
    times = [one for one in time_actions(run, finalists).values() if isinstance(one, ActionTime)]
    candidates = [e for e in _without(finalists, raced.not_judged) if e.id not in anchors]
    gone = [one for one in candidates if is_path(one.source) and not is_still(one.source, one.id)]
    candidates = [entrant for entrant in candidates if entrant not in gone]
    decision = ask(event_log, "selection", candidates, raced.tables, raced.results, config.committee)
    answers = StageAnswers(expected, filtered, tested, raced, set_aside, times, gone, decision)
    summary = summarise(run, field, config, answers)
    run.store.put_fact(run.name, "summary", summary.model_dump(mode="json"))
    return None if decision.result is None else summary


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
