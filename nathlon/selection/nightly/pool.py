"""The pool: all who raced on a night, ranked over the nights together."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import polars as pl

from nathlon.arena.match import BACKGROUND
from nathlon.arena.store import RunRecord, Store
from nathlon.selection.field import EntryList
from nathlon.selection.run import CONFIDENCE
from nathlon.tournament.stopping import repeated
from nathlon.tournament.tallies import Tally, rank_tally

KEPT = 50
"""Of the best, from night to night; who has fallen further is no incumbent any more."""


def rank_nights(
    store: Store, nights: Sequence[RunRecord], night: RunRecord, incumbents: int
) -> dict[str, pl.DataFrame]:
    """The pool after a night, and what the next one needs of it: the tables of these names.

    It is ranked over the round robins of the night and of those before it in the same world, and its
    intervals hold on all of these nights together. The best are kept with all that they did against each
    other, and so are the anchors: what a night takes does not grow with the number of nights.

    Args:
        store: that holds the nights.
        nights: all of them, in order.
        night: that has come to its end.
        incumbents: as many as a night takes.
    """
    comparable = [
        record
        for record in nights
        if record.config["world"] == night.config["world"] and record.id <= night.id
    ]
    tally, folded = _kept(store, comparable[:-1])
    kept = max(KEPT, incumbents)
    for looks, record in enumerate(comparable[folded:], folded + 1):
        results = store.results_of_run(record.name, "tournament")
        anchors = {anchor.id for anchor in EntryList.from_plan(record.config).anchors}
        ranking, tally = after(tally, results, anchors, kept, looks)
    return {"pool": ranking, "pool_cells": tally.cells, "pool_totals": tally.totals}


def after(
    tally: Tally, results: pl.DataFrame, anchors: Collection[str], kept: int, looks: int
) -> tuple[pl.DataFrame, Tally]:
    """The pool after one more night, RANKING, and what is kept of it.

    Args:
        tally: that the night before has left.
        results: RESULTS of the night's round robin.
        anchors: ids of those kept besides the best.
        kept: of the best.
        looks: nights so far, with this one.
    """
    raced = Tally.of(results.filter(pl.col("team") != BACKGROUND))
    together = Tally.together([tally, raced])
    ranking = rank_tally(together, repeated(CONFIDENCE, looks))
    return ranking, together.among({*best_first(ranking)[:kept], *anchors})


def best_first(ranking: pl.DataFrame) -> list[str]:
    """Those of a RANKING that have a rank, by it and then by their points."""
    ordered = ranking.drop_nulls("rank").sort("rank", "points_per_race", descending=[False, True])
    return ordered["entrant"].to_list()


def _kept(store: Store, nights: Sequence[RunRecord]) -> tuple[Tally, int]:
    """The last tally that nights have left, and how many of them are in it; older versions left none."""
    for number, record in reversed(list(enumerate(nights, 1))):
        totals = store.table(record.name, "pool_totals")
        if not totals.is_empty():
            return Tally(store.table(record.name, "pool_cells"), totals), number
    return Tally(), 0
