"""Trains SAC of Stable-Baselines3 and TQC of sb3-contrib on nathlon's Gymnasium environment.

    python examples/sb3_sac_tqc.py --steps 300000 --out runs/sb3
    nathlon evaluate runs/sb3 --out runs/sb3-selection

The first command leaves ten checkpoints of each, the second says which one to send to the race.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import gymnasium
import torch
from sb3_contrib import TQC
from stable_baselines3 import SAC
from stable_baselines3.common.callbacks import CheckpointCallback
from stable_baselines3.common.off_policy_algorithm import OffPolicyAlgorithm

import nathlon  # noqa: F401  # makes the environments known
from nathlon.sim.observation import ObservationSpec

OBSERVATION = ObservationSpec(course_points=20)
CIRCUIT, CAR = "lindenring", "gt3"
CHECKPOINTS = 10
LEARNERS: dict[str, type[OffPolicyAlgorithm]] = {"sac": SAC, "tqc": TQC}


def train(name: str, steps: int, seed: int, folder: Path) -> None:
    """Train one learner alone on the circuit; leaves `NAME_STEPS_steps.zip` files in the folder.

    Args:
        name: of the learner, `sac` or `tqc`.
        steps: of the environment, 0.1 s each.
        seed: of everything.
        folder: for the checkpoints.
    """
    env = gymnasium.make("nathlon/TimeTrial-v0", circuit=CIRCUIT, car=CAR, observation=OBSERVATION)
    settings: dict[str, Any] = {
        "buffer_size": min(steps, 500_000),
        "learning_starts": min(steps // 10, 5_000),
        "policy_kwargs": {"net_arch": [256, 256]},
    }
    model = LEARNERS[name]("MlpPolicy", env, seed=seed, device="cpu", **settings)
    # Plain values beside the pickles of the .zip: what the policy sees, and what it learnt to drive.
    card = {"observation": OBSERVATION.to_dict(), "circuit": CIRCUIT, "car": CAR}
    setattr(model, "nathlon", card)  # noqa: B010  # the class does not declare it
    keep = CheckpointCallback(max(1, steps // CHECKPOINTS), str(folder), name)
    model.learn(steps, callback=keep, progress_bar=False)


def main(arguments: Sequence[str] | None = None) -> None:
    """Train both learners."""
    parser = argparse.ArgumentParser(description="Train SAC and TQC on nathlon/TimeTrial-v0.")
    parser.add_argument("--steps", type=int, default=300_000, help="environment steps of each")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--out", type=Path, default=Path("runs/sb3"), help="folder for the checkpoints")
    options = parser.parse_args(arguments)
    torch.set_num_threads(1)
    for name in LEARNERS:
        train(name, options.steps, options.seed, options.out)


if __name__ == "__main__":
    main()
