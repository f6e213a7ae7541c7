"""The folder of a training run: what says which run it is, and where its checkpoints are."""

from __future__ import annotations

import json
from pathlib import Path

from pydantic import BaseModel, NonNegativeInt

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
        raise InputError(f"{path}: no training run to resume")
    run = read_json(read_text(path, "training run"), _Run, path)
    return run.config, run.seed
