"""Who is under test, one row a race: what its seats came to together."""

from __future__ import annotations

import json
from collections.abc import Sequence

import polars as pl

from nathlon.arena.match import TESTED
from nathlon.arena.results import POLICY_FAULTS, RESULTS

RACE = ["match", "race"]
NAMES = RESULTS.names()
NUMBERS = [name for name in NAMES[NAMES.index("place") :] if RESULTS[name].is_numeric()]
"""Columns of RESULTS that say what a seat came to."""

BREAKDOWNS = ("stuck", *POLICY_FAULTS)
"""Endings of runs that their policy did not complete: it stood still for too long, or is at fault."""


def entrant_rows(results: pl.DataFrame) -> pl.DataFrame:
    """The rows of RESULTS of those under test, one a race.

    Who takes several seats has the mean of them. It lacks what one of them lacks; it has failed where one of
    them has, and finished where all have.
    """
    rows = results.filter(pl.col("team") == TESTED)
    if rows.select(pl.struct(RACE).is_unique().all()).item():
        return rows
    numbers = pl.col(NUMBERS)
    return (
        rows.sort("car")
        .group_by(RACE, maintain_order=True)
        .agg(
            pl.exclude(*RACE, *NUMBERS, "ending", "measures").first(),
            pl.when(numbers.null_count() == 0).then(numbers.mean()),
            pl.col("ending", "measures"),
        )
        .with_columns(
            pl.col("ending").map_elements(_ending, pl.String),
            pl.col("measures").map_elements(_mean, pl.String),
        )
        .select(NAMES)
    )


def _ending(endings: Sequence[str]) -> str:
    """How seats have ended together: by the first fault of their policy, or else by what is no finish."""
    order = (*POLICY_FAULTS, *(ending for ending in endings if ending != "finished"), "finished")
    return next(ending for ending in order if ending in list(endings))


def _mean(measures: Sequence[str | None]) -> str | None:
    """The means of a world's own measures, which every seat has."""
    seats = [json.loads(text) for text in measures if text is not None]
    if not seats:
        return None
    return json.dumps({name: sum(seat[name] for seat in seats) / len(seats) for name in seats[0]})
