"""The races to look at: the one that decided, and those that stand out."""

from __future__ import annotations

from typing import NamedTuple

import polars as pl

from nathlon.arena.results import VOID_ENDINGS
from nathlon.arena.tested import RACE, entrant_rows

DRIVEN = "race"
"""Stage of the one race of a test drive."""


class Notable(NamedTuple):
    """A race, by its match's key and its number there, and why one should look at it."""

    match: str
    race: int
    why: str


def notable_races(results: pl.DataFrame, ranking: pl.DataFrame) -> list[Notable]:
    """The deciding race first, and then the others that stand out; each once.

    Args:
        results: of the tournament or of a test drive, schema RESULTS; void races are passed over.
        ranking: schema RANKING.
    """
    margins, valid = _margins(results, ranking), _valid(results)
    once: dict[tuple[str, int], Notable] = {}
    for notable in (*_decided(margins), *_driven(valid), *_most_faults(valid), *_furthest_forward(valid)):
        once.setdefault((notable.match, notable.race), notable)
    return list(once.values())


def notable_episodes(results: pl.DataFrame, ranking: pl.DataFrame, episode: str = "episode") -> list[Notable]:
    """Episodes of another world to look at, the deciding one first; each once.

    Where entrants meet they are those of the first two that `notable_races` has. Where nobody meets they are
    the best and the worst in which the first was tested, and what the second did in the best one.

    Args:
        results: of the run, schema RESULTS; void episodes are passed over.
        ranking: schema RANKING.
        episode: what one is called.
    """
    valid = _valid(results)
    met = valid.filter(pl.col("stage") == "tournament")
    tests = valid.filter(pl.col("stage") == "battery")
    found = _decided(_margins(met, ranking), episode) if met.height else _extremes(tests, ranking, episode)
    return list({(notable.match, notable.race): notable for notable in reversed(found)}.values())[::-1]


def _extremes(tests: pl.DataFrame, ranking: pl.DataFrame, episode: str) -> list[Notable]:
    """Episodes of tests: the best and the worst of the first of the ranking, and the second in the best."""
    reached = entrant_rows(tests).with_columns(reached=pl.coalesce("score", "points"))
    first, second = (
        reached.filter(pl.col("entrant") == entrant).sort(
            "reached", "test", "race", descending=[True, False, False]
        )
        for entrant in [*ranking["entrant"][:2], "", ""][:2]
    )
    if first.is_empty():
        return []
    best, worst = first[:1], first[-1:]
    beside = second.join(best, on=["test", "seed"], how="semi")
    return [
        _notable(rows, f"{why}: score {rows['reached'][0]:.4g}")
        for rows, why in (
            (best, f"the best {episode} of the first of the ranking"),
            (worst, f"the worst {episode} of the first of the ranking"),
            (beside, "the second of the ranking on the same seed as the best of the first"),
        )
        if not rows.is_empty()
    ]


def _driven(valid: pl.DataFrame) -> list[Notable]:
    """The race of a test drive."""
    rows = valid.filter(pl.col("stage") == DRIVEN)
    return [] if rows.is_empty() else [_notable(rows, "the race that was driven")]


def _valid(results: pl.DataFrame) -> pl.DataFrame:
    """Results without those of void races."""
    void = results.filter(pl.col("ending").is_in(VOID_ENDINGS)).select(RACE).unique()
    return results.join(void, on=RACE, how="anti")


def _margins(results: pl.DataFrame, ranking: pl.DataFrame) -> pl.DataFrame:
    """Races of the first two of the ranking: whether the first `lost`, and `by` how many points."""
    none = pl.DataFrame(schema={"match": pl.String, "race": pl.Int64, "lost": pl.Boolean, "by": pl.Float64})
    if ranking.height < 2:
        return none
    first, second = ranking["entrant"][:2]
    met = _valid(results).filter(pl.col("entrant").is_in([first, second]))
    points = met.group_by(*RACE, "entrant").agg(pl.col("points").sum())
    margins = points.pivot("entrant", index=RACE, values="points")
    if not {first, second} <= set(margins.columns):
        return none
    margin = pl.col(first) - pl.col(second)
    return margins.drop_nulls().select(*RACE, lost=margin <= 0, by=margin.abs())


def _decided(margins: pl.DataFrame, what: str = "race") -> list[Notable]:
    """The closest race of the first two, and the clearest; `what` they are called."""
    if margins.is_empty():
        return []
    closest, clearest = margins.sort("lost", "by", *RACE), margins.sort(-pl.col("by"), *RACE)
    lost, by = closest["lost"][0], closest["by"][0]
    how = (
        "that the first of the ranking lost by least to the second"
        if lost
        else ("that the first of the ranking won against the second")
    )
    return [
        _notable(closest, f"the {'' if lost else 'closest '}{what} {how}: {_points(by)}"),
        _notable(
            clearest,
            f"the clearest {what} between the first two of the ranking: {_points(clearest['by'][0])}",
        ),
    ]


def _points(by: float) -> str:
    return f"{by:.4g} point{'' if by == 1.0 else 's'}"


def _most_faults(results: pl.DataFrame) -> list[Notable]:
    """The race with the most contacts that the stewards lay to somebody."""
    faults = results.group_by(RACE).agg(pl.col("contacts_at_fault").sum())
    worst = faults.filter(pl.col("contacts_at_fault") > 0).sort(-pl.col("contacts_at_fault"), *RACE)
    if worst.is_empty():
        return []
    return [_notable(worst, f"the most contacts at somebody's fault: {worst['contacts_at_fault'][0]}")]


def _furthest_forward(results: pl.DataFrame) -> list[Notable]:
    """The race in which a car came furthest forward from its place on the grid."""
    gains = results.with_columns(gain=pl.col("slot") - pl.col("place"))
    furthest = gains.filter(pl.col("gain") > 0).sort(-pl.col("gain"), *RACE, "car")
    if furthest.is_empty():
        return []
    slot, place = furthest["slot"][0], furthest["place"][0]
    return [_notable(furthest, f"the furthest way forward: from {slot} on the grid to {place}")]


def _notable(races: pl.DataFrame, why: str) -> Notable:
    """The first of some races."""
    return Notable(races["match"][0], int(races["race"][0]), why)
