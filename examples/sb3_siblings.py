"""Trains a few seeds of PPO on CartPole, and ends those that are proved worse than a sibling.

    python examples/sb3_siblings.py --out runs/siblings

Says how many steps were trained, of how many.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

import gymnasium
import torch
from stable_baselines3 import PPO

import nathlon


def train(folder: Path, seed: int, steps: int, worse_by: float | None) -> int:
    """Train one seed; the steps that it took."""
    model = PPO("MlpPolicy", "CartPole-v1", n_steps=512, seed=seed, device="cpu")
    env = gymnasium.make("CartPole-v1")
    callback = nathlon.NathlonCallback(folder, f"seed-{seed}", env, checkpoints=10, stop_if_worse_by=worse_by)
    model.learn(steps, callback=callback)
    return callback.stopped_at or steps


def main(arguments: Sequence[str] | None = None) -> None:
    """Train all seeds, one after the other."""
    parser = argparse.ArgumentParser(description="Train siblings on CartPole-v1.")
    parser.add_argument("--steps", type=int, default=20_000, help="environment steps of each")
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--worse-by", type=float, help="returns; without it, none is stopped")
    parser.add_argument("--out", type=Path, default=Path("runs/siblings"), help="folder for the checkpoints")
    options = parser.parse_args(arguments)
    torch.set_num_threads(1)
    taken = 0
    for seed in range(1, options.seeds + 1):
        steps = train(options.out, seed, options.steps, options.worse_by)
        print(f"seed {seed}: {steps:,} of {options.steps:,} steps", flush=True)
        taken += steps
    print(f"in all: {taken:,} of {options.seeds * options.steps:,} steps")


if __name__ == "__main__":
    main()
