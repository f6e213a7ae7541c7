"""RLlib's new stack: every checkpoint is a folder with an RLModule, known by its `module_state.pkl`.

pip install 'ray[rllib]' torch
python -m examples.worlds.rllib runs/rllib-1 --seed 1
nathlon evaluate runs/rllib-1 --world examples/worlds/rllib.py:world --out runs/rllib-1-selected
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import gymnasium
import torch

from nathlon import GymnasiumWorld

ITERATIONS = 12


def load(path: Path, observation_space: Any, action_space: Any) -> Any:
    """The module in a file's folder: its best choice. Unpickling it runs code, so load your own alone."""
    from ray.rllib.core.rl_module.rl_module import RLModule

    module: Any = RLModule.from_checkpoint(path.parent.absolute())

    def choice(observation: Any) -> Any:
        with torch.no_grad():
            batch = {"obs": torch.as_tensor(observation, dtype=torch.float32)[None]}
            return module.forward_inference(batch)["action_dist_inputs"][0].argmax()

    return choice


def pole() -> Any:
    """A pole on a cart: a point for every step that it stays up."""
    return gymnasium.make("CartPole-v1")


world = GymnasiumWorld(
    {"pole": pole}, load={"module_state.pkl": load}, packages=("gymnasium", "ray", "torch"), most_steps=500
)


def train(out: Path, seed: int, iterations: int = ITERATIONS) -> None:
    """Train with PPO, and save the module after every iteration."""
    from ray.rllib.algorithms.ppo import PPOConfig

    config = PPOConfig().environment("CartPole-v1").env_runners(num_env_runners=0).debugging(seed=seed)
    algorithm = config.build_algo()
    for iteration in range(1, iterations + 1):
        algorithm.train()
        module: Any = algorithm.get_module()
        module.save_to_path((out / f"ppo_{seed}_{iteration:03}").absolute())
    algorithm.stop()


def main() -> None:
    """Read the command line."""
    parser = argparse.ArgumentParser(description="Train with RLlib, and keep a module of every iteration")
    parser.add_argument("out", type=Path, help="folder for the modules")
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    given.out.mkdir(parents=True, exist_ok=True)
    train(given.out, given.seed)


if __name__ == "__main__":
    main()
