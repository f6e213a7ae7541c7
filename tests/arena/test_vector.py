"""Simulators that step many episodes at once: each goes as it goes alone."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from gymnasium.spaces import Box, Discrete

from nathlon.arena.match import Match, Race, Seat
from nathlon.arena.watch import Watch
from nathlon.arena.worlds.vector import VectorWorld

SOURCE = """
import numpy as np
from gymnasium.spaces import Box, Discrete

from nathlon import VectorWorld

BROKEN = 13


class Lights:
    '''A point for the light that is on; episodes last 2 to 6 steps.'''

    single_observation_space, single_action_space = Box(0.0, 1.0, (3,)), Discrete(3)

    def __init__(self, n):
        self.n = n

    def reset(self, seed):
        assert len(seed) == self.n
        self.seed, self.steps = seed, 0
        self.rngs = [np.random.default_rng(one) for one in seed]
        self.lasts = np.array([rng.integers(2, 7) for rng in self.rngs])
        return self.seen(), {}

    def seen(self):
        self.lights = np.array([rng.integers(3) for rng in self.rngs])
        return np.eye(3, dtype=np.float32)[self.lights]

    def step(self, actions):
        assert actions.shape == (self.n,)
        if BROKEN in self.seed:
            raise KeyError("no light")
        right, self.steps = (actions == self.lights).astype(float), self.steps + 1
        even = {"even": np.arange(self.n), "_even": np.arange(self.n) % 2 == 0}
        return self.seen(), right, self.steps >= self.lasts, np.zeros(self.n, bool), even


class Two(Lights):
    '''Two seats see the same; whoever is right takes the point of the other one.'''

    possible_agents = ("left", "right")

    def observation_space(self, seat):
        return self.single_observation_space

    def action_space(self, seat):
        return self.single_action_space

    def reset(self, seed):
        seen, _ = super().reset(seed)
        return dict.fromkeys(self.possible_agents, seen), {"left": {}, "right": {}}

    def step(self, actions):
        left, right = (actions[seat] == self.lights for seat in self.possible_agents)
        seen, _, over, cut, _ = super().step(actions["left"])
        gains = left.astype(float) - right
        told = [dict.fromkeys(self.possible_agents, one) for one in (seen, over, cut)]
        return told[0], {"left": gains, "right": -gains}, told[1], told[2], {"left": {}, "right": {}}


class Names:
    def __init__(self, path):
        self.right = int(path.read_text())

    def __call__(self, observation):
        light = int(observation.argmax())
        return light if light < self.right else (light + 1) % 3


def load(path, observation_space, action_space):
    return Names(path)


alone = VectorWorld({"lights": Lights}, size=5, load=load)
two = VectorWorld({"two": Two}, size=5, load=load)
"""


def world_of(folder: Path, name: str) -> Any:
    from nathlon.arena.world_registry import load_world

    path = folder / "lights.py"
    path.write_text(SOURCE)
    return load_world(f"{path}:{name}")


def names(folder: Path, right: int) -> str:
    path = folder / f"{right}.pt"
    path.write_text(str(right))
    return str(path)


def matches(world: Any, seats: int, counts: tuple[int, ...], first: int = 100) -> dict[int, Any]:
    [scenario] = world.scenarios
    taken = tuple(Seat(seat) for seat in range(seats))
    made, seed = {}, first
    for number, count in enumerate(counts):
        races = tuple(Race(seed + race, taken) for race in range(count))
        called = tuple(f"{number}-{seat}" for seat in range(seats))
        made[number] = Match("test", scenario, scenario, "", "", called, called, races, world.name)
        seed += count
    return made


@pytest.mark.parametrize(("name", "seats"), [("alone", 1), ("two", 2)])
def test_matches_that_share_batches_have_the_results_that_they_have_alone(
    tmp_path: Path, name: str, seats: int
) -> None:
    world = world_of(tmp_path, name)
    policies = [world.policy(names(tmp_path, right)) for right in (3, 1)][:seats]
    made = matches(world, seats, (3, 7, 2))
    together = dict(world.run({number: (match, policies) for number, match in made.items()}, Watch()))
    assert list(together) == [0, 1, 2]
    for number, match in made.items():
        [(_, rows)] = world.run({0: (match, policies)}, Watch())
        assert rows.equals(together[number])
        assert rows.height == seats * len(match.races)
    scores = together[1]["score"].to_numpy()
    assert len(set(scores)) > 2, "episodes differ"
    if seats == 1:
        lasts = [np.random.default_rng(race.seed).integers(2, 7) for race in made[1].races]
        assert scores.tolist() == lasts, "who names all lights has a point a step"


def test_what_breaks_a_batch_costs_its_own_episode_alone(tmp_path: Path) -> None:
    world = world_of(tmp_path, "alone")
    policies = [world.policy(names(tmp_path, 3))]
    made = matches(world, 1, (2, 2), first=12)
    found = dict(world.run({number: (match, policies) for number, match in made.items()}, Watch()))
    endings = [ending for rows in found.values() for ending in rows["ending"]]
    assert endings == ["finished", "simulator_fault", "finished", "finished"]
    assert "no light" in world.fault


class Short:
    """Tells of one episode alone."""

    single_observation_space, single_action_space = Box(0.0, 1.0, (1,)), Discrete(2)

    def __init__(self, n: int) -> None:
        self.n = n

    def reset(self, seed: Any) -> Any:
        return np.zeros((self.n, 1), np.float32), {}

    def step(self, actions: Any) -> Any:
        return (
            np.zeros((self.n, 1), np.float32),
            np.zeros(1),
            np.zeros(self.n, bool),
            np.zeros(self.n, bool),
            {},
        )


def test_a_simulator_that_does_not_tell_of_every_episode_is_at_fault() -> None:
    class Still:
        def act(self, observation: Any, mask: Any = None) -> int:
            return 0

    world = VectorWorld({"short": Short}, size=3)
    with pytest.raises(Exception, match=r"told of shape \(1,\), expected \(3,\)"):
        world.play("short", [Still()], 1)
    with pytest.raises(ValueError, match="size is 0, expected 1 or more"):
        VectorWorld({"short": Short}, size=0)


def test_infos_are_told_of_those_whom_they_concern(tmp_path: Path) -> None:
    from nathlon.arena.worlds.vector import _row

    infos = {"even": np.array([5, 6]), "_even": np.array([True, False]), "of_all": 3, "words": "ab"}
    assert _row(infos, 0) == {"even": 5, "_even": True, "of_all": 3, "words": "ab"}
    assert "even" not in _row(infos, 1)
