"""Formats of a match: how many cars race, for two teams or everybody for themselves, and from which grids.

Every format gives a unit of evidence: races with the same seed in which the sides take turns on the grid, as
many races as there are sides. Of two teams it is a mirrored pair, of a free-for-all a block of races.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from nathlon.tournament.block_design import first_race

FormatName = Literal["4v4", "1v1", "2v2", "ffa8", "10v10", "gauntlet", "event"]


@dataclass(frozen=True)
class StartingOrder:
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
        cars: in a race.
        teams: whether two teams race, or everybody for themselves.
        gauntlet: whether newcomers race the references only, and not each other.
    """

    name: str
    scenario: str
    cars: int
    teams: bool = True
    gauntlet: bool = False

    def grids(self, sides: int, unit: int = 0) -> tuple[StartingOrder, ...]:
        """The grids of a unit of so many sides, as many: every side starts equally often from every place.

        Two teams start from odd and from even places, then the other way round. In a free-for-all the
        sides move on by one from race to race. With fewer sides than cars some drive several; with more,
        some rest, and who does changes from unit to unit; see `nathlon.tournament.block_design`. With as
        many, an even number, it is a Williams square (Williams, Aust. J. Sci. Res. 2, 1949): each starts
        once right behind each other one, and the second half of the grids are the first turned round.
        """
        if self.teams:
            plain, mirror = (0, 1) * (self.cars // 2), (1, 0) * (self.cars // 2)
            return StartingOrder(False, plain), StartingOrder(True, mirror)
        if sides > self.cars:
            return resting(sides, self.cars, unit)
        zigzag = [place // 2 if place % 2 == 0 else -(place // 2 + 1) for place in range(self.cars)]
        return tuple(
            StartingOrder(
                sides == self.cars and 2 * shift >= sides, tuple((step + shift) % sides for step in zigzag)
            )
            for shift in range(sides)
        )


def resting(sides: int, places: int, unit: int) -> tuple[StartingOrder, ...]:
    """The grids of a unit of more sides than places, in which all rest equally often."""
    first = first_race(sides, places, unit)
    return tuple(
        StartingOrder(False, tuple((side + shift) % sides for side in first)) for shift in range(sides)
    )


FORMATS: dict[str, Format] = {
    made.name: made
    for made in (
        Format("4v4", "race", 8),
        Format("1v1", "race_1v1", 2),
        Format("2v2", "race_2v2", 4),
        Format("ffa8", "race", 8, teams=False),
        Format("10v10", "grand_prix", 20),
        Format("gauntlet", "race", 8, gauntlet=True),
        Format("event", "grand_prix_stops", 20, teams=False),
    )
}
