"""Who could not be judged, as too many of its runs are void."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict

import polars as pl

from nathlon.arena.voids import NotJudged, most_void
from nathlon.results.part import ResultModel
from nathlon.results.words import STAGES, counted

NAMED = 3
"""Of those that could not be judged, in a sentence."""


class Voided(ResultModel):
    """An entrant that could not be judged in a stage; see `nathlon.arena.voids.NotJudged`."""

    name: str
    entrant: str
    stage: str
    test: str
    void: int
    runs: int
    unit: str = "run"


class MostVoid(ResultModel):
    """Who has by far the greatest share of void races: how many of those that it had."""

    name: str
    entrant: str
    void: int
    races: int


def voided(not_judged: Iterable[NotJudged], names: Mapping[str, str]) -> tuple[Voided, ...]:
    """Who could not be judged, given the names of the entrants by their ids."""
    return tuple(Voided(name=names[one.entrant], **asdict(one)) for one in not_judged)


def most_voided(results: pl.DataFrame, names: Mapping[str, str]) -> MostVoid | None:
    """Who has by far the greatest share of void races in RESULTS; None where nobody has."""
    found = most_void(results, names)
    if found is None:
        return None
    entrant, void, races = found
    return MostVoid(name=names[entrant], entrant=entrant, void=void, races=races)


def void_runs(void: int, car_runs: int, not_judged: Sequence[Voided]) -> str:
    """A sentence on how many car runs are void, and who could not be judged for them; '' where none are."""
    if not void:
        return ""
    found = f"{void:,} of {car_runs:,} car runs {'is' if void == 1 else 'are'} void and count for nobody"
    if not not_judged:
        return f"{found}."
    first = [
        f"{one.name} ({one.void:,} of {counted(one.runs, one.unit)} in the {STAGES[one.stage]})"
        for one in not_judged
    ]
    more = len(first) - NAMED
    shown = [*first[:NAMED], f"{more:,} more"] if more > 0 else first
    return f"{found}; could not be judged: {', '.join(shown)}."
