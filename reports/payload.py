"""The data that the page draws: columns of plain values, in which entrants and races are numbers."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import polars as pl

from nathlon.arena.results import ENDINGS, RESULTS, TABLES
from nathlon.reports.race_data import circuit_data, race_data
from nathlon.reports.verdict import verdict
from nathlon.results.selection import Previous, Selection

Columns = dict[str, list[Any]]

DIGITS = 7
"""Significant ones of every number."""
CAR = tuple(RESULTS.names()[RESULTS.names().index("team") :])
"""Columns of RESULTS that are kept of every car beside its entrant and its place on the grid."""


NOT_DRAWN = ("entrants", "tournament_notes", "pool_cells", "pool_totals")
"""Tables that the page's scripts do not read as they are."""


def payload(selection: Selection) -> dict[str, Any]:
    """All that the page's scripts read, as JSON values.

    Tables are objects of columns. `entrants` are numbered as they stand, those of the table of this name
    first (`listed` of them), then whoever else raced; `races` name their match and their first car by number.
    `recordings` are races that were recorded, all on the one `circuit`.
    """
    entrants = _entrants(selection)
    numbers = pl.Enum(entrants["entrant"])
    tables = {name: selection.tables[name] for name in TABLES if name not in NOT_DRAWN}
    tables["ranking"] = selection.ranking
    matches, races, cars = _races(selection, numbers)
    shown = verdict(selection)
    return {
        "title": selection.title,
        "underWay": selection.under_way,
        "verdict": {"headline": shown.headline, "sentences": shown.sentences},
        "summary": selection.summary.model_dump(mode="json", exclude={"ranking"}),
        "timedOn": selection.summary.timed_on,
        "listed": selection.tables["entrants"].height,
        "entrants": _columns(entrants),
        "tables": {name: _columns(_numbered(table, numbers)) for name, table in tables.items()},
        "incidentHistory": _columns(selection.incident_history),
        "notes": selection.tables["tournament_notes"]["note"].to_list(),
        "endings": ENDINGS,
        "matches": _columns(matches.rename({"match": "key"})),
        "races": _columns(races),
        "cars": _columns(cars),
        "store": selection.store,
        "previous": _previous(selection.previous, numbers),
        "limit": selection.limit_s,
        "circuit": circuit_data(selection.logs[0].outline, selection.logs[0].sections)
        if selection.logs
        else None,
        "recordings": [race_data(log) for log in selection.logs],
    }


def _entrants(selection: Selection) -> pl.DataFrame:
    """ENTRANTS, with a row for everybody else that a table or a race names."""
    named = selection.tables["entrants"]
    raced = [
        selection.results["entrant"],
        *(selection.tables[name]["entrant"] for name in ("pool", "ranking")),
    ]
    others = pl.concat(raced).unique(maintain_order=True).to_frame()
    if selection.previous is not None:
        cards = pl.concat([named, selection.previous.entrants]).unique("entrant", keep="first")
    else:
        cards = named
    others = (
        others.join(named, on="entrant", how="anti", maintain_order="left")
        .join(cards, on="entrant", how="left", maintain_order="left")
        .with_columns(pl.coalesce("name", "entrant").alias("name"))
    )
    return pl.concat([named, others.select(named.columns)])


def _numbered(table: pl.DataFrame, numbers: pl.Enum) -> pl.DataFrame:
    """The table with entrants by their numbers."""
    ids = [name for name in ("entrant", "opponent") if name in table.columns]
    return table.with_columns(pl.col(ids).cast(numbers).to_physical())


def _columns(table: pl.DataFrame) -> Columns:
    short = table.with_columns(pl.col(pl.Float64).fill_nan(None).round_sig_figs(DIGITS))
    return {column.name: _plain(column) for column in short}


def _plain(column: pl.Series) -> list[Any]:
    """Whole floats as integers, flags as 0 and 1: the text is half as long."""
    if column.dtype == pl.Boolean:
        column = column.cast(pl.Int8)
    values = column.to_list()
    if column.dtype != pl.Float64:
        return values
    return [int(value) if value is not None and value.is_integer() else value for value in values]


def _races(selection: Selection, numbers: pl.Enum) -> tuple[pl.DataFrame, pl.DataFrame, pl.DataFrame]:
    """Matches, their races, and the cars in these, each in the order of the results."""
    results = selection.results.with_row_index("first")
    matches = results.unique("match", keep="first", maintain_order=True).select("match", "stage", "test")
    races = results.unique(["match", "race"], keep="first", maintain_order=True)
    keys = pl.Enum(matches["match"])
    races = races.select(pl.col("match").cast(keys).to_physical(), "race", "seed", "mirrored", "first")
    cars = results.select(
        pl.col("entrant").cast(numbers).to_physical(),
        "slot",
        *(name for name in CAR if name not in ("entrant", "ending")),
        pl.col("ending").cast(pl.Enum(ENDINGS)).to_physical(),
    ).with_columns(pl.col(pl.Float64).round(3))
    return matches, races.with_columns(pl.col("seed").cast(pl.String)), cars


def _previous(previous: Previous | None, numbers: pl.Enum) -> dict[str, Any] | None:
    """Who took part before, and the pool as it stood, of those that are shown here."""
    if previous is None:
        return None
    shown: Sequence[str] = numbers.categories.to_list()
    pool = previous.pool.filter(pl.col("entrant").is_in(shown))
    known = {*previous.entrants["entrant"], *previous.pool["entrant"]}
    return {
        "name": previous.name,
        "ended": previous.ended_at,
        "sent": [sent.model_dump() for sent in previous.sent],
        "known": [number for number, entrant in enumerate(shown) if entrant in known],
        "pool": _columns(_numbered(pool.select("entrant", "rank", "worst_rank", "points_per_race"), numbers)),
    }
