"""A race outside any selection: those who are named fill the grid."""

from __future__ import annotations

from collections.abc import Sequence

from nathlon.arena.entrant import Entrant
from nathlon.arena.match import Match, Race, Seat
from nathlon.sim.errors import InputError
from nathlon.sim.scenario import load_scenario


def single_race(
    entrants: Sequence[Entrant], scenario: str, seed: int, grid: Sequence[int] | None = None
) -> Match:
    """One race of entrants in their cars, two of them as teams.

    Args:
        entrants: all on the same circuit.
        scenario: of the race.
        seed: of its start.
        grid: who starts where, from pole, as indices; in turn until the grid is full if it is not given.

    Raises:
        InputError: if there are more entrants than places.
    """
    cars = load_scenario(scenario).cars
    if len(entrants) > cars:
        raise InputError(f"scenario {scenario}: {len(entrants)} entrants, expected at most {cars}")
    if grid is None:
        grid = in_turn(len(entrants), cars)
    seats = tuple(Seat(entrant, entrant if len(entrants) == 2 else -1) for entrant in grid)
    ids, sources, models = zip(*((one.id, one.source, one.car) for one in entrants), strict=True)
    first, races = entrants[0], (Race(seed, seats),)
    classes = models if len(set(models)) > 1 else ()
    return Match(
        "race",
        scenario,
        scenario,
        first.circuit,
        first.car,
        ids,
        sources,
        races,
        first.world,
        classes=classes,
    )


def in_turn(entrants: int, cars: int) -> list[int]:
    """A grid that so many entrants fill in turn, as indices from pole."""
    return [place % entrants for place in range(cars)]
