"""A candidate's training, its curve and its clips."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import polars as pl

from nathlon.arena.recording import write_recording
from nathlon.lab.reward.clips import Clips, Studio, kept
from nathlon.policies.checkpoint import load_checkpoint
from nathlon.policies.training.config import TrainingConfig
from nathlon.policies.training.log import CURVE_FILE, Status
from nathlon.policies.training.run_folder import CONFIG_FILE, newest_checkpoint
from nathlon.policies.training.state import STATE_FILE, load_state
from nathlon.policies.training.trainer import Trainer
from nathlon.sim.errors import InputError

CLIPS, RECORDING = "clips", "clip.mcap"


class Point(NamedTuple):
    """A checkpoint: mean of four laps, nan unless all were driven, and share of time off course."""

    updates: int
    lap_s: float
    off_course_share: float


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

    Args:
        folder: of the training.
        name: by which it is shown.
        studio: where clips are made.

    Raises:
        InputError: if the folder lacks a checkpoint, its row of the curve, or clips that can be read.
    """
    checkpoint = newest_checkpoint(folder)
    if checkpoint is None:
        raise InputError(f"{folder}: there is no checkpoint, expected a training that is over")
    policy = load_checkpoint(checkpoint)
    if not kept(folder / CLIPS):
        clips, logs = studio.film(policy, name)
        write_recording(folder / RECORDING, logs[0])
        clips.save(folder / CLIPS)
    last = next((point for point in reversed(curve(folder)) if point.updates == policy.card.step), None)
    if last is None:
        raise InputError(
            f"{folder / CURVE_FILE}: lacks update {policy.card.step}, expected the last checkpoint's"
        )
    lap_s = None if math.isnan(last.lap_s) else last.lap_s
    return Tried(checkpoint, lap_s, last.off_course_share, Clips.load(folder / CLIPS))


def curve(folder: Path) -> tuple[Point, ...]:
    """The checkpoints that a training has measured; empty if there are none yet."""
    path = folder / CURVE_FILE
    if not path.exists():
        return ()
    rows = pl.read_csv(path).select("updates", "lap_s", "off_course_share").iter_rows()
    return tuple(Point(int(updates), float(lap_s), float(share)) for updates, lap_s, share in rows)
