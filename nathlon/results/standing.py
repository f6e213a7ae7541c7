"""How entrants stand at the end of a selection."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import polars as pl

from nathlon.results.part import ResultModel
from nathlon.results.ranks import written_rank


class Ranked(ResultModel):
    """An entrant of the round robin: a row of the table `ranking` (`nathlon.arena.results.RANKING`) with its
    name.

    Attributes:
        mean: points of its side, an episode that it played, with their interval; None of 4v4 races, and where
            nobody met.
        won, drawn, lost: shares of these episodes.
    """

    name: str
    entrant: str
    rank: int | None
    points_per_race: float | None
    points_low: float | None
    points_high: float | None
    contacts_per_km: float | None
    contacts_low: float | None
    contacts_high: float | None
    at_fault_per_km: float | None
    at_fault_low: float | None
    at_fault_high: float | None
    barred: bool
    pairs: int
    races: int
    faults: int
    mean: float | None = None
    mean_low: float | None = None
    mean_high: float | None = None
    won: float | None = None
    drawn: float | None = None
    lost: float | None = None
    worst_rank: int | None = None

    @property
    def written_rank(self) -> str:
        """Every rank that is possible, as text."""
        return written_rank(self.rank, self.worst_rank)


class Crossed(ResultModel):
    """A policy with a strategy, or one of them with all of the others; see STRATEGIES."""

    policy: str
    strategy: str
    entrant: str | None
    points: float
    points_low: float | None
    points_high: float | None
    effect: float
    effect_low: float | None
    effect_high: float | None
    units: int


class ActionTime(ResultModel):
    """What an action of an entrant costs on one machine; see `nathlon.arena.action_cost.ActionCost`.

    Attributes:
        machine: on which it was measured: name and kind of processor.
    """

    name: str
    entrant: str
    median_ms: float
    p99_ms: float
    actions: int
    model_bytes: int | None
    machine: str

    @property
    def written(self) -> str:
        """Median and 99th percentile, ms."""
        return f"{self.median_ms:.3f} / {self.p99_ms:.3f}"

    @property
    def model_mb(self) -> float | None:
        """Size of its files, MB."""
        return None if self.model_bytes is None else round(self.model_bytes / 1e6, 2)


def ranked(
    ranking: pl.DataFrame, names: Mapping[str, str], records: pl.DataFrame | None = None
) -> tuple[Ranked, ...]:
    """The rows of RANKING with those of RECORDS, given the names of the entrants by their ids."""
    if records is not None:
        ranking = ranking.join(records, on="entrant", how="left", maintain_order="left")
    return tuple(Ranked(name=names[row["entrant"]], **row) for row in ranking.to_dicts())


def timed_on(times: Sequence[ActionTime]) -> str:
    """A sentence on how actions were timed, and where; '' where none was."""
    if not times:
        return ""
    machines = ", ".join(dict.fromkeys(one.machine for one in times))
    counted = sorted({one.actions for one in times})
    actions = f"{counted[0]:,}" if len(counted) == 1 else f"{counted[0]:,} to {counted[-1]:,}"
    return (
        f"Median and 99th percentile of {actions} actions of one seat, on one thread of {machines}; "
        "model: the policy's files."
    )
