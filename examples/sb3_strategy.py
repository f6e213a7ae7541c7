"""Trains PPO or DQN to say when to stop, and compares it with the planner.

    python examples/sb3_strategy.py --algorithm dqn --steps 50000

Says the mean return of each over the same races: s that the laps took longer than the fastest, negative.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from statistics import fmean
from typing import Any

import gymnasium
import torch
from stable_baselines3 import DQN, PPO
from stable_baselines3.common.base_class import BaseAlgorithm

from nathlon.policies.environments.strategy_env import StrategyEnv

ALGORITHMS: dict[str, Callable[..., BaseAlgorithm]] = {"ppo": PPO, "dqn": DQN}


def mean_return(env: gymnasium.Env[Any, Any], decide: Callable[[Any], int], races: int) -> float:
    """Mean return over races whose seeds no training has seen."""
    returns = []
    for seed in range(100_000, 100_000 + races):
        observation, _ = env.reset(seed=seed)
        total, over = 0.0, False
        while not over:
            observation, reward, over, _, _ = env.step(decide(observation))
            total += float(reward)
        returns.append(total)
    return fmean(returns)


def main(arguments: Sequence[str] | None = None) -> None:
    """Train, and compare."""
    parser = argparse.ArgumentParser(description="Train a strategist on nathlon/Strategy-v0.")
    parser.add_argument("--algorithm", choices=ALGORITHMS, default="ppo")
    parser.add_argument("--steps", type=int, default=50_000, help="laps to learn from")
    parser.add_argument("--races", type=int, default=50, help="races to compare on")
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args(arguments)
    torch.set_num_threads(1)
    env = gymnasium.make("nathlon/Strategy-v0")
    model = ALGORITHMS[options.algorithm]("MlpPolicy", env, seed=options.seed, device="cpu")
    model.learn(options.steps)
    learnt = mean_return(env, lambda seen: int(model.predict(seen, deterministic=True)[0]), options.races)
    planner = env.unwrapped
    assert isinstance(planner, StrategyEnv), "it was made by this name"
    print(f"{options.algorithm}: {learnt:.1f}")
    print(f"planner: {mean_return(env, lambda _: planner.planned(), options.races):.1f}")
    print(f"no stop: {mean_return(env, lambda _: 0, options.races):.1f}")


if __name__ == "__main__":
    main()
