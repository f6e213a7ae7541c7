"""The nightly selection: what is new in the watched folders, against the best of the nights before."""

from __future__ import annotations

from collections import Counter
from collections.abc import Container, Sequence
from dataclasses import asdict, dataclass, replace
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import polars as pl

from nathlon.arena.entrance import check_world, enter_all, intact
from nathlon.arena.entrant import Entrant
from nathlon.arena.pool import Pool
from nathlon.arena.store import RunRecord, Store
from nathlon.arena.world_registry import load_world
from nathlon.policies.sources import is_path
from nathlon.policies.sources.identity import policy_id
from nathlon.results.selection import Selection
from nathlon.results.summary import SetAside, Summary
from nathlon.selection.config import Config
from nathlon.selection.engines import engine_of
from nathlon.selection.field import EntryList
from nathlon.selection.nightly.incumbents import incumbents, located
from nathlon.selection.nightly.newcomers import newcomers
from nathlon.selection.nightly.pool import best_first, rank_nights
from nathlon.selection.nightly.promise import Choice, Promising, promise_of_runs
from nathlon.selection.nightly.retention import thin_out
from nathlon.selection.nightly.teller import claim, drop
from nathlon.selection.nightly.watching import Watched, watch
from nathlon.selection.pipeline import run_pipeline
from nathlon.selection.publish.output import POLICY_LOG, OutputFolder
from nathlon.selection.publish.publish import publish
from nathlon.selection.publish.recordings import record_tournament
from nathlon.selection.publish.sent import keep_sent
from nathlon.selection.run import DONE, OPENED, WAITING, OnMatch, Run
from nathlon.sim.decisive import fingerprint
from nathlon.sim.errors import InputError
from nathlon.sim.whole_file import check_output

NIGHT = "night-"
"""What the names of nights begin with in the store."""

EXCLUSION = "exclusion"
"""Kind of log entry: a file that was set aside on a night without newcomers, which is no run."""

ABANDONED = "abandoned"
"""Status of a night that cannot go on: its configuration, its files or the simulator have changed."""

OUTCOME = "outcome"
"""Fact of a night that has ended: `code` and `reason`, and whether they were `told`."""
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
        excluded: what was set aside where nothing else was new.
        told_elsewhere: whether another process that shares the store tells it.
    """

    name: str | None
    status: str
    code: int
    reason: str
    selection: Selection | None
    excluded: tuple[SetAside, ...] = ()
    told_elsewhere: bool = False

    @property
    def counts(self) -> bool:
        """Whether there is something to tell once: a selection, or files that were set aside."""
        return self.status == DONE and (self.name is not None or bool(self.excluded))


def nightly(config: Config, workers: int, on_match: OnMatch, most: int | None = None) -> Night:
    """Go on with the night that has not ended, or begin one with what is new.

    Processes that do this on one store at the same time share the work of one night. A night that has ended
    stays to be told until `told` says that it was: one of them tells it, and if that was killed before, the
    next one.

    Args:
        config: what to watch and how to select.
        workers: processes.
        on_match: told about progress.
        most: newcomers that are judged, the most promising ones; all by default.

    Raises:
        InputError: if a watched folder, the store or the engine cannot be used, a watched folder is empty in
            which earlier nights found checkpoints, or what is to be sent is gone.
    """
    check_output(Path(config.out))
    with Store(config.store) as store, Pool(workers) as pool:
        check_world(pool, config.world)
        config = config.suited
        if (days := config.nightly.keep_days) is not None:
            thin_out(store, _nights(store), Path(config.out), days, datetime.now(UTC))
        untold = _untold(store)
        if untold:
            name, outcome = untold
            selection = publish(store, name, OutputFolder(Path(config.out) / name), pool, on_match)
            tells = _tells(store, name)  # still: publishing may have taken long
            return Night(name, DONE, outcome["code"], outcome["reason"], selection, (), not tells)
        watched = watch(config.checkpoints, load_world(config.world).loaders)
        found = _look(store, config, pool, watched, on_match, most)
        if found.night is None and not found.field.newcomers:
            return _quiet(store, found.field)
        # First: a night that cannot have its engine does not begin.
        with engine_of(config, store, pool) as engine:
            night, field = _begin(store, config, pool, watched, found, on_match, most)
            if night is None:
                return _quiet(store, field)
            number = [record.name for record in _nights(store)].index(night.name)
            output = OutputFolder(Path(config.out) / night.name)
            pool.log.keep_in(output.root / POLICY_LOG)
            run = Run(store, night.name, (config.seed, number), pool, on_match, other_engine=engine)
            if run_pipeline(run, field, config) is None:
                store.end_run(night.name, WAITING)
                return Night(night.name, WAITING, OK, "The committee waits for its members to vote.", None)
            # At once: what is kept can be sent whatever becomes of the file.
            keep_sent(store, night.name, output)
            run.keep(rank_nights(store, _nights(store), night, config.nightly.incumbents))
            selection = publish(store, night.name, output, pool, on_match)
            if config.recordings == "all":
                record_tournament(store, night.name, output, engine, on_match)
            entered = len(field.without(run.gone).newcomers)
            code, reason = judge(selection.summary, entered, config.nightly.max_fault_share)
            if missed := [*run.gone, *(one.entrant for one in selection.summary.not_judged)]:
                store.put_fact(night.name, NOT_JUDGED, missed)
            tells = _tells(store, night.name)
            if tells:
                store.put_fact(night.name, OUTCOME, {"code": code, "reason": reason, "told": False})
                store.end_run(night.name, DONE)
            return Night(night.name, DONE, code, reason, selection, (), not tells)


def awaited(config: Config, store: Store | None) -> tuple[int, int, int]:
    """How many newcomers, incumbents and anchors the next night would begin with, as far as files tell.

    Args:
        config: what it watches.
        store: where earlier nights are; None where there was none.

    Raises:
        InputError: if a watched path does not exist.
    """
    done = [] if store is None else [night for night in _nights(store) if night.status == DONE]
    fields = [EntryList.from_plan(night.config) for night in done]
    anchors = {policy_id(anchor) for anchor in config.nightly.anchors}
    judged = set() if store is None else set(_judged(store, done))
    refused = set() if store is None else _refused(store, fields)
    new = watch(config.checkpoints, load_world(config.world).loaders).unjudged(judged | anchors, refused)
    pool = set() if store is None or not done else set(store.table(done[-1].name, "pool")["entrant"])
    return len(set(new.values()) - {None}), min(config.nightly.incumbents, len(pool - anchors)), len(anchors)


def told(config: Config, night: Night) -> None:
    """Note that a night has been told to whoever asked for it; the last thing to do before exiting."""
    if night.told_elsewhere or not night.counts:
        return
    with Store.open(config.store) as store:
        for item in night.excluded:
            store.append(EXCLUSION, asdict(item))
        if night.name is not None:
            outcome = {"code": night.code, "reason": night.reason, "told": True}
            store.put_fact(night.name, OUTCOME, outcome)
        drop(store, night.name)


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
        lost = "".join(f" {item.source} {item.reason}." for item in summary.gone)
        return GATE, f"Nobody passed the committee's gates.{lost}"
    return OK, f"{summary.sent[0].name} is sent."


def _quiet(store: Store, field: EntryList) -> Night:
    """A night on which there is nobody new; what was set aside is for one process to tell."""
    if field.excluded:
        reason = f"All that is new was set aside: {field.excluded[0].reason}."
        tells = claim(store, None)
        if tells and {item.key for item in field.excluded} <= _refused(store, ()):  # told since it was looked
            drop(store, None)
            tells = False
        return Night(None, DONE, HEALTH, reason, None, field.excluded if tells else ())
    reason = " ".join(["Nothing is new:", *field.notes]) if field.notes else "Nothing is new."
    return Night(None, DONE, OK, reason, None)


def _nights(store: Store) -> list[RunRecord]:
    return [record for record in store.runs() if record.name.startswith(NIGHT)]


def _untold(store: Store) -> tuple[str, dict[str, Any]] | None:
    """Name and outcome of the first night that has ended, was not told, and is for this process to tell."""
    outcomes: Any = store.fact_of_runs(OUTCOME)
    for night in _nights(store):
        outcome = outcomes.get(night.name) or {}
        # Nights of older versions do not say so.
        if night.status == DONE and not outcome.get("told", True) and _tells(store, night.name):
            return night.name, outcome
    return None


def _tells(store: Store, night: str) -> bool:
    """Whether this process is to tell a night: no other one does, or has."""
    if not claim(store, night):
        return False
    outcome: Any = store.facts(night).get(OUTCOME) or {}
    return not outcome.get("told", False)


class _Found(NamedTuple):
    """What there is to do.

    Attributes:
        night: that has not ended and can go on; None where there is none.
        field: who takes part in it, or else in a new one; without newcomers there is none, and what is set
            aside is new.
        name: of a new one.
    """

    night: RunRecord | None
    field: EntryList
    name: str


def _begin(
    store: Store,
    config: Config,
    pool: Pool,
    watched: Watched,
    found: _Found,
    on_match: OnMatch,
    most: int | None,
) -> tuple[RunRecord | None, EntryList]:
    """The night that has been found, or else a new one; None if others have done meanwhile what was new."""
    while found.night is None and found.field.newcomers:
        plan = {"world": _world(config), "field": asdict(found.field)}
        try:
            return store.begin_run(found.name, plan), found.field
        except InputError:
            # Another process has begun this night meanwhile, with what it found.
            found = _look(store, config, pool, watched, on_match, most)
    return found.night, found.field


def _look(
    store: Store, config: Config, pool: Pool, watched: Watched, on_match: OnMatch, most: int | None
) -> _Found:
    """See what there is to do."""
    nights = _nights(store)
    name = f"{NIGHT}{len(nights) + 1:04d}"
    for night in nights:
        if night.status in (DONE, ABANDONED):
            continue
        field = _there(EntryList.from_plan(night.config), config, watched, pool)
        if night.config["world"] == _world(config) and field:
            return _Found(night, field, name)
        store.end_run(night.name, ABANDONED)
    done = [night for night in nights if night.status == DONE]
    fields = [EntryList.from_plan(night.config) for night in done]
    judged = _judged(store, done)
    anchors = _anchors(pool, config)
    known = judged | {anchor.id: anchor.name for anchor in anchors}
    refused = _refused(store, fields)
    where, opened = (config.circuit, config.car), partial(on_match, OPENED)
    choose: Choice = list if most is None else Promising(most, promise_of_runs(store, done))
    new, excluded = newcomers(pool, watched, *where, known, refused, config.world, opened, choose)
    notes = tuple(f"{folder} holds no checkpoint." for folder in watched.empty)
    if not new:
        if not excluded:
            _check_full(watched, fields)
        return _Found(None, EntryList((), anchors=anchors, excluded=tuple(excluded), notes=notes), name)
    best: list[Entrant] = []
    missing: tuple[str, ...] = ()
    if done:
        ranked = _ranked(store.table(done[-1].name, "pool"), fields, {anchor.id for anchor in anchors})
        best, missing = incumbents(pool, ranked, config.nightly.incumbents, watched, Path(config.out))
    return _Found(
        None, EntryList(tuple(new), tuple(best), anchors, tuple(excluded), (*notes, *missing)), name
    )


def _check_full(watched: Watched, fields: Sequence[EntryList]) -> None:
    """Raise InputError for an empty folder in which earlier nights found checkpoints."""
    for folder in watched.empty:
        sources = [Path(one.source) for field in fields for one in field.newcomers if is_path(one.source)]
        if any(source.is_relative_to(folder) for source in sources):
            raise InputError(
                f"{folder}: holds no checkpoint any more, expected those that earlier nights have judged"
            )


def _refused(store: Store, fields: Sequence[EntryList]) -> set[str]:
    """Keys of what was set aside before, on nights with newcomers and on others."""
    alone = [SetAside(**entry.entry) for entry in store.log(EXCLUSION)]
    return {item.key for field in fields for item in field.excluded} | {item.key for item in alone}


def _there(field: EntryList, config: Config, watched: Watched, pool: Pool) -> EntryList | None:
    """The field of a night under way with the places where its files lie now.

    Those that are gone or have changed stay in it for the stages to set aside. None if no newcomer is there,
    or one is there that cannot be opened any more.
    """
    places = {
        entrant.id: found
        for entrant in field.entrants
        if (found := located(entrant, watched, Path(config.out))) is not None
    }
    if not any(entrant.id in places for entrant in field.newcomers) or not all(
        intact(pool, list(places.values()))
    ):
        return None
    newcomers, incumbents, anchors = (
        tuple(places.get(entrant.id, entrant) for entrant in group)
        for group in (field.newcomers, field.incumbents, field.anchors)
    )
    return replace(field, newcomers=newcomers, incumbents=incumbents, anchors=anchors)


def _judged(store: Store, done: Sequence[RunRecord]) -> dict[str, str]:
    """Names of the newcomers that nights have judged, by ids; who could not be judged has another night."""
    names: dict[str, str] = {}
    tries = Counter[str]()
    not_judged: Any = store.fact_of_runs(NOT_JUDGED)
    for night in done:
        missed = not_judged.get(night.name, ())
        for entrant in EntryList.from_plan(night.config).newcomers:
            tries[entrant.id] += 1
            if entrant.id not in missed or tries[entrant.id] == TRIES:
                names[entrant.id] = entrant.name
    return names


def _world(config: Config) -> dict[str, str]:
    """What must stay the same within a night."""
    return {"config": config.digest, "code": fingerprint()}


def _anchors(pool: Pool, config: Config) -> tuple[Entrant, ...]:
    if not config.nightly.anchors:
        return ()
    return tuple(enter_all(pool, config.nightly.anchors, config.circuit, config.car, config.world))


def _ranked(ranking: pl.DataFrame, fields: Sequence[EntryList], anchors: Container[str]) -> list[Entrant]:
    """The entrants of earlier nights in the order of the pool, without anchors."""
    entrants = {entrant.id: entrant for field in fields for entrant in field.entrants}
    return [entrants[one] for one in best_first(ranking) if one in entrants and one not in anchors]
