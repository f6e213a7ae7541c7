"""The nightly selection: what is new in the watched folders, against the best of the nights before."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from itertools import compress
from pathlib import Path
from typing import Any

import polars as pl

from nathlon.arena.entrance import check_world, enter_all, intact
from nathlon.arena.entrant import Entrant
from nathlon.arena.match import BACKGROUND
from nathlon.arena.pool import Pool
from nathlon.arena.results import RANKING
from nathlon.arena.store import RunRecord, Store
from nathlon.policies.sources.identity import policy_id
from nathlon.publishing.output import POLICY_LOG, OutputFolder
from nathlon.publishing.publish import publish
from nathlon.publishing.recordings import record_tournament
from nathlon.reports.selection import Selection
from nathlon.reports.summary import Summary
from nathlon.selection.config import Config
from nathlon.selection.engines import engine_of
from nathlon.selection.field import Exclusion, Field, newcomers, unjudged
from nathlon.selection.pipeline import select
from nathlon.selection.run import CONFIDENCE, DONE, WAITING, OnMatch, Run
from nathlon.sim.decisive import fingerprint
from nathlon.sim.errors import InputError
from nathlon.tournament.points import rank
from nathlon.tournament.stopping import repeated

NIGHT = "night-"
"""What the names of nights begin with in the store."""

ABANDONED = "abandoned"
"""Status of a night that cannot go on: its configuration, its files or the simulator have changed."""

NOT_JUDGED = "not_judged"
"""Fact of a night: ids of those that it could not judge."""
TRIES = 2
"""Nights that a newcomer has to be judged in: what makes most of its runs void may pass."""

OK, GATE, BAD_INPUT, HEALTH = 0, 1, 2, 3
"""Exit codes. Nobody was fit to be sent; the input was bad; too many faults to trust the night."""


@dataclass(frozen=True)
class Night:
    """How a night went.

    Attributes:
        name: of the run in the store; None where nothing was new.
        status: `done`, or `waiting` for people to vote.
        code: for the scheduler.
        reason: of the code, in a sentence.
        selection: what the report shows; None where nothing was new or people must vote first.
    """

    name: str | None
    status: str
    code: int
    reason: str
    selection: Selection | None


def nightly(config: Config, workers: int, on_match: OnMatch) -> Night:
    """Go on with the night that has not ended, or begin one with what is new.

    Processes that do this on one store at the same time share the work of one night. A night that has ended
    stays to be told until `told` says that it was: if its process was killed before, the next one tells it.

    Args:
        config: what to watch and how to select.
        workers: processes.
        on_match: told about progress.

    Raises:
        InputError: if a watched folder, the store or the engine cannot be used.
    """
    with Store(config.store) as store, Pool(workers) as pool:
        check_world(pool, config.world)
        config = config.suited
        untold = _untold(store)
        if untold:
            name, outcome = untold
            selection = publish(store, name, OutputFolder(Path(config.out) / name), pool, on_match)
            return Night(name, DONE, outcome["code"], outcome["reason"], selection)
        night, excluded = _open(store, config, pool)
        if night is None and excluded:
            return Night(None, DONE, HEALTH, f"All that is new was set aside: {excluded[0].reason}.", None)
        if night is None:
            return Night(None, DONE, OK, "Nothing is new.", None)
        field = _field(night.config)
        number = [record.name for record in _nights(store)].index(night.name)
        output = OutputFolder(Path(config.out) / night.name)
        pool.log.keep_in(output.root / POLICY_LOG)
        with engine_of(config, store, pool) as engine:
            run = Run(store, night.name, (config.seed, number), pool, on_match, other_engine=engine)
            if select(run, field, config) is None:
                store.end_run(night.name, WAITING)
                return Night(night.name, WAITING, OK, "The committee waits for its members to vote.", None)
            run.keep({"pool": _pool(store, night, run)})
            selection = publish(store, night.name, output, pool, on_match)
            if config.recordings == "all":
                record_tournament(store, night.name, output, engine, on_match)
        code, reason = judge(selection.summary, len(field.newcomers), config.nightly.max_fault_share)
        if missed := [one.entrant for one in selection.summary.not_judged]:
            store.put_fact(night.name, NOT_JUDGED, missed)
        store.put_fact(night.name, "outcome", {"code": code, "reason": reason, "told": False})
        store.end_run(night.name, DONE)
        return Night(night.name, DONE, code, reason, selection)


def awaited(config: Config, store: Store | None) -> tuple[int, int, int]:
    """How many newcomers, incumbents and anchors the next night would begin with, as far as files tell.

    Args:
        config: what it watches.
        store: where earlier nights are; None where there was none.

    Raises:
        InputError: if a watched path does not exist.
    """
    done = [] if store is None else [night for night in _nights(store) if night.status == DONE]
    anchors = {policy_id(anchor) for anchor in config.nightly.anchors}
    fields = [_field(night.config) for night in done]
    judged = set() if store is None else set(_judged(store, done))
    refused = {item.key for field in fields for item in field.excluded}
    new = unjudged(config.checkpoints, judged | anchors, refused)
    pool = set() if store is None or not done else set(store.table(done[-1].name, "pool")["entrant"])
    return len(set(new.values())), min(config.nightly.incumbents, len(pool - anchors)), len(anchors)


def told(config: Config, night: Night) -> None:
    """Note that a night has been told to whoever asked for it; the last thing to do before exiting."""
    if night.name is None or night.status != DONE:
        return
    with Store.open(config.store) as store:
        outcome = {"code": night.code, "reason": night.reason, "told": True}
        store.put_fact(night.name, "outcome", outcome)


def judge(summary: Summary, entered: int, max_fault_share: float) -> tuple[int, str]:
    """Exit code of a night that came to its end, and why."""
    if summary.not_judged:
        return HEALTH, summary.void_runs
    faulty = summary.faults + summary.void
    if faulty > max_fault_share * summary.car_runs:
        return HEALTH, f"{faulty:,} of {summary.car_runs:,} car runs ended by a fault."
    excluded = len(summary.excluded)
    if excluded > max_fault_share * (excluded + entered):
        return HEALTH, f"{excluded:,} of {excluded + entered:,} new files were set aside."
    if not summary.sent:
        return GATE, "Nobody passed the committee's gates."
    return OK, f"{summary.sent[0].name} is sent."


def _nights(store: Store) -> list[RunRecord]:
    return [record for record in store.runs() if record.name.startswith(NIGHT)]


def _untold(store: Store) -> tuple[str, dict[str, Any]] | None:
    """Name and outcome of the first night that has ended and was not told."""
    for night in _nights(store):
        if night.status == DONE:
            outcome: Any = store.facts(night.name).get("outcome") or {}
            # Nights of older versions do not say so.
            if not outcome.get("told", True):
                return night.name, outcome
    return None


def _open(store: Store, config: Config, pool: Pool) -> tuple[RunRecord | None, Sequence[Exclusion]]:
    """The night that has not ended if it can go on, a new one if there is something new, or None.

    And the new files that are set aside.
    """
    nights = _nights(store)
    for night in nights:
        if night.status in (DONE, ABANDONED):
            continue
        field = _field(night.config)
        if night.config["world"] == _world(config) and all(intact(pool, field.entrants)):
            return night, field.excluded
        store.end_run(night.name, ABANDONED)
    done = [night for night in nights if night.status == DONE]
    judged = _judged(store, done)
    anchors = _anchors(pool, config)
    known = judged | {anchor.id: anchor.name for anchor in anchors}
    refused = {item.key for night in done for item in _field(night.config).excluded}
    new, excluded = newcomers(
        pool, config.checkpoints, config.circuit, config.car, known, refused, config.world
    )
    if not new:
        return None, excluded
    incumbents = _incumbents(store, done, pool, config.nightly.incumbents, {anchor.id for anchor in anchors})
    field = Field(tuple(new), tuple(incumbents), anchors, tuple(excluded))
    plan = {"world": _world(config), "field": asdict(field)}
    try:
        return store.begin_run(f"{NIGHT}{len(nights) + 1:04d}", plan), excluded
    except InputError:
        # Another process has begun this night meanwhile, with what it found.
        return _open(store, config, pool)


def _judged(store: Store, done: Sequence[RunRecord]) -> dict[str, str]:
    """Names of the newcomers that nights have judged, by ids; who could not be judged has another night."""
    names: dict[str, str] = {}
    tries = Counter[str]()
    not_judged: Any = store.fact_of_runs(NOT_JUDGED)
    for night in done:
        missed = not_judged.get(night.name, ())
        for entrant in _field(night.config).newcomers:
            tries[entrant.id] += 1
            if entrant.id not in missed or tries[entrant.id] == TRIES:
                names[entrant.id] = entrant.name
    return names


def _world(config: Config) -> dict[str, str]:
    """What must stay the same within a night."""
    return {"config": config.digest, "code": fingerprint()}


def _field(plan: Mapping[str, Any]) -> Field:
    stored = plan["field"]
    groups = {
        name: tuple(Entrant(**entrant) for entrant in stored[name])
        for name in ("newcomers", "incumbents", "anchors")
    }
    return Field(**groups, excluded=tuple(Exclusion(**item) for item in stored["excluded"]))


def _anchors(pool: Pool, config: Config) -> tuple[Entrant, ...]:
    if not config.nightly.anchors:
        return ()
    return tuple(enter_all(pool, config.nightly.anchors, config.circuit, config.car, config.world))


def _incumbents(
    store: Store, done: list[RunRecord], pool: Pool, count: int, anchors: set[str]
) -> list[Entrant]:
    """The best of the last night's pool whose files are still there."""
    if not done:
        return []
    entrants = {e.id: e for night in done for e in _field(night.config).entrants}
    best = (
        store.table(done[-1].name, "pool")
        .drop_nulls("rank")
        .sort("rank", "points_per_race", descending=[False, True])
    )
    there = [entrants[id] for id in best["entrant"] if id in entrants and id not in anchors]
    return list(compress(there, intact(pool, there)))[:count]


def _pool(store: Store, night: RunRecord, run: Run) -> pl.DataFrame:
    """The ranking over the round robins of this night and of those before it in the same world.

    Its intervals hold on all of these nights together.
    """
    comparable = [
        record.name
        for record in _nights(store)
        if record.config["world"] == night.config["world"] and record.id <= night.id
    ]
    results = pl.concat([store.results_of_run(name, "tournament") for name in comparable])
    results = results.filter(pl.col("team") != BACKGROUND)
    if results.is_empty():
        return pl.DataFrame(schema=RANKING)
    return rank(results, run.rng("tournament"), confidence=repeated(CONFIDENCE, len(comparable)))
