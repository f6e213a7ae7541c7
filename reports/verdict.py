"""Who to send and why, in words that claim no more than the intervals support."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import polars as pl

from reports.selection import Selection

Row = dict[str, Any]


@dataclass(frozen=True)
class Verdict:
    """A headline and at most three sentences."""

    headline: str
    sentences: tuple[str, ...]


def verdict(selection: Selection) -> Verdict:
    """What the last stage that anybody reached says about whom to send."""
    ranking = selection.named("ranking").drop_nulls("points_per_race")
    confidence = f"{selection.summary['confidence']:.0%} interval"
    if not ranking.is_empty():
        leaders = _first(ranking, "points_per_race")
        if len(leaders) > 1:
            return _tie(leaders, confidence)
        return _winner(leaders[0], ranking.height, confidence)
    if not selection.tables["battery"].is_empty():
        return _battery_only(selection, confidence)
    return _nobody(selection.tables["pareto"])


def _first(table: pl.DataFrame, points: str) -> list[Row]:
    first = table.filter(pl.col("rank") == pl.col("rank").min())
    return first.sort([points, "name"], descending=[True, False]).to_dicts()


def _winner(row: Row, entrants: int, confidence: str) -> Verdict:
    comparison = (
        "; its interval lies above that of every other finalist."
        if entrants > 1
        else ". It was the only finalist, so no comparison supports the choice."
    )
    return Verdict(
        f"Send {row['name']}",
        (f"{row['name']} scored {_points(row, confidence)}{comparison}", _manners(row)),
    )


def _tie(leaders: Sequence[Row], confidence: str) -> Verdict:
    leader = leaders[0]
    names = [row["name"] for row in leaders]
    headline = f"Send {_listed(names, 'or')}" if len(names) < 4 else f"{len(names)} entrants tie for first"
    return Verdict(
        headline,
        (
            f"{_listed(names, 'and')} share first place: their intervals overlap, "
            "so these races do not tell which is best.",
            f"{leader['name']} has the highest estimate, {_points(leader, confidence)}{_contacts(leader)}"
            f"{_faults(leader)}.",
            _calmest(leaders),
        ),
    )


def _points(row: Row, confidence: str) -> str:
    low, high = row["points_low"], row["points_high"]
    interval = "" if low is None or high is None else f" ({confidence} {low:.1f}–{high:.1f})"
    return f"{row['points_per_race']:.1f} team points a race{interval} in {row['races']:,} races"


def _faults(row: Row) -> str:
    return f", though {row['faults']:,} of its car runs ended by its own fault" if row["faults"] else ""


def _rate(row: Row) -> str:
    low, high = row["contacts_low"], row["contacts_high"]
    interval = "" if low is None or high is None else f" ({low:.2f}–{high:.2f})"
    return f"{row['contacts_per_km']:.2f} times a kilometre{interval}"


def _contacts(row: Row) -> str:
    return "" if row["contacts_per_km"] is None else f", touching others {_rate(row)}"


def _manners(row: Row) -> str:
    if row["contacts_per_km"] is None:
        return f"Its contact rate is not known{_faults(row)}."
    return f"Its cars touched others {_rate(row)}{_faults(row)}."


def _calmest(leaders: Sequence[Row]) -> str:
    rated = sorted(
        (
            row
            for row in leaders
            if None not in (row["contacts_per_km"], row["contacts_low"], row["contacts_high"])
        ),
        key=lambda row: row["contacts_per_km"],
    )
    if len(rated) < len(leaders):
        return "Their contact rates are not all known."
    calmest, others = rated[0], rated[1:]
    if all(calmest["contacts_high"] < other["contacts_low"] for other in others):
        return (
            f"Of these, {calmest['name']} touches others least: {_rate(calmest)}, an interval below the rest."
        )
    return (
        f"Contacts do not settle it: {calmest['name']} has the lowest estimate, {_rate(calmest)}, "
        "and that interval overlaps with another's."
    )


def _battery_only(selection: Selection, confidence: str) -> Verdict:
    leaders = _first(selection.named("battery"), "points")
    leader = leaders[0]
    tied = f", tied with {len(leaders) - 1} more" if len(leaders) > 1 else ""
    return Verdict(
        "Nobody is proven yet",
        (
            "No round robin was scored, so no team races support a choice.",
            f"In the skill battery {leader['name']} comes first{tied}, with {leader['points']:.1f} points "
            f"({confidence} {leader['points_low']:.1f}–{leader['points_high']:.1f}).",
        ),
    )


def _nobody(pareto: pl.DataFrame) -> Verdict:
    survivors = int(pareto["survives"].sum())
    went = "none survived" if survivors == 0 else f"{survivors:,} survived"
    return Verdict(
        "Nobody to send",
        (f"Of {pareto.height:,} entrants {went} the Pareto filter, and no later stage was scored.",),
    )


def _listed(names: Sequence[str], conjunction: str) -> str:
    shown = list(names) if len(names) < 4 else [*names[:2], f"{len(names) - 2} more"]
    return f"{', '.join(shown[:-1])} {conjunction} {shown[-1]}"
