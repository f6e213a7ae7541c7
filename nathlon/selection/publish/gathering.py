"""What the store holds of a run, put together for a report."""

from __future__ import annotations

from collections import Counter
from typing import Any

import polars as pl

from nathlon.arena.results import POLICY_FAULTS, TABLES, VOID_ENDINGS
from nathlon.arena.store import RunRecord, Store
from nathlon.results.selection import Previous, Selection
from nathlon.results.standing import ranked
from nathlon.results.summary import Summary, versions
from nathlon.results.words import stage_called
from nathlon.selection.committee.decision import describe
from nathlon.selection.committee.event_log import EventLog
from nathlon.selection.incident.history import incident_history
from nathlon.selection.publish.laps import lap_limit
from nathlon.selection.run import CONFIDENCE, DONE


def gather(store: Store, run: str) -> Selection:
    """All that a run's report shows but races to look at, as far as the run has come."""
    tables = {name: store.table(run, name) for name in TABLES}
    results = store.results_of_run(run)
    summary, under_way = _summary(store, run, tables, results)
    summary = summary.model_copy(update={"processors": _processors(store, results)})
    return Selection(
        " · ".join(filter(None, [run, summary.circuit or summary.world, summary.car])),
        tables,
        results,
        summary,
        store.name,
        under_way,
        _previous(store, run),
        limit_s=lap_limit(store, run),
        incident_history=incident_history(store, run),
    )


def _processors(store: Store, results: pl.DataFrame) -> dict[str, int]:
    """How many matches each kind of processor has run, the most first."""
    ran_on = store.processors(results["match"].unique().to_list()).values()
    return dict(Counter(kind or "unknown" for kind in ran_on).most_common())


def _summary(
    store: Store, run: str, tables: dict[str, pl.DataFrame], results: pl.DataFrame
) -> tuple[Summary, str | None]:
    """The run's summary, and how far it has come if it has not ended with one."""
    known: Any = store.facts(run)
    decisions = EventLog(store, run).decisions().values()
    found = known.get("summary")
    summary = Summary.model_validate(found) if found else _so_far(store, run, tables, results)
    summary = summary.model_copy(update={"committee": tuple(map(describe, decisions))})
    waits = [str(decision.opened.question) for decision in decisions if decision.result is None]
    if waits:
        return summary, f"the committee is asked about the {waits[-1]}"
    if "summary" in known:
        return summary, None
    record = next(record for record in store.runs() if record.name == run)
    if record.ended_at is not None:
        return summary, "ended without a selection" if record.status == DONE else record.status
    progress = known.get("progress", {"stage": "pareto", "done": 0, "total": 0})
    stage = stage_called(progress["stage"])
    return summary, f"under way: {stage}, {progress['done']:,} of {progress['total']:,} matches"


def _so_far(store: Store, run: str, tables: dict[str, pl.DataFrame], results: pl.DataFrame) -> Summary:
    """What the summary of a run says before its end."""
    names = dict(tables["entrants"].select("entrant", "name").iter_rows())
    known: Any = store.facts(run)
    plan = next(record.config for record in store.runs() if record.name == run)
    card = next(tables["entrants"].iter_rows(named=True), {"circuit": "", "car": ""})
    return Summary(
        stages=(),
        ranking=ranked(tables["ranking"], names),
        sent=(),
        seed=None,
        **{name: known[name] for name in ("world", "episode") if name in known},
        circuit=card["circuit"],
        car=card["car"],
        versions=versions(),
        pair_correlation=None,
        confidence=CONFIDENCE,
        marks={},
        tests_set_aside={},
        car_runs=results.height,
        faults=int(results["ending"].is_in(POLICY_FAULTS).sum()),
        void=int(results["ending"].is_in(VOID_ENDINGS).sum()),
        excluded=plan.get("field", {}).get("excluded", ()),
    )


def _previous(store: Store, run: str) -> Previous | None:
    """The last run before this one, of the same kind, that came to its end."""
    records = store.runs()
    own = next(record for record in records if record.name == run)
    before = [record for record in records if record.id < own.id and _kind(record) == _kind(own)]
    for record in reversed(before):
        summary: Any = store.facts(record.name).get("summary")
        if summary is not None:
            pool = store.table(record.name, "pool")
            return Previous(
                record.name,
                record.ended_at,
                store.table(record.name, "entrants"),
                store.table(record.name, "ranking") if pool.is_empty() else pool,
                tuple(Summary.model_validate(summary).sent),
            )
    return None


def _kind(record: RunRecord) -> str:
    return record.name.partition("-")[0]
