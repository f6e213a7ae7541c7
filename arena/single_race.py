"""A race outside any selection: those who are named fill the grid."""

from __future__ import annotations

from collections.abc import Sequence

from nathlon.arena.entrant import Entrant
from nathlon.arena.match import Match, Race, Seat
from nathlon.sim.errors import InputError
from nathlon.sim.scenario import load_scenario


def single_race(entrants: Sequence[Entrant], scenario: str, circuit: str, car: str, seed: int) -> Match:
    """One race that entrants start in turn until the grid is full, two of them as teams.

    Raises:
        InputError: if there are more entrants than places.
    """
    cars = load_scenario(scenario).cars
    if len(entrants) > cars:
        raise InputError(f"scenario {scenario}: {len(entrants)} entrants, expected at most {cars}")
    seats = tuple(Seat(slot % len(entrants), slot % 2 if len(entrants) == 2 else -1) for slot in range(cars))
    ids, sources = zip(*((entrant.id, entrant.source) for entrant in entrants), strict=True)
    races = (Race(seed, seats),)
    return Match("race", scenario, scenario, circuit, car, ids, sources, races, entrants[0].world)
