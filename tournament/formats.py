"""Formats of a match: how many cars race for how many sides, and from which grids.

Every format gives a unit of evidence: races with the same seed in which the sides take turns on the grid, as
many races as there are sides. Of two sides it is a mirrored pair, of eight a block of eight races.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

FormatName = Literal["4v4", "1v1", "2v2", "ffa8", "10v10"]


@dataclass(frozen=True)
class Grid:
    """Who starts where in one race of a unit.

    Attributes:
        mirrored: whether it is the mirror of an earlier grid of the unit.
        sides: the side that starts from each place, pole first.
    """

    mirrored: bool
    sides: tuple[int, ...]


@dataclass(frozen=True)
class Format:
    """A format of matches.

    Attributes:
        scenario: what is raced where nothing else is said; every scenario with as many cars will do.
        sides: entrants in a match.
        grids: of the races of a unit.
    """

    name: str
    scenario: str
    sides: int
    grids: tuple[Grid, ...]

    @property
    def cars(self) -> int:
        """Cars in a race."""
        return len(self.grids[0].sides)

    @property
    def teams(self) -> bool:
        """Whether two teams race, or everybody for themselves."""
        return self.sides == 2


def _teams(name: str, scenario: str, cars_a_team: int) -> Format:
    """Two teams, on odd and on even places, then the other way round."""
    plain, mirror = (0, 1) * cars_a_team, (1, 0) * cars_a_team
    return Format(name, scenario, 2, (Grid(False, plain), Grid(True, mirror)))


def _free_for_all(name: str, scenario: str, sides: int) -> Format:
    """Everybody for themselves, on the grids of a Williams square (Williams, Aust. J. Sci. Res. 2, 1949).

    Each side starts from each place once, and once right behind each other one; the second half of the grids
    are the first turned round. The number of sides must be even.
    """
    zigzag = [place // 2 if place % 2 == 0 else -(place // 2 + 1) for place in range(sides)]
    grids = [tuple((step + shift) % sides for step in zigzag) for shift in range(sides)]
    return Format(name, scenario, sides, tuple(Grid(2 * k >= sides, grid) for k, grid in enumerate(grids)))


FORMATS: dict[str, Format] = {
    made.name: made
    for made in (
        _teams("4v4", "race", 4),
        _teams("1v1", "race_1v1", 1),
        _teams("2v2", "race_2v2", 2),
        _free_for_all("ffa8", "race", 8),
        _teams("10v10", "grand_prix", 10),
    )
}
