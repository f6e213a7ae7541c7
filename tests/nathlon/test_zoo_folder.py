"""A folder of RL Zoo as it is: its policies play, and one of them is sent."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from nathlon.arena.match import Match, Race, Seat
from nathlon.arena.watch import Watch
from nathlon.arena.world_registry import load_world
from nathlon.policies.sources.finding import find_sources
from nathlon.selection.publish.sent import copy_policy
from tests.support.games import refused

WORLD = '''
import gymnasium
import numpy as np
from gymnasium.spaces import Box, Discrete

from nathlon import GymnasiumWorld


class Named(gymnasium.Env):
    """A point for the choice that is the goal, and observations far from 0."""

    observation_space, action_space = Box(-99.0, 99.0, (3,), np.float64), Discrete(4)

    def __init__(self, goal=0):
        self.goal = goal

    def reset(self, seed=None, options=None):
        super().reset(seed=seed)
        self.steps = 0
        return self.seen(), {}

    def seen(self):
        return self.np_random.uniform(-1.0, 1.0, 3) * [20.0, 1.0, 0.1] + 40.0

    def step(self, action):
        self.steps += 1
        return self.seen(), float(action == self.goal), False, self.steps == 5, {}


def named():
    return gymnasium.make("Named-v0", goal=2)


gymnasium.register("Named-v0", entry_point=Named)
world = GymnasiumWorld({"named": named}, packages=("gymnasium",), most_steps=5)
'''


def test_a_folder_plays_and_the_file_that_is_sent_is_the_same(tmp_path: Path) -> None:
    """What the Zoo leaves beside the policies is no policy; its arguments say how to make the environment."""
    from stable_baselines3 import PPO
    from stable_baselines3.common.vec_env import DummyVecEnv, VecNormalize

    (tmp_path / "named.py").write_text(WORLD)
    world = load_world(f"{tmp_path / 'named.py'}:world")
    run = tmp_path / "logs" / "ppo" / "Named-v0_1"
    (run / "Named-v0").mkdir(parents=True)
    inside: Any = world
    environments: Any = VecNormalize(DummyVecEnv([lambda: inside.made("named")._environment]))
    for seed, name in enumerate(["Named-v0", "best_model", "rl_model_8_steps"]):
        model: Any = PPO("MlpPolicy", environments, n_steps=8, batch_size=8, seed=seed, device="cpu")
        model.policy.action_net.bias.data[seed] = 9.0
        model.save(run / name)
    environments.save(str(run / "Named-v0" / "vecnormalize.pkl"))
    (run / "Named-v0" / "config.yml").write_text("normalize: \"{'norm_obs': True}\"\n")
    arguments = run / "Named-v0" / "args.yml"
    arguments.write_text("env_kwargs:\n  goal: 2\n")
    for beside in ("evaluations.npz", "0.monitor.csv", "command.txt"):
        (run / beside).write_bytes(b"PK\x03\x04 and more")

    sources = find_sources([run])
    entrants = [world.enter(source) for source in sources]
    assert [one.name for one in entrants] == ["Named-v0", "best_model", "rl_model_8_steps"]
    ids = tuple(one.id for one in entrants)
    races = tuple(Race(7, (Seat(number),)) for number in range(3))
    match = Match("test", "named", "named", "", "", ids, tuple(sources), races, world.name)
    [(_, rows)] = world.run({0: (match, list(map(world.policy, sources)))}, Watch())
    assert rows["score"].to_list() == [0.0, 0.0, 5.0]

    copy_policy(run / "rl_model_8_steps.zip", tmp_path / "sent.zip")
    assert world.enter(str(tmp_path / "sent.zip")).id == ids[2]

    arguments.write_text("env_kwargs:\n  goal: 1\n")
    with refused("best_model.zip: was trained in an environment made with goal=1", "by gymnasium.make"):
        world.policy(str(run / "best_model.zip"))
