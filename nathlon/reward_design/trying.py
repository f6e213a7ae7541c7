"""A candidate's training, its curve and its clips."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import polars as pl

from nathlon.arena.recording import write_recording
from nathlon.policies.load import load_policy
from nathlon.policies.training.config import TrainingConfig
from nathlon.policies.training.log import CURVE_FILE, Status
from nathlon.policies.training.state import STATE_FILE, load_state
from nathlon.policies.training.trainer import CHECKPOINTS, CONFIG_FILE, Trainer
from nathlon.reward_design.clips import Clips, Studio, kept
from nathlon.sim.errors import InputError

CLIPS, RECORDING = "clips", "clip.mcap"


class Tried(NamedTuple):
    """A training that has come to its end.

    Attributes:
        checkpoint: its last one.
        lap_s: mean of four time trials of it; None unless all were completed.
        lap_off_course: share of the time off course in these.
        clips: what it does.
    """

    checkpoint: Path
    lap_s: float | None
    lap_off_course: float
    clips: Clips


def train(folder: Path, config: TrainingConfig, seed: int, on_status: Callable[[Status], None]) -> None:
    """Train in a folder, from where it stopped if it was begun.

    Raises:
        InputError: if the folder holds another training, or it cannot be written.
        Diverged: if the training comes to numbers that are not finite.
    """
    if not (folder / CONFIG_FILE).exists():
        trainer = Trainer.start(folder, config, seed)
    else:
        state = folder / STATE_FILE
        if state.exists() and load_state(folder).updates >= config.updates:
            return
        trainer = Trainer.resume(folder)
        if (trainer.config, trainer.seed) != (config, seed):
            raise InputError(f"{folder}: holds another training, expected that of the design")
    trainer.run(on_status)


def look(folder: Path, name: str, studio: Studio) -> Tried:
    """What a training that is over has come to; its clips are driven if they have not been.

    Raises:
        InputError: if the folder lacks a checkpoint, a curve or clips that can be read.
    """
    checkpoint = max((folder / CHECKPOINTS).glob("*.safetensors"), default=None)
    if checkpoint is None:
        raise InputError(f"{folder}: there is no checkpoint, expected a training that is over")
    if not kept(folder / CLIPS):
        clips, logs = studio.film(load_policy(str(checkpoint), studio.circuit, studio.car), name)
        write_recording(folder / RECORDING, logs[0])
        clips.save(folder / CLIPS)
    last = pl.read_csv(folder / CURVE_FILE).row(-1, named=True)
    lap_s = float(last["lap_s"])
    return Tried(
        checkpoint,
        None if math.isnan(lap_s) else lap_s,
        float(last["off_course_share"]),
        Clips.load(folder / CLIPS),
    )
