"""The work on a store: who runs matches, what waits, what a night is at, and what nights have come to."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import UTC, datetime, timedelta
from typing import Any

import polars as pl

from nathlon.arena.claimant import AtWork, at_work
from nathlon.arena.control import control
from nathlon.arena.store import RunRecord, Store
from nathlon.arena.store.queue import COUNTED
from nathlon.results.forecast import Forecast
from nathlon.results.part import ResultModel
from nathlon.results.summary import Summary
from nathlon.selection.nightly.night import NIGHT
from nathlon.selection.run import STAGES


class WaitingMatches(ResultModel):
    """Matches in the queue that can share a world.

    Attributes:
        surroundings: digest by which they can be put first.
        world, circuit, car, scenario: of them; '' where the queue's entry is damaged.
        matches: that wait; of more than 10,000 no exact number is known.
        first: whether they go before others.
    """

    surroundings: str
    world: str
    circuit: str
    car: str
    scenario: str
    matches: int
    first: bool


class RunUnderWay(ResultModel):
    """What a run that has not ended is at.

    Attributes:
        stage: that it is in, and how many of its matches are done; '' before the first.
        ends_at: when its verdict is expected, UTC, ISO 8601; None where nothing tells.
    """

    name: str
    began_at: str
    stage: str
    done: int
    total: int
    ends_at: str | None


class WorkState(ResultModel):
    """The work on a store at this moment.

    Attributes:
        paused: whether nobody begins a match.
        by, at: who has said so last, or what goes first; '' and None where nobody has.
        under_way: the run that began last, unless it has ended.
    """

    paused: bool
    by: str
    at: str | None
    workers: tuple[AtWork, ...]
    queue: tuple[WaitingMatches, ...]
    under_way: RunUnderWay | None


class SentPoints(ResultModel):
    """Who was sent, and its points a race with their interval, in the pool of all nights if it is there."""

    name: str
    entrant: str
    points: float | None
    low: float | None
    high: float | None


class NightRecord(ResultModel):
    """What a run came to.

    Attributes:
        reason: of its outcome, in a sentence; '' where there is none yet.
        car_runs, faults, void: runs of cars, and how many ended by a policy's fault, or are void.
    """

    name: str
    began_at: str
    ended_at: str | None
    status: str
    reason: str
    sent: tuple[SentPoints, ...]
    car_runs: int
    faults: int
    void: int


def work_state(store: Store) -> WorkState:
    """What is at work now."""
    said, workers = control(store), at_work(store)
    return WorkState(
        paused=said.paused,
        by=said.by,
        at=said.at,
        workers=tuple(workers),
        queue=tuple(
            _waiting(store, digest, count, said.first) for digest, count in store.waiting(COUNTED).items()
        ),
        under_way=_under_way(store, workers),
    )


def night_records(store: Store) -> list[NightRecord]:
    """What all nights came to, the last first; of a store without nights, all its selections."""
    records = store.runs()
    nights = [record for record in records if record.name.startswith(NIGHT)] or records
    summaries: Any = store.fact_of_runs("summary")
    outcomes: Any = store.fact_of_runs("outcome")
    return [
        _night(store, record, summaries.get(record.name), outcomes.get(record.name) or {})
        for record in reversed(nights)
    ]


def _waiting(store: Store, digest: str, matches: int, first: str | None) -> WaitingMatches:
    try:
        told = store.surroundings(digest)
    except KeyError:
        told = None
    facts = told if isinstance(told, dict) else {}
    named = {name: str(facts.get(name, "")) for name in ("world", "circuit", "car", "scenario")}
    return WaitingMatches(surroundings=digest, matches=matches, first=digest == first, **named)


def _under_way(store: Store, workers: Sequence[AtWork]) -> RunUnderWay | None:
    records = store.runs()
    if not records or records[-1].ended_at is not None:
        return None
    record, facts = records[-1], dict[str, Any](store.facts(records[-1].name))
    at = facts.get("progress") or {"stage": "", "done": 0, "total": 0}
    left_s = _left_s(facts.get("forecast"), at, sum(one.processes for one in workers))
    ends = None
    if left_s is not None:
        ends = (datetime.now(UTC) + timedelta(seconds=left_s)).isoformat(timespec="seconds")
    return RunUnderWay(
        name=record.name,
        began_at=record.began_at,
        ends_at=ends,
        **at,
    )


def _left_s(told: Any, at: dict[str, Any], processes: int) -> float | None:
    """What is left of a forecast, s; None where it knows no times, or nobody works."""
    if told is None or not processes or at["stage"] not in STAGES:
        return None
    stages = {one.name: one.core_s for one in Forecast.model_validate(told).stages}
    left = [stages.get(name) for name in STAGES[STAGES.index(at["stage"]) :]]
    if None in left:
        return None
    here, *later = (time for time in left if time is not None)
    share = 1.0 - at["done"] / at["total"] if at["total"] else 1.0
    return (here * share + sum(later)) / processes


def _night(store: Store, record: RunRecord, told: Any, outcome: dict[str, Any]) -> NightRecord:
    summary = None if told is None else Summary.model_validate(told)
    pool = store.table(record.name, "pool") if summary and summary.sent else pl.DataFrame()
    ranked = store.table(record.name, "ranking") if pool.is_empty() and summary else pool
    points = {row["entrant"]: row for row in ranked.iter_rows(named=True)}
    none: dict[str, Any] = {}
    return NightRecord(
        name=record.name,
        began_at=record.began_at,
        ended_at=record.ended_at,
        status=record.status,
        reason=outcome.get("reason", ""),
        sent=tuple(
            SentPoints(
                name=one.name,
                entrant=one.entrant,
                points=points.get(one.entrant, none).get("points_per_race"),
                low=points.get(one.entrant, none).get("points_low"),
                high=points.get(one.entrant, none).get("points_high"),
            )
            for one in (summary.sent if summary else ())
        ),
        car_runs=summary.car_runs if summary else 0,
        faults=summary.faults if summary else 0,
        void=summary.void if summary else 0,
    )
