"""Void runs, which count for nobody, and who cannot be judged for them."""

from __future__ import annotations

from collections.abc import Container
from dataclasses import dataclass

import polars as pl

from nathlon.arena.match import BACKGROUND, TESTED
from nathlon.arena.results import VOID_ENDINGS

MOST = 0.5
"""Whoever has a greater share of void runs in a test is not judged by the rest: it may void what it loses."""

NOTABLE = 2.0
"""Times the others' share of void races: whoever has more is named."""

RUN = ("match", "run")


@dataclass(frozen=True)
class NotJudged:
    """An entrant that most of its runs in a test tell nothing of.

    Attributes:
        entrant: its id.
        stage, test: where, as in RESULTS.
        void: units that count for nobody.
        runs: units in all.
        unit: what they are: a `run`, a mirrored `pair`, or a `block` of a free-for-all.
    """

    entrant: str
    stage: str
    test: str
    void: int
    runs: int
    unit: str = "run"


def is_void() -> pl.Expr:
    """Whether the race of a row of RESULTS is void."""
    return pl.col("ending").is_in(VOID_ENDINGS).any().over("match", "race")


def void_races(results: pl.DataFrame) -> int:
    """How many races of some RESULTS are void."""
    return int(results.filter(is_void()).select(pl.struct("match", "race").n_unique()).item())


def most_void(results: pl.DataFrame, among: Container[str]) -> tuple[str, int, int] | None:
    """Who has by far the greatest share of void races, with how many are and how many it had.

    Args:
        results: RESULTS.
        among: ids of those that it may be.

    Returns:
        None where it is no more than twice that of the others together, or one race alone.
    """
    own = results.with_columns(void=is_void()).filter(pl.col("team") != BACKGROUND)
    races = own.unique(["match", "race", "entrant"])
    counts = races.group_by("entrant").agg(pl.col("void").sum(), races=pl.len())
    ranked = counts.sort(pl.col("void") / pl.col("races"), "entrant", descending=[True, False])
    for entrant, void, had in ranked.iter_rows():
        if entrant in among:
            others = counts.filter(pl.col("entrant") != entrant).sum()
            share = others["void"].item() / others["races"].item() if counts.height > 1 else 0.0
            return (entrant, void, had) if void > 1 and void > NOTABLE * share * had else None
    return None


def not_judged_by_tests(results: pl.DataFrame) -> list[NotJudged]:
    """Who under test cannot be judged by RESULTS of the filter or the n-athlon; ordered by entrant."""
    runs = results.with_columns(void=is_void(), run=pl.col("race"), unit=pl.lit("run"))
    return _not_judged(runs.filter(pl.col("team") == TESTED))


def not_judged_by_meetings(results: pl.DataFrame) -> list[NotJudged]:
    """Who cannot be judged by RESULTS of a tournament; ordered by entrant.

    Its runs are units of evidence: mirrored pairs, or blocks of a free-for-all.
    """
    return _not_judged(units_met(results))


def units_met(results: pl.DataFrame) -> pl.DataFrame:
    """The rows of RESULTS of a tournament, with `run` and `unit` of their evidence, and if it is `void`."""
    met = results.filter(pl.col("team") != BACKGROUND)
    races = pl.col("entrant").n_unique().over("match")
    return met.with_columns(
        run=pl.col("race") // races,
        unit=pl.when(races > 2).then(pl.lit("block")).otherwise(pl.lit("pair")),
    ).with_columns(void=pl.col("ending").is_in(VOID_ENDINGS).any().over(RUN))


def _not_judged(rows: pl.DataFrame) -> list[NotJudged]:
    """Those with the greatest share of void runs first: whoever met them is not blamed for these runs."""
    runs = rows.group_by("stage", "test", *RUN, "entrant").agg(pl.col("void").any(), pl.col("unit").first())
    found: list[NotJudged] = []
    while True:
        shares = runs.group_by("entrant", "stage", "test").agg(
            pl.col("void").sum(), pl.col("unit").max(), runs=pl.len()
        )
        shares = shares.with_columns(share=pl.col("void") / pl.col("runs")).filter(pl.col("share") > MOST)
        worst = shares.filter(pl.col("share") == pl.col("share").max()).sort("entrant", "stage", "test")
        if worst.is_empty():
            return sorted(found, key=lambda one: one.entrant)
        once = worst.unique("entrant", keep="first", maintain_order=True)
        found += [NotJudged(**row) for row in once.drop("share").to_dicts()]
        theirs = pl.col("entrant").is_in(once["entrant"].to_list())
        runs = runs.filter(~theirs, ~(pl.col("void") & theirs.any().over(RUN)))
