"""Small environments and worlds for tests, written into a folder; and policies that play in them."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from onnx import TensorProto, helper, numpy_helper

from nathlon.policies.general.checkpoint import GeneralCard, save_general
from nathlon.sim.errors import InputError

ENVIRONMENTS = '''
"""A game: every step shows each seat one of three lights, and whoever names its light gets a point."""
import os
import sys
import time

import numpy as np
from gymnasium.spaces import Box, Dict, Discrete

STEPS = 6


class Game:
    def __init__(self, *seats, fault="", team=False, ahead=0.0, leaves=False, render_mode=None):
        self.render_mode = render_mode
        self.possible_agents = list(seats)
        self.fault, self.team, self.ahead, self.leaves = fault, team, ahead, leaves
        self.episodes = 0
        self.seen = {seat: Box(0.0, 1.0, (3,), np.float32) for seat in seats}
        self.done = {seat: Discrete(3) for seat in seats}

    @property
    def unwrapped(self):
        return self

    def close(self):
        pass

    def render(self):
        """Odd in height and width: a column a seat in its light's colour, with a bar for its hits."""
        if self.fault == "flat":
            return np.zeros((4, 4))
        picture = np.full((121, 60 * len(self.possible_agents) + 1, 3), 30, np.uint8)
        for column, seat in enumerate(self.possible_agents):
            picture[10:50, 60 * column + 10 : 60 * column + 50, self.lights[seat]] = 220
            picture[110 - 10 * self.hits[seat] : 110, 60 * column + 10 : 60 * column + 50] = 200
        return picture

    def observation_space(self, seat):
        return self.seen[seat]

    def action_space(self, seat):
        return self.done[seat]

    def reset(self, seed=None, options=None):
        self.agents, self.step_, self.episodes = list(self.possible_agents), 0, self.episodes + 1
        self.rng = np.random.default_rng([seed, self.episodes] if self.fault == "drifts" else seed)
        self.hits = dict.fromkeys(self.possible_agents, 0)
        return self.look(), {seat: {} for seat in self.agents}

    def look(self):
        self.lights = {seat: int(self.rng.integers(3)) for seat in self.possible_agents}
        seen = {seat: np.eye(3, dtype=np.float32)[self.lights[seat]] for seat in self.agents}
        if self.fault == "nan" and self.step_ == 2:
            seen[self.agents[0]][1] = np.nan
        if self.fault == "shape" and self.step_ == 2:
            seen[self.agents[0]] = np.zeros(4, np.float32)
        return seen

    def step(self, actions):
        self.misbehave()
        right = {seat: float(action == self.lights[seat]) for seat, action in actions.items()}
        mean = sum(right.values()) / len(right)
        rewards = {seat: mean if self.team else right[seat] - mean for seat in right}
        rewards[self.possible_agents[0]] = rewards.get(self.possible_agents[0], 0.0) + self.ahead
        for seat in right:
            self.hits[seat] += int(right[seat])
        infos = {seat: {"hits": self.hits[seat], "words": "none"} for seat in right}
        self.step_ += 1
        over = self.step_ == STEPS
        gone = set(right) if over else set()
        if self.leaves and self.step_ == 2:
            gone |= {self.possible_agents[-1]}
        ends = {seat: seat in gone for seat in right}
        cuts = dict.fromkeys(right, False)
        if self.fault == "forgets" and gone:
            rewards = {seat: reward for seat, reward in rewards.items() if seat not in gone}
        if self.fault == "score" and self.step_ == 3:
            rewards[self.possible_agents[-1]] = float("nan")
        if self.fault == "huge" and self.step_ == 3:
            rewards[self.possible_agents[-1]] = 1e300
        self.agents = [seat for seat in self.agents if seat not in gone]
        rewards = {seat: reward for seat, reward in rewards.items() if seat in right}
        if self.fault == "old":
            return self.look(), rewards, ends, infos
        return self.look() if self.agents else {}, rewards, ends, cuts, infos

    def misbehave(self):
        if self.step_ != 3 or self.episodes > 1:
            return
        if self.fault == "hangs":
            time.sleep(600)
        if self.fault == "exits":
            os._exit(3)
        if self.fault == "raises":
            raise KeyError("no such light")
        if self.fault == "prints":
            while True:
                print("on and on")
                time.sleep(0.001)
        if self.fault == "garbage":
            os.write(int(sys.argv[1]), (4).to_bytes(4, "big") + b"what")


class Alone:
    """One seat, with the API of Gymnasium, or that of Gym before it."""

    observation_space = Box(0.0, 1.0, (3,), np.float32)
    action_space = Discrete(3)

    def reset(self, seed=None, options=None):
        self.rng, self.steps = np.random.default_rng(seed), 0
        return self.look(), {}

    def look(self):
        self.light = int(self.rng.integers(3))
        return np.eye(3, dtype=np.float32)[self.light]

    def step(self, action):
        reward, self.steps = float(action == self.light), self.steps + 1
        return self.look(), reward, False, self.steps == STEPS, {"steps": self.steps}


class Old(Alone):
    def seed(self, seed):
        self.drawn = seed

    def reset(self):
        return super().reset(self.drawn)[0]

    def step(self, action):
        seen, reward, _, over, info = super().step(action)
        return seen, reward, over, {**info, "TimeLimit.truncated": over}


class Nested(Game):
    def observation_space(self, seat):
        return Dict({"light": self.seen[seat]})


class Unlike(Game):
    """The prey sees a number more, which tells nothing."""

    def observation_space(self, seat):
        return Box(0.0, 1.0, (4,), np.float32) if seat == "prey" else self.seen[seat]

    def look(self):
        seen = super().look()
        if "prey" in seen:
            seen["prey"] = np.append(seen["prey"], np.float32(1.0))
        return seen


def duel():
    return Game("left", "right")


def seen():
    return Game("left", "right", render_mode="rgb_array")


def uneven():
    return Game("left", "right", ahead=1.0)


def trio():
    return Game("red", "green", "blue")


def team():
    return Game("a", "b", team=True)


def leaves():
    return Game("left", "right", leaves=True)


def chase():
    return Game("hunter_1", "hunter_2", "prey", "tree")


def hunt():
    return Unlike("hunter_1", "hunter_2", "prey")


def nested():
    return Nested("left", "right")


def faulty(fault):
    return lambda: Game("left", "right", fault=fault, render_mode="rgb_array")


hangs, exits, prints, garbage = map(faulty, ("hangs", "exits", "prints", "garbage"))
'''

WORLD = """
import runpy
import sys
from pathlib import Path

from nathlon import Declared, GymnasiumWorld, PettingZooWorld

envs = runpy.run_path(str(Path(__file__).with_name("envs.py")))
"""


def world_of(folder: Path, made: str, file: str = "worlds.py") -> str:
    """The name of a world in a folder: what the expression `made` gives, of `envs` and the world classes."""
    (folder / "envs.py").write_text(ENVIRONMENTS)
    (folder / file).write_text(f"{WORLD}\nworld = {textwrap.dedent(made)}\n")
    return f"{folder / file}:world"


def player(path: Path, right: int, inputs: int = 3) -> str:
    """The source of a policy that names so many of the three lights rightly, as an ONNX graph.

    Inputs beyond the three lights are ignored.
    """
    weights = np.zeros((inputs, 3), np.float32)
    for light in range(3):
        weights[light, light if light < right else (light + 1) % 3] = 1.0
    graph = helper.make_graph(
        [helper.make_node("MatMul", ["x", "w"], ["y"])],
        "policy",
        [helper.make_tensor_value_info("x", TensorProto.FLOAT, ["batch", inputs])],
        [helper.make_tensor_value_info("y", TensorProto.FLOAT, ["batch", 3])],
        [numpy_helper.from_array(weights, "w")],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)
    path.write_bytes(model.SerializeToString())
    return str(path)


@contextmanager
def refused(*said: str) -> Iterator[None]:
    """Assert that something is refused in one line that has these words."""
    with pytest.raises(InputError) as caught:
        yield
    for words in said:
        assert words in str(caught.value)
    assert "\n" not in str(caught.value)


def box_player(path: Path) -> str:
    """The source of a policy whose actions are those of a Box, so that it fits no game."""
    card = GeneralCard(
        algorithm="test", hidden=(2,), observation_size=3, action_size=1, step=1, seed=1, created_by={}
    )
    save_general(path, {name: np.zeros(shape, np.float32) for name, shape in card.shapes.items()}, card)
    return str(path)
