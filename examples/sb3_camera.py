"""Trains SAC of Stable-Baselines3 to drive by what a camera in the cockpit sees.

    python examples/sb3_camera.py --steps 200000 --out runs/sb3-camera
    nathlon race runs/sb3-camera/sac_camera.zip driver:pace=0.8 --scenario race_1v1

`MultiInputPolicy` takes the picture and the sensors as they are. The second command races what it learnt.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

import gymnasium
import torch
from stable_baselines3 import SAC

import nathlon  # noqa: F401  # makes the environments known
from nathlon.sim.camera_spec import CameraSpec
from nathlon.sim.observation import ObservationSpec

OBSERVATION = ObservationSpec(camera=CameraSpec())
CIRCUIT, CAR = "lindenring", "gt3"


def train(steps: int, seed: int, path: Path) -> None:
    """Train alone on the circuit, and save what it learnt.

    Args:
        steps: of the environment, 0.1 s each.
        seed: of everything.
        path: of the `.zip`.
    """
    env = gymnasium.make("nathlon/TimeTrial-v0", circuit=CIRCUIT, car=CAR, observation=OBSERVATION)
    model = SAC(
        "MultiInputPolicy",
        env,
        seed=seed,
        device="cpu",
        buffer_size=min(steps, 50_000),  # a picture is 12 kB, and each step keeps two
        learning_starts=min(steps // 10, 5_000),
        batch_size=64,
    )
    # Plain values beside the pickles of the .zip: what the policy sees, and what it learnt to drive.
    card = {"observation": OBSERVATION.to_dict(), "circuit": CIRCUIT, "car": CAR}
    setattr(model, "nathlon", card)  # noqa: B010  # the class does not declare it
    model.learn(steps, progress_bar=False)
    model.save(path)


def main(arguments: Sequence[str] | None = None) -> None:
    """Train it."""
    parser = argparse.ArgumentParser(description="Train SAC to drive by a camera.")
    parser.add_argument("--steps", type=int, default=200_000, help="environment steps")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--out", type=Path, default=Path("runs/sb3-camera"), help="folder for the model")
    options = parser.parse_args(arguments)
    torch.set_num_threads(1)
    train(options.steps, options.seed, options.out / "sac_camera.zip")


if __name__ == "__main__":
    main()
