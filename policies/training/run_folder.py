"""The folder of a training run: what says which run it is, and where its checkpoints are."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, NonNegativeInt

from nathlon.policies.checkpoint import read_checkpoint
from nathlon.policies.training.config import TrainingConfig
from nathlon.sim.errors import InputError
from nathlon.sim.untrusted_file import read_text
from nathlon.sim.validation import read_json
from nathlon.sim.whole_file import write_whole, writing

CONFIG_FILE = "run.json"
CHECKPOINTS = "checkpoints"


class _Run(BaseModel):
    seed: NonNegativeInt
    config: TrainingConfig


def make_run_folder(folder: Path, config: TrainingConfig, seed: int) -> None:
    """Make a folder that of a new run.

    Raises:
        InputError: if it holds one already, or cannot be written.
    """
    path = folder / CONFIG_FILE
    if path.exists():
        raise InputError(f"{folder}: holds a training run already; resume it or choose another folder")
    with writing(folder):
        (folder / CHECKPOINTS).mkdir(parents=True, exist_ok=True)
        write_whole(path, json.dumps({"seed": seed, "config": config.model_dump()}, indent=1))


def read_run_folder(folder: Path) -> tuple[TrainingConfig, int]:
    """Configuration and seed of the run in a folder.

    Raises:
        InputError: if it holds no run, or one that cannot be read.
    """
    path = folder / CONFIG_FILE
    if not path.exists():
        raise InputError(f"{folder}: no folder of a training run")
    run = read_json(read_text(path, "training run"), _Run, path)
    return run.config, run.seed


def newest_checkpoint(folder: Path) -> Path | None:
    """The newest checkpoint of the run in a folder, if there is any."""
    return max((folder / CHECKPOINTS).glob("*.safetensors"), default=None)


def read_policy(origin: Path, shapes: Mapping[str, tuple[int, ...]]) -> dict[str, NDArray[np.float32]]:
    """The tensors of the policy that a new run starts with, by name.

    Args:
        origin: a checkpoint, or the folder of a run, whose newest one is meant.
        shapes: that they must have, as of a card.

    Raises:
        InputError: if there is none, or it cannot be read or has another network.
    """
    checkpoint = origin if origin.is_file() else newest_checkpoint(origin)
    if checkpoint is None:
        raise InputError(f"{origin}: no checkpoint to start with")
    card, tensors = read_checkpoint(checkpoint)
    if card.shapes != shapes:
        raise InputError(
            f"{checkpoint}: cannot be started from: it has another network than the configuration describes"
        )
    return tensors
