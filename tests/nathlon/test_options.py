"""What a command and the function for programs both take has one default."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import nathlon
from nathlon.commands.coach import coach
from nathlon.commands.events import endurance, season, weekend
from nathlon.commands.gate import gate
from nathlon.commands.league import league
from nathlon.commands.matrix import matrix
from nathlon.commands.plan import plan
from nathlon.commands.racing import race
from nathlon.commands.recipes import recipes
from nathlon.commands.reward import design_reward
from nathlon.commands.selection import evaluate
from nathlon.commands.stints import stints
from nathlon.commands.training import train
from nathlon.commands.twin import twin
from nathlon.commands.worker import worker

PAIRS: list[tuple[Callable[..., Any], Callable[..., Any], set[str]]] = [
    (coach, nathlon.coach, set()),
    (design_reward, nathlon.design_reward, {"rule"}),  # its default takes torch to load
    (endurance, nathlon.endurance, set()),
    (evaluate, nathlon.select, {"out"}),
    (gate, nathlon.gate, set()),
    (league, nathlon.league, set()),
    (matrix, nathlon.matrix, set()),
    (plan, nathlon.plan, set()),
    (race, nathlon.race, {"record"}),  # a switch, and a folder
    (recipes, nathlon.recipes, set()),
    (season, nathlon.season, set()),
    (season, nathlon.weekend, {"out"}),  # what its weekends take
    (stints, nathlon.stints, {"compounds"}),  # with commas, and in a row
    (train, nathlon.train, {"coach"}),  # none of some is None for typer
    (twin, nathlon.twin, set()),
    (weekend, nathlon.weekend, set()),
    (worker, nathlon.work, set()),
]


def defaults(function: Callable[..., Any]) -> dict[str, Any]:
    """By parameter; paths as texts."""
    parameters = inspect.signature(function).parameters.values()
    return {
        each.name: str(each.default) if isinstance(each.default, Path) else each.default
        for each in parameters
    }


@pytest.mark.parametrize(
    ("command", "function", "otherwise"),
    PAIRS,
    ids=[f"{command.__name__}, {function.__name__}" for command, function, _ in PAIRS],
)
def test_a_command_and_its_function_have_the_same_defaults(
    command: Callable[..., Any], function: Callable[..., Any], otherwise: set[str]
) -> None:
    own, others = defaults(command), defaults(function)
    shared = own.keys() & others.keys()
    assert shared
    assert {name for name in shared if own[name] != others[name]} == otherwise
