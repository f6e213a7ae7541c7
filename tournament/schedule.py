"""Who meets whom: a round robin of mirrored pairs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

CARS_A_TEAM = 4
ODD_SLOTS = tuple(range(1, 2 * CARS_A_TEAM, 2))
EVEN_SLOTS = tuple(range(2, 2 * CARS_A_TEAM + 1, 2))


@dataclass(frozen=True)
class Grid:
    """The starting places of both teams in one race; 1 is pole."""

    mirrored: bool
    slots: tuple[tuple[int, ...], tuple[int, ...]]  # of team 0 and team 1


MIRRORED_GRIDS = (Grid(False, (ODD_SLOTS, EVEN_SLOTS)), Grid(True, (EVEN_SLOTS, ODD_SLOTS)))
"""The two races of every mirrored pair: the first team starts from odd, then from even places."""


@dataclass(frozen=True)
class Pairing:
    """One mirrored pair: two races with the same seed, run from `MIRRORED_GRIDS`."""

    entrant: str  # team 0
    opponent: str  # team 1
    seed: int  # fits in a signed 64-bit integer


def round_robin(entrants: Sequence[str], pairs: int, seeds: np.random.SeedSequence) -> list[Pairing]:
    """Every two entrants meet in `pairs` mirrored pairs, each with a seed of its own.

    The pairs of a matchup lie together, in the order of `entrants`. Raises ValueError where an
    entrant comes twice or `pairs` is below 1.
    """
    if len(set(entrants)) != len(entrants):
        raise ValueError("an entrant comes twice in the schedule")
    if pairs < 1:
        raise ValueError(f"a matchup needs at least 1 mirrored pair, not {pairs}")
    matchups = list(combinations(entrants, 2))
    drawn = seeds.generate_state(len(matchups) * pairs, np.uint64) >> np.uint64(1)
    meetings = [matchup for matchup in matchups for _ in range(pairs)]
    return [Pairing(*matchup, int(seed)) for matchup, seed in zip(meetings, drawn, strict=True)]
