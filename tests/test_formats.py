"""Formats: the grids of a unit of evidence favour nobody."""

from collections import Counter
from typing import get_args

import pytest

from sim.scenario import load_scenario
from tournament.formats import FORMATS, Format, FormatName

EVERY = pytest.mark.parametrize("made", FORMATS.values(), ids=FORMATS)


def test_every_name_that_a_file_may_use_is_a_format() -> None:
    assert set(get_args(FormatName)) == set(FORMATS)
    assert {name: (made.cars, made.sides) for name, made in FORMATS.items()} == {
        "4v4": (8, 2),
        "1v1": (2, 2),
        "2v2": (4, 2),
        "ffa8": (8, 8),
        "10v10": (20, 2),
    }


@EVERY
def test_its_scenario_has_as_many_cars_and_an_end(made: Format) -> None:
    scenario = load_scenario(made.scenario)
    assert scenario.cars == made.cars
    assert scenario.laps is not None


@EVERY
def test_every_side_starts_equally_often_from_every_place(made: Format) -> None:
    assert len(made.grids) == made.sides
    for place in range(made.cars):
        assert sorted(grid.sides[place] for grid in made.grids) == list(range(made.sides))


@EVERY
def test_the_second_half_of_the_grids_mirrors_the_first(made: Format) -> None:
    half = len(made.grids) // 2
    assert [grid.mirrored for grid in made.grids] == [False] * half + [True] * half
    mirrors = {grid.sides for grid in made.grids[half:]}
    assert {grid.sides[::-1] for grid in made.grids[:half]} == mirrors


def test_teams_start_from_odd_and_even_places() -> None:
    assert [grid.sides for grid in FORMATS["4v4"].grids] == [(0, 1) * 4, (1, 0) * 4]


def test_in_a_free_for_all_everybody_starts_once_right_behind_everybody_else() -> None:
    made = FORMATS["ffa8"]
    behind = Counter(two for grid in made.grids for two in zip(grid.sides, grid.sides[1:], strict=False))
    assert set(behind.values()) == {1}
    assert len(behind) == made.sides * (made.sides - 1)
