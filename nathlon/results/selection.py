"""Everything that a report shows of one selection."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import polars as pl

from nathlon.arena.race_log import RaceLog
from nathlon.arena.results import RECORDS
from nathlon.results.summary import Sent, Summary

INCIDENT_HISTORY = pl.Schema(
    {
        "run": pl.String,
        "test": pl.String,
        "entrants": pl.Int64,  # that drove it
        "passed": pl.Int64,  # of them
        "sent_passed": pl.Boolean,  # whether the one sent did; null where nobody was sent
    }
)
"""One row a run and incident."""

ACTION_TIMES = pl.Schema(
    {
        "entrant": pl.String,
        "action_ms": pl.Float64,  # median of one seat
        "action_p99_ms": pl.Float64,  # 99th percentile
        "model_mb": pl.Float64,  # of the policy's files
    }
)
"""What an action of an entrant costs on the machine that has timed it; null of whoever was not timed."""


@dataclass(frozen=True)
class Previous:
    """The selection before, as far as one compares with it.

    Attributes:
        name: of its run.
        ended_at: UTC, ISO 8601; None where it has not ended.
        entrants: schema ENTRANTS.
        pool: schema RANKING, over its round robin and those before it.
        sent: by its committee.
    """

    name: str
    ended_at: str | None
    entrants: pl.DataFrame
    pool: pl.DataFrame
    sent: tuple[Sent, ...]


@dataclass(frozen=True)
class Selection:
    """The tables of one selection with the facts of its run.

    `tables` has the keys and schemas of `nathlon.arena.results.TABLES`, `results` that of
    `nathlon.arena.results.RESULTS`.

    Attributes:
        title: of the report.
        store: where the run is kept, as one names it to a command in the folder above the report.
        under_way: how far the run has come, in words; None if it has ended with a selection.
        logs: of the races to look at that are recorded.
        incident_history: schema INCIDENT_HISTORY, of the runs before.
        limit_s: fastest possible lap of the time trials, by optimal control, s; None where it is not known.
    """

    title: str
    tables: Mapping[str, pl.DataFrame]
    results: pl.DataFrame
    summary: Summary
    store: str
    under_way: str | None = None
    previous: Previous | None = None
    logs: tuple[RaceLog, ...] = ()
    limit_s: float | None = None
    incident_history: pl.DataFrame = field(default_factory=lambda: pl.DataFrame(schema=INCIDENT_HISTORY))

    @property
    def ranking(self) -> pl.DataFrame:
        """The table `ranking` with what the summary says besides: `nathlon.arena.results.RECORDS` and
        ACTION_TIMES.
        """
        told = [row.model_dump(include=set(RECORDS)) for row in self.summary.ranking]
        timed = [(one.entrant, one.median_ms, one.p99_ms, one.model_mb) for one in self.summary.action_times]
        ranking = self.tables["ranking"]
        for more in (
            pl.DataFrame(told, schema=RECORDS),
            pl.DataFrame(timed, schema=ACTION_TIMES, orient="row"),
        ):
            ranking = ranking.join(more, on="entrant", how="left", maintain_order="left")
        return ranking

    def named(self, table: str) -> pl.DataFrame:
        """A stage table with each entrant's card (`name`, `step`, ...) beside it; NaN becomes null."""
        found = self.ranking if table == "ranking" else self.tables[table]
        return found.join(self.tables["entrants"], on="entrant", how="left", maintain_order="left").fill_nan(
            None
        )
