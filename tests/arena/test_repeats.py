"""Whether a world's episodes repeat: faults that are planted, each of which must be found."""

from __future__ import annotations

from pathlib import Path

import pytest

from nathlon.arena.pool import Pool
from nathlon.arena.world_registry import load_world
from nathlon.arena.worlds.rehearsal import rehearse
from nathlon.arena.worlds.repeats import SEEDS, Elsewhere, differs, play_here, repeated, starts

PLANTED = '''
"""A light with a position to read, and what may be wrong with it."""
import random
import time

import gymnasium
import numpy as np
from gymnasium.spaces import Box

from nathlon import GymnasiumWorld

STEPS = 20
WORDS = [f"wall {number}" for number in range(12)]
drawn = np.random.default_rng().uniform()


class Slide(gymnasium.Env):
    observation_space = Box(-np.inf, np.inf, (2,), np.float32)
    action_space = Box(-1.0, 1.0, (1,), np.float32)

    def __init__(self):
        self.resets, self.friction, self.left = 0, 0.1, 0.0
        self.own = np.random.default_rng()
        self.bias = 0.0
        self.begin()

    def begin(self):
        """Once, when it is made."""

    def reset(self, seed=None, options=None):
        super().reset(seed=seed)
        self.resets += 1
        self.steps, self.x = 0, float(self.np_random.uniform(-1, 1))
        self.on_reset()
        return self.seen(), {}

    def on_reset(self):
        """At every start."""

    def seen(self):
        return np.array([self.x + self.bias, self.steps], np.float32)

    def length(self):
        return STEPS

    def reward(self):
        return -abs(self.x)

    def step(self, action):
        self.steps += 1
        self.x += (1 - self.friction) * float(action[0])
        return self.seen(), self.reward(), self.steps >= self.length(), False, {}


class BiasInInit(Slide):
    def begin(self):
        self.bias = self.own.uniform()


class HashOfText(Slide):
    def begin(self):
        self.bias = hash("slope") % 1000


class OrderOfASet(Slide):
    def begin(self):
        self.bias = float(WORDS.index(list(set(WORDS))[0])) + 12 * WORDS.index(list(set(WORDS))[1])


class DrawnAtImport(Slide):
    def begin(self):
        self.bias = drawn


class FrictionEveryTenth(Slide):
    def on_reset(self):
        if self.resets % 10 == 0:
            self.friction = self.own.uniform(0, 0.5)


class RareNoise(Slide):
    def begin(self):
        self.own = np.random.default_rng(7)

    def reward(self):
        return super().reward() + (self.own.uniform() if self.own.uniform() < 0.01 else 0.0)


class StartOfItsOwn(Slide):
    def on_reset(self):
        self.x = self.own.uniform(-1, 1)


class SameStart(Slide):
    def on_reset(self):
        self.x = 0.5


class SameStartThenNoise(Slide):
    def on_reset(self):
        self.x = 0.5

    def reward(self):
        self.x += self.np_random.normal()
        return super().reward()


class NoisyReward(Slide):
    def reward(self):
        return super().reward() + 1e-9 * self.own.normal()


class LengthByCount(Slide):
    def length(self):
        return STEPS + self.resets % 3

    def reward(self):
        return 0.0


class KeepsTheLast(Slide):
    """What is left of the episode before is where it ended: only another seed between shows it."""

    def on_reset(self):
        self.bias, self.left = 0.0, self.left

    def step(self, action):
        if self.steps == 1:
            self.x += 1e-3 * self.left
        answer = super().step(action)
        self.left = round(self.x) if self.steps == STEPS else self.left
        return answer


class Clock(Slide):
    def reward(self):
        return time.perf_counter() % 1e-3


class Wears(Slide):
    """After a dozen episodes something is full."""

    def on_reset(self):
        self.friction = 0.1 if self.resets < 14 else 0.2


class GlobalGenerators(Slide):
    """Drawn from generators of the process, which are seeded for every episode."""

    def on_reset(self):
        self.x = random.random() + np.random.uniform()


def normalized():
    return gymnasium.wrappers.NormalizeObservation(gymnasium.make("Pendulum-v1"))


made = {one.__name__: one for one in Slide.__subclasses__()} | {"Slide": Slide, "normalized": normalized}
world = GymnasiumWorld(made)
'''

HERE = [
    "FrictionEveryTenth",
    "RareNoise",
    "StartOfItsOwn",
    "NoisyReward",
    "LengthByCount",
    "KeepsTheLast",
    "Clock",
    "Wears",
    "normalized",
]
ELSEWHERE = ["BiasInInit", "HashOfText", "OrderOfASet", "DrawnAtImport"]


@pytest.fixture(scope="module")
def name(tmp_path_factory: pytest.TempPathFactory) -> str:
    path: Path = tmp_path_factory.mktemp("planted") / "planted.py"
    path.write_text(PLANTED)
    return f"{path}:world"


@pytest.mark.parametrize("scenario", HERE)
def test_a_fault_that_shows_in_one_process_is_found(name: str, scenario: str) -> None:
    world = load_world(name)
    _, said = repeated(world, scenario, world.setup(scenario), 0.0)
    assert said.startswith("seat 'agent': ")
    assert "is played again as episode" in said


@pytest.mark.parametrize("scenario", ["Slide", "GlobalGenerators", *ELSEWHERE])
def test_what_repeats_is_not_blamed(name: str, scenario: str) -> None:
    world = load_world(name)
    played, said = repeated(world, scenario, world.setup(scenario), 0.0)
    assert said == ""
    assert {episode.seed for episode in played} == set(SEEDS)
    assert starts(played) == ""


def test_what_needs_another_process_is_found_there(name: str) -> None:
    world = load_world(name)
    elsewhere = Elsewhere(name, "1", 100.0)
    for scenario in ["Slide", "GlobalGenerators", *ELSEWHERE]:
        there, setup = elsewhere.play(scenario), world.setup(scenario)
        assert not isinstance(there, str), there
        said = [differs(setup, *both) for both in zip(play_here(name, scenario), there, strict=True)]
        assert all(said) if scenario in ELSEWHERE else not any(said), scenario
    assert "no such scenario" in str(elsewhere.play("no such scenario"))
    elsewhere.close()


def test_a_check_says_what_does_not_repeat_and_what_does_alike(tmp_path: Path, pool: Pool) -> None:
    path = tmp_path / "two.py"
    made = "{'same': SameStart, 'bias': BiasInInit}"
    path.write_text(f"{PLANTED}\nworld = GymnasiumWorld({made})\n")
    report = rehearse(pool, f"{path}:world")
    [fault] = report.faults
    assert fault.scenario == "bias"
    assert "observation 1 is another one in another process with another hash seed" in fault.says
    [warning] = [finding for finding in report.findings if finding.warning]
    assert warning.scenario == "same"
    assert any("may stay unseen" in finding.says for finding in report.findings)


@pytest.mark.parametrize(
    ("scenario", "words"), [("SameStart", "give the same episode"), ("SameStartThenNoise", "start alike")]
)
def test_seeds_without_effect_are_told_of(name: str, scenario: str, words: str) -> None:
    world = load_world(name)
    played, said = repeated(world, scenario, world.setup(scenario), 0.0)
    assert said == ""
    assert words in starts(played)
