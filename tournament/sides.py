"""Meetings in another world: who takes which side in the races of a unit."""

from __future__ import annotations

from dataclasses import dataclass

from nathlon.tournament.formats import StartingOrder, resting


@dataclass(frozen=True)
class Sides:
    """The format of a scenario with so many sides, each of some seats.

    Two sides make a match of two, played twice with sides changed. With more it is a free-for-all, in which
    everybody takes every side once a unit; with more entrants than sides some rest, see
    `nathlon.tournament.block_design`.

    Attributes:
        sides: how many.
        gauntlet: as in `nathlon.tournament.formats.Format`; of two sides only.
    """

    sides: int
    gauntlet: bool = False

    @property
    def teams(self) -> bool:
        """Whether two play against each other, or everybody for themselves."""
        return self.sides == 2

    def grids(self, entrants: int, unit: int = 0) -> tuple[StartingOrder, ...]:
        """Who of so many entrants takes each side, in every episode of a unit."""
        if self.teams:
            return StartingOrder(False, (0, 1)), StartingOrder(True, (1, 0))
        if entrants > self.sides:
            return resting(entrants, self.sides, unit)
        return tuple(
            StartingOrder(False, tuple((side + shift) % entrants for side in range(self.sides)))
            for shift in range(entrants)
        )
