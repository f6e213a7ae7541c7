"""Who sits where in the filter and the n-athlon of other worlds: every side as often as every other."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from nathlon.arena.match import TESTED
from nathlon.arena.world_registry import load_world
from nathlon.selection.battery.skill import standing_tests
from nathlon.selection.config import Config
from nathlon.selection.pareto.filter import FilterPlan, FilterSettings
from tests.support.games import player, world_of


def config_of(folder: Path, sides: int, **pareto: object) -> Config:
    seats = ", ".join(f"'seat {number}'" for number in range(sides))
    name = world_of(folder, f"PettingZooWorld({{'table': lambda: envs['Game']({seats})}})")
    return Config(world=name, pareto=FilterSettings.model_validate(pareto)).suited


def seats_by_round(folder: Path, config: Config) -> list[list[int]]:
    """Sides that the entrant takes in the races of each round."""
    world = load_world(config.world)
    entrant = world.enter(player(folder / "good.onnx", 3))
    plan = FilterPlan(config.pareto, world, np.random.SeedSequence(1))
    rounds = []
    for number in range(len(config.pareto.rounds)):
        [match] = plan.races([entrant], number)
        rounds.append([[seat.team for seat in race.seats].index(TESTED) for race in match.races])
    return rounds


@pytest.mark.parametrize("sides", [2, 3, 5, 8])
def test_all_sides_are_taken_equally_often_over_the_rounds(tmp_path: Path, sides: int) -> None:
    rounds = seats_by_round(tmp_path, config_of(tmp_path, sides))
    assert [len(seats) for seats in rounds[:2]] == [2, 2]
    seats = [seat for seats in rounds for seat in seats]
    assert set(Counter(seats).values()) == {len(seats) // sides}
    assert seats == [run % sides for run in range(len(seats))], "a round goes on where the last one ended"


def test_slots_and_numbers_that_are_given_stay(tmp_path: Path) -> None:
    config = config_of(tmp_path, 3, slots=(2, 3), most_races=7)
    assert config.pareto.most_races == 7
    assert seats_by_round(tmp_path, config) == [[1, 2], [1, 2], [1, 2, 1]]
    assert config_of(tmp_path, 3, slots=(2, 3)).pareto.most_races == 8


def test_opponents_move_on_over_the_rounds(tmp_path: Path) -> None:
    names = [player(tmp_path / f"{right}.onnx", right) for right in range(3)]
    config = config_of(tmp_path, 2, opponents=tuple(names), most_races=6)
    world = load_world(config.world)
    entrant = world.enter(player(tmp_path / "good.onnx", 3))
    plan = FilterPlan(config.pareto, world, np.random.SeedSequence(1))
    matches = [plan.races([entrant], number)[0] for number in range(len(config.pareto.rounds))]
    met = [
        match.sources[seat.entrant]
        for match in matches
        for race in match.races
        for seat in race.seats
        if seat.team != TESTED
    ]
    assert [Path(name).stem for name in met] == ["0", "1", "2", "0", "1", "2"]


@pytest.mark.parametrize(("sides", "runs"), [(2, 8), (3, 9), (8, 8), (10, 10)])
def test_standing_tests_take_every_side_equally_often(tmp_path: Path, sides: int, runs: int) -> None:
    [test] = standing_tests(load_world(config_of(tmp_path, sides).world))
    assert test.runs == runs
    assert set(Counter(map(test.slot, range(runs))).values()) == {runs // sides}
