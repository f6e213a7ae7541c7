"""Who met whom in a round robin, and what came of it."""

from __future__ import annotations

from dataclasses import dataclass

import polars as pl

from nathlon.tournament.evidence import Evidence
from nathlon.tournament.points import EQUAL

Two = frozenset[str]


@dataclass(frozen=True)
class Meeting:
    """All raced mirrored pairs of two.

    Attributes:
        results: RESULTS.
        difference: mean of their points, a race.
        deviation: standard deviation of the pairs' differences.
    """

    results: pl.DataFrame
    difference: float
    deviation: float


def meetings(results: pl.DataFrame) -> dict[Two, Meeting]:
    """A round robin's RESULTS by the two that met."""
    of_match: dict[Two, list[pl.DataFrame]] = {}
    for frame in results.partition_by("match", maintain_order=True):
        of_match.setdefault(frozenset(frame["entrant"]), []).append(frame)
    return {
        frozenset((cell["entrant"], cell["opponent"])): Meeting(
            pl.concat(of_match[frozenset((cell["entrant"], cell["opponent"]))]),
            cell["difference"],
            cell["deviation"],
        )
        for cell in Evidence(results, EQUAL).cells.iter_rows(named=True)
    }
