"""Examples that train themselves: what they leave plays by their own loaders, or they say what they need."""

from __future__ import annotations

import os
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from nathlon.arena.watch import Watch
from nathlon.arena.worlds.loaded import loader_of
from nathlon.arena.worlds.player import Asking


def played(world: Any, source: str) -> tuple[list[float], list[str]]:
    """Scores and faults of an episode that a policy plays in all seats."""
    [scenario] = world.scenarios
    players = [
        Asking(world.policy(source), str(seat), seen, done, np.random.default_rng(seat), 1, 1.0).watched(
            Watch(), 0, 0
        )
        for seat, (seen, done) in enumerate(world.spaces(scenario))
    ]
    outcomes = world.play(scenario, players, 1)
    return [one.score for one in outcomes], [player.fault for player in players]


@pytest.mark.parametrize(
    ("name", "needs", "least"),
    [
        ("recurrent", "torch", 16),
        ("jax_es", "jax", 1),
        ("rllib", "tree", 1),
        ("tianshou_dqn", "tianshou", 1),
    ],
)
def test_what_an_example_has_trained_plays(tmp_path: Path, name: str, needs: str, least: int) -> None:
    pytest.importorskip(needs)
    example = import_module(f"examples.worlds.{name}")
    example.train(tmp_path, 1, least)
    files = [path for path in sorted(tmp_path.rglob("*")) if loader_of(example.world.loaders, str(path))]
    [score], [fault] = played(example.world, str(files[0]))
    assert (score > 5, fault) == (True, "")


@pytest.mark.skipif("OLD_GYM" not in os.environ, reason="no interpreter with slimevolleygym")
def test_an_old_game_of_two_plays_in_its_own_interpreter() -> None:
    example = import_module("examples.worlds.slime")
    (left, right), faults = played(example.world, "random")
    assert (left + right, abs(left - right) > 0, faults) == (0, True, ["", ""])


def test_a_simulator_of_lists_plays() -> None:
    pytest.importorskip("lbforaging")
    example = import_module("examples.worlds.foraging")
    scores, faults = played(example.world, "random")
    assert (len(scores), faults) == (2, ["", ""])
