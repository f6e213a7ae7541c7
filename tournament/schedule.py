"""Who meets whom, and with which seeds."""

from __future__ import annotations

from collections.abc import Container, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from nathlon.tournament.formats import Format
from nathlon.tournament.sides import Sides


@dataclass(frozen=True)
class Meeting:
    """Entrants that race each other.

    Attributes:
        entrants: one for each side.
        seeds: of its units of evidence; they fit in a signed 64-bit integer.
    """

    entrants: tuple[str, ...]
    seeds: tuple[int, ...]


def meetings(
    entrants: Sequence[str],
    made: Format | Sides,
    units: int,
    seeds: np.random.SeedSequence,
    references: Container[str] = (),
) -> list[Meeting]:
    """Who meets whom in a format, each in `units` units of evidence with a seed of its own.

    In teams every two entrants make a meeting, in the order of `entrants`, in a gauntlet every newcomer and
    every one of the `references`; a free-for-all is one meeting of all. The seeds of a meeting do not depend
    on `units`: fewer are the first of more.

    Raises:
        ValueError: if an entrant comes twice or `units` is below 1.
    """
    if len(set(entrants)) != len(entrants):
        raise ValueError("an entrant comes twice in the schedule")
    if units < 1:
        raise ValueError(f"a meeting needs at least 1 unit of races, not {units}")
    sides = 2 if made.teams else max(2, len(entrants))
    fields = list(combinations(entrants, sides))
    if made.gauntlet:
        fields = [two for two in fields if sum(entrant in references for entrant in two) == 1]
    return [
        Meeting(field, tuple(int(seed >> np.uint64(1)) for seed in stream.generate_state(units, np.uint64)))
        for field, stream in zip(fields, seeds.spawn(len(fields)), strict=True)
    ]
