"""Formats: the grids of a unit of evidence favour nobody."""

from collections import Counter
from itertools import combinations
from typing import get_args

import pytest

from nathlon.sim.scenario import load_scenario
from nathlon.tournament.block_design import CYCLE
from nathlon.tournament.formats import FORMATS, Format, FormatName
from nathlon.tournament.sides import Sides

EVERY = pytest.mark.parametrize("made", FORMATS.values(), ids=FORMATS)


def test_every_name_that_a_file_may_use_is_a_format() -> None:
    assert set(get_args(FormatName)) == set(FORMATS)
    assert {name: (made.cars, made.teams) for name, made in FORMATS.items()} == {
        "4v4": (8, True),
        "1v1": (2, True),
        "2v2": (4, True),
        "ffa8": (8, False),
        "10v10": (20, True),
        "gauntlet": (8, True),
        "event": (20, False),
    }


@EVERY
def test_its_scenario_has_as_many_cars_and_an_end(made: Format) -> None:
    scenario = load_scenario(made.scenario)
    assert scenario.cars == made.cars
    assert scenario.laps is not None


UNITS = [(name, 2) for name, made in FORMATS.items() if made.teams] + [("ffa8", n) for n in range(2, 14)]


@pytest.mark.parametrize(("name", "sides"), UNITS)
def test_every_side_starts_equally_often_from_every_place(name: str, sides: int) -> None:
    grids = FORMATS[name].grids(sides)
    assert len(grids) == sides
    for place in range(FORMATS[name].cars):
        assert sorted(grid.sides[place] for grid in grids) == list(range(sides))


@pytest.mark.parametrize(("name", "sides"), [*UNITS[:4], ("ffa8", 8)])
def test_the_second_half_of_the_grids_mirrors_the_first(name: str, sides: int) -> None:
    grids = FORMATS[name].grids(sides)
    half = len(grids) // 2
    assert [grid.mirrored for grid in grids] == [False] * half + [True] * half
    mirrors = {grid.sides for grid in grids[half:]}
    assert {grid.sides[::-1] for grid in grids[:half]} == mirrors


def test_teams_start_from_odd_and_even_places() -> None:
    assert [grid.sides for grid in FORMATS["4v4"].grids(2)] == [(0, 1) * 4, (1, 0) * 4]


def test_in_a_free_for_all_of_eight_everybody_starts_once_right_behind_everybody_else() -> None:
    grids = FORMATS["ffa8"].grids(8)
    behind = Counter(two for grid in grids for two in zip(grid.sides, grid.sides[1:], strict=False))
    assert set(behind.values()) == {1}
    assert len(behind) == 8 * 7


def test_with_more_sides_than_cars_nobody_drives_two_and_some_rest() -> None:
    for grid in FORMATS["ffa8"].grids(11):
        assert len(set(grid.sides)) == 8


@pytest.mark.parametrize("sides", [9, 10, 12, 15, 20])
def test_with_more_sides_than_cars_every_two_meet_about_as_often_as_any_others(sides: int) -> None:
    """After every unit, so that the schedule may end at any of them."""
    met = Counter[frozenset[int]]()
    for unit in range(6):
        for grid in FORMATS["ffa8"].grids(sides, unit):
            met.update(frozenset(two) for two in combinations(grid.sides, 2))
        counts = [met[frozenset(two)] for two in combinations(range(sides), 2)]
        assert max(counts) - min(counts) <= 3


def test_in_a_world_of_three_seats_every_two_of_five_meet_equally_often_in_two_units() -> None:
    met = Counter(
        frozenset(two)
        for unit in range(2)
        for grid in Sides(3).grids(5, unit)
        for two in combinations(grid.sides, 2)
    )
    assert set(met.values()) == {3}


def test_whoever_starts_ahead_of_another_also_starts_behind_it() -> None:
    ahead = Counter(
        two
        for unit in range(2 * CYCLE)
        for grid in FORMATS["ffa8"].grids(12, unit)
        for two in combinations(grid.sides, 2)
    )
    assert ahead
    assert all(ahead[two] == ahead[two[::-1]] for two in ahead)
